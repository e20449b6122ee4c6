//! The proof as text, Markdown and one self-contained page.

use std::collections::BTreeSet;
use std::fmt::Write;

use maud::html;

use kort_proof::measure::{Bar, Measure};
use kort_proof::measured::Measured;
use kort_proof::measured::table::cells;
use kort_proof::tally::Proof;

use crate::render::{Chart, Mark, Page, Series, heat_map, note, table};

const WHAT: &str = "Every case is simulated by a truth of its own (other equations, other integrator, own sensor \
chain; forms, machines, noise and what lies outside the catalogue are drawn), hides what its answer says, and is \
diagnosed from the recording and the rig file alone. The answers are opened afterwards.";

/// A measure as cells: words, value, count, 95 % interval, bar, whether it is met.
fn row(measure: &Measure) -> Vec<String> {
    let [what, value, count, interval] = cells(measure).try_into().unwrap_or_default();
    let bar = |side: &str, bar: f64| match measure.name {
        "seconds_per_case" => format!("{side} {bar:.0} s"),
        "calibration_error" => format!("{side} {bar:.2}"),
        _ => format!("{side} {:.0} %", 100.0 * bar),
    };
    let bar = match measure.bar {
        Some(Bar::AtLeast(value)) => bar("at least", value),
        Some(Bar::AtMost(value)) => bar("at most", value),
        None => String::new(),
    };
    let met = match measure.met() {
        Some(true) => "met",
        Some(false) => "short",
        None => "-",
    };
    vec![what, value, count, interval, bar, met.to_owned()]
}

const HEAD: [&str; 6] = ["measure", "value", "count", "95 %", "bar", ""];

/// A table of measures as text.
fn measures_text(measures: &[Measure]) -> String {
    let mut out = String::new();
    for measure in measures {
        let cells = row(measure);
        let _ = writeln!(
            out,
            "{:<84} {:>8}  {:<14} {:<12} {:<15} {}",
            cells[0], cells[1], cells[2], cells[3], cells[4], cells[5]
        );
    }
    out
}

fn head(proof: &Proof) -> String {
    let tuning = if proof.tuning { ", for tuning: not to be reported" } else { "" };
    format!(
        "{} cases, seeds from {}{tuning}; commit {}, diagnosis constants {}",
        proof.cases.len(),
        proof.seed,
        proof.stamp.commit,
        proof.stamp.constants
    )
}

/// Measured recordings as plain text.
pub fn measured_text(measured: &Measured) -> String {
    let mut out = format!(
        "Measured recordings: {}; commit {}, diagnosis constants {}\n\n{}\n",
        measured.sets.len(),
        measured.stamp.commit,
        measured.stamp.constants,
        measures_text(&measured.measures)
    );
    for set in &measured.sets {
        let findings: Vec<String> = set.findings.iter().map(|(id, p)| format!("{id} {p:.2}")).collect();
        let _ = writeln!(out, "{}/{}: {} [{}]", set.set, set.recording, set.verdict, findings.join(", "));
        for (word, list) in [
            ("missed", &set.missed),
            ("sure and wrong", &set.sure_and_wrong),
            ("called present though absent", &set.absent_claimed),
        ] {
            if !list.is_empty() {
                let _ = writeln!(out, "    {word}: {}", list.join(", "));
            }
        }
        if let Some(refused) = &set.refused {
            let _ = writeln!(out, "    refused: {}", refused.lines().next().unwrap_or_default());
        }
        for size in &set.sizes {
            let _ = writeln!(
                out,
                "    {} {}: {:.4}, key {} to {}{}",
                size.effect,
                size.name,
                size.ours,
                size.key[0],
                size.key[1],
                if size.holds { "" } else { " (off)" }
            );
        }
    }
    for one in &measured.concealed {
        let findings: Vec<String> = one.findings.iter().map(|(id, p)| format!("{id} {p:.2}")).collect();
        let found = match (one.already_there, one.found, one.listed) {
            (true, ..) => "held already",
            (_, true, _) => "found",
            (_, _, true) => "listed",
            _ => "not found",
        };
        let _ = writeln!(
            out,
            "{}/{}: {}: {found}: {} [{}]",
            one.set,
            one.recording,
            one.what,
            one.verdict,
            findings.join(", ")
        );
    }
    out
}

/// Plain text.
pub fn text(proof: &Proof) -> String {
    let mut out = format!("Blind proof of diagnose: {}\n\n{}", head(proof), measures_text(&proof.measures));
    let _ = writeln!(out, "\nWhat was hidden, and what was named first instead:");
    for (hidden, named) in proof.confusion() {
        for (name, count) in named.iter().filter(|(name, _)| wrong(&hidden, name)) {
            let _ = writeln!(out, "  {hidden:<32} {name} ({count})");
        }
    }
    out
}

/// A Markdown page for the documentation.
pub fn markdown(proof: &Proof) -> String {
    let mut out = format!(
        "# Blind proof of `kort diagnose`\n\nWritten by `kort prove --seed {} --cases {} --markdown docs/proof.md`; do not edit. {}.\n\n{WHAT}\n\n",
        proof.seed,
        proof.cases.len(),
        head(proof)
    );
    let _ = writeln!(out, "| {} |\n|{}", HEAD.join(" | "), " --- |".repeat(HEAD.len()));
    for measure in &proof.measures {
        let _ = writeln!(out, "| {} |", row(measure).join(" | "));
    }
    out += "\nSizes are root-mean-square changes of the best channel over its full scale, before any re-fit.\n\n## What was named first instead\n\n| hidden | named first | cases |\n| --- | --- | --- |\n";
    for (hidden, named) in proof.confusion() {
        for (name, count) in named.iter().filter(|(name, _)| wrong(&hidden, name)) {
            let _ = writeln!(out, "| `{hidden}` | `{name}` | {count} |");
        }
    }
    out += "\n## Calibration of `probability`\n\n| stated | right | findings |\n| --- | --- | --- |\n";
    for bin in proof.bins.iter().filter(|bin| bin.count > 0) {
        let _ = writeln!(out, "| {:.2} | {:.2} | {} |", bin.stated, bin.right, bin.count);
    }
    out
}

/// One page with the confusion matrix and the calibration plot.
pub fn html(proof: &Proof) -> String {
    let mut page = Page::new("Blind proof of kort diagnose", head(proof));
    let short = proof.measures.iter().filter(|m| m.met() == Some(false)).count();
    let tone = if short == 0 { "good" } else { "warn" };
    page.add(html! { p class="lead" { (WHAT) } });
    page.add(note(tone, html! { (proof.measures.len() - short) " of " (proof.measures.len()) " measures are not short of their bar." }));
    page.section("Measures", table(&HEAD, &proof.measures.iter().map(row).collect::<Vec<_>>()));

    let confusion = proof.confusion();
    let rows: Vec<String> = confusion.keys().cloned().collect();
    let named: BTreeSet<&String> = confusion.values().flat_map(|row| row.keys()).collect();
    let columns: Vec<String> = named.into_iter().cloned().collect();
    let values: Vec<Vec<f64>> = rows
        .iter()
        .map(|hidden| {
            columns.iter().map(|name| confusion[hidden].get(name).copied().unwrap_or(0) as f64).collect()
        })
        .collect();
    page.section(
        "Confusion",
        heat_map(
            "Rows: what was hidden. Columns: what was named first, or the verdict where nothing was named.",
            &rows,
            &columns,
            &values,
        ),
    );

    let filled: Vec<_> = proof.bins.iter().filter(|bin| bin.count > 0).collect();
    let stated: Vec<f64> = filled.iter().map(|bin| bin.stated).collect();
    let right: Vec<f64> = filled.iter().map(|bin| bin.right).collect();
    let chart = Chart::new(
        "Of findings given a probability, the share that is right.",
        "stated probability",
        "share right",
    )
    .with(Series::new("as calibrated", Mark::Dashed, &[0.0, 1.0], &[0.0, 1.0]))
    .with(Series::new("findings", Mark::Dots, &stated, &right));
    let bins: Vec<Vec<String>> = filled
        .iter()
        .map(|bin| vec![format!("{:.2}", bin.stated), format!("{:.2}", bin.right), bin.count.to_string()])
        .collect();
    page.section("Calibration", html! { (chart.draw()) (table(&["stated", "right", "findings"], &bins)) });

    let cases: Vec<Vec<String>> = proof
        .cases
        .iter()
        .map(|case| {
            let claims: Vec<String> = case
                .claims
                .iter()
                .map(|claim| format!("{} ({:.2})", claim.effect, claim.probability))
                .collect();
            vec![
                case.kind.name().to_owned(),
                case.seed.to_string(),
                case.hidden.join(", "),
                if case.strength.is_finite() {
                    format!("{:.1} %", 100.0 * case.strength)
                } else {
                    "-".to_owned()
                },
                case.verdict.clone(),
                claims.join(", "),
            ]
        })
        .collect();
    page.section("Cases", table(&["kind", "seed", "hidden", "size", "verdict", "named"], &cases));
    page.into_html()
}

fn wrong(hidden: &str, named: &str) -> bool {
    named != hidden && (hidden, named) != ("nothing", "no_mismatch")
}
