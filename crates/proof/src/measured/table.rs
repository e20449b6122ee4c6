//! All measured recordings: counts, JSON, and the table for the documentation.

use std::fmt::Write;

use serde_json::{Value, json};

use super::compare::Compared;
use crate::Stamp;
use crate::concealed::Concealed;
use crate::measure::{Bar, Measure, by_name};

/// Every recording of every set, counted.
pub struct Measured {
    /// What it was made with.
    pub stamp: Stamp,
    /// Recordings.
    pub sets: Vec<Compared>,
    /// Changes hidden in them, if that was asked for.
    pub concealed: Vec<Concealed>,
    /// Counts.
    pub measures: Vec<Measure>,
}

impl Measured {
    /// Counts.
    pub fn new(stamp: Stamp, sets: Vec<Compared>, concealed: Vec<Concealed>) -> Self {
        let present = || sets.iter().flat_map(|set| set.present.iter().map(move |id| (set, id)));
        let sure = |set: &Compared| set.findings.iter().filter(|(_, probability)| *probability > 0.9).count();
        let marks = |wrong: usize, all: usize| (0..all).map(move |place| place < wrong);
        let mut measures = vec![
            Measure::share(
                "named",
                "effects of the keys that are findings",
                None,
                present().map(|(set, id)| set.found.contains(id)),
            ),
            Measure::share(
                "named_or_listed",
                "effects of the keys that are findings or named as a rival of one",
                Some(Bar::AtLeast(1.0)),
                present().map(|(set, id)| !set.missed.contains(id)),
            ),
            Measure::share(
                "sure_and_wrong",
                "findings above 0.9 that no key knows",
                Some(Bar::AtMost(0.0)),
                sets.iter().flat_map(|set| marks(set.sure_and_wrong.len(), sure(set))),
            ),
            Measure::share(
                "absent_claimed",
                "effects that a key says are absent, given more than 0.5 (over recordings)",
                Some(Bar::AtMost(0.0)),
                sets.iter().map(|set| !set.absent_claimed.is_empty()),
            ),
            Measure::share(
                "sizes_within_20_pct",
                "sizes within a fifth of the key",
                Some(Bar::AtLeast(1.0)),
                sets.iter().flat_map(|set| &set.sizes).map(|size| size.holds),
            ),
            Measure::median(
                "median_excess_error_removed",
                "median held-out excess error that the best right finding removes (none found removes nothing)",
                Bar::AtLeast(0.5),
                sets.iter()
                    .filter(|set| !set.present.is_empty())
                    .map(|set| set.removed.unwrap_or(0.0))
                    .collect(),
            ),
            Measure::share(
                "refused",
                "recordings that were refused",
                None,
                sets.iter().map(|set| set.refused.is_some()),
            ),
            Measure::mean(
                "seconds_per_case",
                "mean seconds of a diagnosis",
                None,
                sets.iter().map(|set| set.seconds).sum(),
                sets.len(),
            ),
        ];
        measures.extend(crate::concealed::measures(&concealed));
        Measured { stamp, sets, concealed, measures }
    }

    /// The document `kort.prove/1` for measured recordings.
    pub fn json(&self) -> Value {
        json!({ "schema": "kort.prove/1", "kort_version": env!("CARGO_PKG_VERSION"), "commit": self.stamp.commit,
                "constants": self.stamp.constants, "seed": null, "cases": self.sets.len() + self.concealed.len(),
                "measures": by_name(&self.measures), "confusion": {}, "sets": self.sets, "concealed": self.concealed })
    }

    /// The table, and the counts above it, in Markdown.
    pub fn markdown(&self) -> String {
        let mut out =
            format!("At commit `{}`, diagnosis constants `{}`.\n\n", self.stamp.commit, self.stamp.constants);
        out += "| measure | value | count | 95 % |\n| --- | --- | --- | --- |\n";
        for measure in &self.measures {
            let _ = writeln!(out, "| {} |", cells(measure).join(" | "));
        }
        if !self.sets.is_empty() {
            out += "\n| set | recording | verdict | found | missed | sure and wrong | error before, after | key |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n";
        }
        for set in &self.sets {
            let percent =
                |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{:.1} %", 100.0 * value));
            let key = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.1} %"));
            let found = set.findings.iter().map(|(id, p)| {
                let mark = if set.found.contains(id) { " (right)" } else { "" };
                format!("`{id}` {p:.2}{mark}")
            });
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} | {} | {}, {} | {}, {} |",
                set.set,
                set.recording.trim_end_matches(".gz").trim_end_matches(".csv"),
                if set.refused.is_some() { "refused" } else { &set.verdict },
                or_dash(found.collect::<Vec<_>>().join(", ")),
                or_dash(set.missed.iter().map(|id| format!("`{id}`")).collect::<Vec<_>>().join(", ")),
                or_dash(set.sure_and_wrong.iter().map(|id| format!("`{id}`")).collect::<Vec<_>>().join(", ")),
                percent(set.nrmse_before),
                percent(set.nrmse_after),
                key(set.key_error_pct_fs.0),
                key(set.key_error_pct_fs.1),
            );
        }
        let sizes: Vec<String> = self
            .sets
            .iter()
            .flat_map(|set| set.sizes.iter().map(move |size| (set, size)))
            .map(|(set, size)| {
                let [low, high] = size.key;
                let key = if low == high { format!("{low}") } else { format!("{low} to {high}") };
                format!(
                    "| {} | `{}` | {} | {key} | {:.4} | {} |",
                    set.recording,
                    size.effect,
                    size.name,
                    size.ours,
                    if size.holds { "holds" } else { "off" }
                )
            })
            .collect();
        if !sizes.is_empty() {
            out += "\n| recording | effect | size | key | ours | |\n| --- | --- | --- | --- | --- | --- |\n";
            out += &(sizes.join("\n") + "\n");
        }
        out + &crate::concealed::markdown(&self.concealed)
    }
}

/// A measure as cells of a table: words, value, count, interval.
pub fn cells(measure: &Measure) -> Vec<String> {
    let value = measure.value.map_or("-".to_owned(), |value| match measure.name {
        "seconds_per_case" => format!("{value:.1} s"),
        name if name.starts_with("calibration_error") => format!("{value:.3}"),
        _ => format!("{:.1} %", 100.0 * value),
    });
    let whole = measure.numerator.fract() == 0.0;
    let numerator =
        if whole { format!("{:.0}", measure.numerator) } else { format!("{:.1}", measure.numerator) };
    let interval = measure
        .wilson_95
        .map_or(String::new(), |[low, high]| format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high));
    vec![measure.what.to_owned(), value, format!("{numerator} of {}", measure.denominator), interval]
}

fn or_dash(text: String) -> String {
    if text.is_empty() { "-".to_owned() } else { text }
}
