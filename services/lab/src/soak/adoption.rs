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

/// An effect that was named and not adopted.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    /// Its identifier.
    pub effect: String,
    /// Why.
    pub why: String,
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
    /// What was named and not adopted.
    pub left_out: Vec<LeftOut>,
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

/// An effect under a law: medians over the cases that hid it.
struct Hidden {
    effect: &'static str,
    law: String,
    cases: usize,
    /// How often it was adopted.
    found: usize,
    /// Thrust RMS error, N: with the stated rig, with the adopted one, told the truth.
    rms_n: [f64; 3],
    /// The latter two over the first, case by case.
    over_before: [f64; 2],
}

/// What is said of a hidden effect, over its columns.
const HIDDEN: [&str; 9] = [
    "hidden",
    "law",
    "cases",
    "adopted",
    "before [N]",
    "after [N]",
    "told the truth [N]",
    "after/before",
    "told/before",
];

impl Hidden {
    fn row(&self, number: fn(f64) -> String) -> [String; 9] {
        let ([before, after, told], [ratio, told_ratio]) = (self.rms_n, self.over_before);
        let (cases, found) = (self.cases.to_string(), self.found.to_string());
        let [before, after, told] = [before, after, told].map(number);
        let [ratio, told_ratio] = [ratio, told_ratio].map(|x| format!("{x:.2}"));
        [self.effect.into(), self.law.clone(), cases, found, before, after, told, ratio, told_ratio]
    }
}

/// By hidden effect and law.
fn by_effect(all: &[Adoption]) -> Vec<Hidden> {
    let mut of: BTreeMap<(&'static str, &str), Vec<&Adoption>> = BTreeMap::new();
    for a in all {
        for hidden in &a.hidden {
            of.entry((hidden.effect, &a.law)).or_default().push(a);
        }
    }
    let hidden = |((effect, law), with): ((&'static str, &str), Vec<&Adoption>)| {
        let each = |figure: fn(&Adoption) -> f64| median(with.iter().map(|a| figure(a)).collect());
        Hidden {
            effect,
            law: law.into(),
            cases: with.len(),
            found: with.iter().filter(|a| a.adopted.iter().any(|f| f.effect == effect)).count(),
            rms_n: [each(|a| a.before), each(|a| a.after), each(|a| a.truth_told)],
            over_before: [each(|a| a.ratio), each(|a| a.truth_told / a.before)],
        }
    };
    of.into_iter().map(hidden).collect()
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
        for LeftOut { effect, why } in &a.left_out {
            let _ = writeln!(out, "    {effect} is left out: {why}");
        }
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
    for h in by_effect(all) {
        let ([before, after, told], [ratio, told_ratio]) = (h.rms_n, h.over_before);
        let _ = writeln!(
            out,
            "  {:28} {:24} {before:9.3} {after:9.3} {told:9.3}  ratio {ratio:.3}, told the truth {told_ratio:.3}; adopted in {} of {} cases",
            h.effect, h.law, h.found, h.cases
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
    let _ = write!(out, "\n| {} |\n|{}\n", HIDDEN.join(" | "), " --- |".repeat(HIDDEN.len()));
    for hidden in by_effect(all) {
        let _ = writeln!(out, "| {} |", hidden.row(number).join(" | "));
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
    let effects: Vec<Vec<String>> = by_effect(all).iter().map(|h| h.row(number).to_vec()).collect();
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
        (table(&HIDDEN, &effects))
        (table(&["case", "law", "hidden", "adopted", "before [N]", "after [N]", "told the truth [N]", "ratio", "why it failed"], &cases))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_told_under_each_law_beside_the_truth() {
        let found = |effect| Found { effect, parameters: BTreeMap::new(), size: None, probability: None };
        let case = |law: &str, seed, before, after, truth_told| Adoption {
            scenario: "s".into(),
            rig: "r".into(),
            seed,
            law: law.into(),
            hidden: vec![found("supply_sag")],
            adopted: if seed == 1 { vec![found("supply_sag")] } else { Vec::new() },
            left_out: Vec::new(),
            before,
            after,
            truth_told,
            adaptive: None,
            ratio: after / before,
            cause: None,
        };
        let all = [
            case("torque_control", 1, 10.0, 4.0, 2.0),
            case("torque_control", 2, 10.0, 10.0, 4.0),
            case("velocity_servo", 1, 5.0, 5.0, 6.0),
        ];
        let page = markdown(&all, 1);
        let row = |law: &str, rms_n: [f64; 3], over: &str| {
            format!("| supply_sag | {law} | 1 | {} | {over} |", rms_n.map(number).join(" | "))
        };
        assert!(page.contains(&row("torque_control | 2", [10.0, 7.0, 3.0], "0.70 | 0.30")), "{page}");
        assert!(page.contains(&row("velocity_servo | 1", [5.0, 5.0, 6.0], "1.00 | 1.20")), "{page}");
    }
}
