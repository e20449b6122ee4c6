//! What adopting a diagnosis did to thrust, and how it is shown.

use std::collections::BTreeMap;
use std::fmt::Write;

use kort_soak::Drawn;
use kort_thruster::effects::Scale;
use kort_thruster::rig::KnownEffect;
use maud::{Markup, html};
use serde::Serialize;

use super::adopt::WORSE;
use crate::render::{number, table};

/// An effect with its values.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// Its identifier.
    pub effect: &'static str,
    /// Its values by name.
    pub parameters: BTreeMap<&'static str, f64>,
    /// What it changes of what is measured, as a share; of a hidden one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    /// How probable the diagnosis holds it; of an adopted one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
}

impl Found {
    /// A hidden one.
    pub fn of_drawn(drawn: &Drawn) -> Self {
        let (descriptor, values) = &drawn.hooked;
        let names = (descriptor.parameters)(&Scale::ANY);
        let parameters = names.iter().zip(values).map(|(s, v)| (s.name, *v)).collect();
        Self { effect: descriptor.id, parameters, size: Some(drawn.size), probability: None }
    }

    /// An adopted one.
    pub fn of_known(known: &KnownEffect, probability: f64) -> Self {
        let parameters = known.parameters.iter().map(|(name, q)| (*name, q.value)).collect();
        Self { effect: known.effect, parameters, size: None, probability: Some(probability) }
    }
}

/// One law with one seed.
#[derive(Clone, Debug, Serialize)]
pub struct Adoption {
    /// Scenario.
    pub scenario: String,
    /// Rig.
    pub rig: String,
    /// Seed.
    pub seed: u64,
    /// Controller.
    pub law: String,
    /// What was hidden.
    pub hidden: Vec<Found>,
    /// What was believed and adopted.
    pub adopted: Vec<Found>,
    /// Thrust RMS error with the stated rig, N.
    pub before: f64,
    /// The same with the adopted rig, N.
    pub after: f64,
    /// The same with a rig that states what is hidden, N.
    pub truth_told: f64,
    /// The same with the stated rig and on-line adaptation alone, N; none for a law that does not adapt.
    pub adaptive: Option<f64>,
    /// After over before.
    pub ratio: f64,
    /// Why the adoption failed: thrust became worse by more than a twentieth.
    #[serde(rename = "failure")]
    pub cause: Option<String>,
}

/// A law's figures over seeds and rigs.
struct Summary {
    law: String,
    cases: usize,
    ratio: f64,
    worst: f64,
    told: f64,
    over_told: f64,
    adaptive: Option<f64>,
    failed: usize,
}

fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

fn summaries(all: &[Adoption]) -> Vec<Summary> {
    let mut laws: Vec<&str> = Vec::new();
    for a in all {
        if !laws.contains(&a.law.as_str()) {
            laws.push(&a.law);
        }
    }
    let of = |law: &str| -> Summary {
        let own: Vec<&Adoption> = all.iter().filter(|a| a.law == law).collect();
        let each = |figure: fn(&Adoption) -> f64| own.iter().map(|a| figure(a)).collect::<Vec<f64>>();
        let adapting: Vec<f64> = own.iter().filter_map(|a| Some(a.adaptive? / a.before)).collect();
        Summary {
            law: law.into(),
            cases: own.len(),
            ratio: median(each(|a| a.ratio)),
            worst: each(|a| a.ratio).into_iter().fold(0.0, f64::max),
            told: median(each(|a| a.truth_told / a.before)),
            over_told: median(each(|a| a.after / a.truth_told)),
            adaptive: (!adapting.is_empty()).then(|| median(adapting)),
            failed: own.iter().filter(|a| a.cause.is_some()).count(),
        }
    };
    laws.into_iter().map(of).collect()
}

/// By hidden effect: cases it was in, how often it was adopted, and the median ratio of those cases.
fn by_effect(all: &[Adoption]) -> Vec<(&'static str, usize, usize, f64)> {
    let mut effects: Vec<&'static str> = all.iter().flat_map(|a| a.hidden.iter().map(|h| h.effect)).collect();
    effects.sort_unstable();
    effects.dedup();
    effects
        .into_iter()
        .map(|effect| {
            let with: Vec<&Adoption> =
                all.iter().filter(|a| a.hidden.iter().any(|h| h.effect == effect)).collect();
            let found = with.iter().filter(|a| a.adopted.iter().any(|f| f.effect == effect)).count();
            (effect, with.len(), found, median(with.iter().map(|a| a.ratio).collect()))
        })
        .collect()
}

fn names(effects: &[Found]) -> String {
    let names: Vec<&str> = effects.iter().map(|f| f.effect).collect();
    if names.is_empty() { "nothing".into() } else { names.join(", ") }
}

/// For a terminal.
pub fn text(all: &[Adoption]) -> String {
    let mut out = String::from(
        "adoption: thrust RMS [N] with the stated rig, with the adopted one, told the truth, adapting alone\n",
    );
    for a in all {
        let adaptive = a.adaptive.map_or_else(|| "-".into(), |x| format!("{x:.3}"));
        let _ = writeln!(
            out,
            "  {} seed {} {:24} {:9.3} {:9.3} {:9.3} {:>9}  ratio {:.3}",
            a.rig, a.seed, a.law, a.before, a.after, a.truth_told, adaptive, a.ratio
        );
        let _ = writeln!(out, "    hidden: {}; adopted: {}", names(&a.hidden), names(&a.adopted));
        if let Some(cause) = &a.cause {
            let _ = writeln!(out, "    FAILED, thrust is worse by more than {WORSE}: {cause}");
        }
    }
    for s in summaries(all) {
        let adaptive = s.adaptive.map_or_else(|| "-".into(), |x| format!("{x:.3}"));
        let _ = writeln!(
            out,
            "  {}: median ratio {:.3} (worst {:.3}) over {} cases; told the truth {:.3}; adopted over told {:.3}; adapting alone {adaptive}; {} failed",
            s.law, s.ratio, s.worst, s.cases, s.told, s.over_told, s.failed
        );
    }
    out
}

/// For a page of docs.
pub fn markdown(all: &[Adoption], seed: u64) -> String {
    let mut rigs: Vec<&str> = all.iter().map(|a| a.rig.as_str()).collect();
    rigs.sort_unstable();
    rigs.dedup();
    let mut out = format!(
        "\nkort {}; seeds from {seed}; rigs {}. Thrust RMS over that with the stated rig, medians over cases.\n\n\
         | law | cases | adopted (worst) | told the truth | adopted over told | adapting alone | failed |\n| --- | --- | --- | --- | --- | --- | --- |\n",
        env!("CARGO_PKG_VERSION"),
        rigs.join(", ")
    );
    for s in summaries(all) {
        let adaptive = s.adaptive.map_or_else(|| "-".into(), |x| format!("{x:.2}"));
        let _ = writeln!(
            out,
            "| `{}` | {} | {:.2} ({:.2}) | {:.2} | {:.2} | {adaptive} | {} |",
            s.law, s.cases, s.ratio, s.worst, s.told, s.over_told, s.failed
        );
    }
    out += "\n| hidden | cases | adopted | median ratio |\n| --- | --- | --- | --- |\n";
    for (effect, cases, found, ratio) in by_effect(all) {
        let _ = writeln!(out, "| `{effect}` | {cases} | {found} | {ratio:.2} |");
    }
    out + "\n"
}

/// For the page.
pub fn section(all: &[Adoption]) -> Markup {
    let laws: Vec<Vec<String>> = summaries(all)
        .into_iter()
        .map(|s| {
            let adaptive = s.adaptive.map_or_else(|| "-".into(), number);
            let figures = [number(s.ratio), number(s.worst), number(s.told), number(s.over_told), adaptive];
            std::iter::once(s.law).chain(figures).chain([s.failed.to_string()]).collect()
        })
        .collect();
    let effects: Vec<Vec<String>> = by_effect(all)
        .into_iter()
        .map(|(effect, cases, found, ratio)| {
            vec![effect.to_owned(), cases.to_string(), found.to_string(), number(ratio)]
        })
        .collect();
    let cases: Vec<Vec<String>> = all
        .iter()
        .map(|a| {
            vec![
                format!("{} {}", a.rig, a.seed),
                a.law.clone(),
                names(&a.hidden),
                names(&a.adopted),
                number(a.before),
                number(a.after),
                number(a.truth_told),
                number(a.ratio),
                a.cause.clone().unwrap_or_default(),
            ]
        })
        .collect();
    html! {
        p { "Unknown effects were hidden in the plant, the first run was diagnosed, and what was believed was adopted." }
        (table(&["law", "median after/before", "worst", "told the truth", "adopted over told", "adapting alone", "failed"], &laws))
        (table(&["hidden", "cases", "adopted", "median ratio"], &effects))
        (table(&["case", "law", "hidden", "adopted", "before [N]", "after [N]", "told the truth [N]", "ratio", "why it failed"], &cases))
    }
}
