//! What the report says in words, and the odds it gives.

use kort_thruster::effects::{Descriptor, Path};

use crate::changes;
use crate::data::Series;
use crate::fit::{Fit, Problem, Target};
use crate::judge::{Outcome, Place, margin, near};
use crate::library::is_term;
use crate::locate;
use crate::report::{
    Alternative, Baseline, EmpiricalTerm, Finding, HeldOut, Mismatch, NextExperiment, Verdict,
};
use crate::rules;

/// How sure a lone name is when nothing comes near it; measured on three proofs, none of them the reported
/// one.
const SURE: f64 = 0.975;

/// Probabilities of the chosen effect and its rivals. A distance in the criterion counts less
/// than its size in log-likelihood says, because the true form differs a little from ours.
pub fn odds(place: &Place) -> Vec<f64> {
    let weight = |other: &Descriptor, distance: f64| {
        (-distance.max(0.0) / (rules::ODDS_FALL * near(place, other))).exp()
    };
    let mut weights = vec![1.0];
    weights.extend(place.rivals.iter().map(|r| weight(r.0.0, r.1)));
    let aside: f64 = place.aside.iter().filter(|a| !is_term(a.0)).map(|a| weight(a.0, a.1)).sum();
    let total: f64 = weights.iter().sum::<f64>() + aside;
    weights.into_iter().map(|w| SURE * w / total).collect()
}

/// Probability of an effect set aside.
pub fn small_odds(distance: f64, gain: f64) -> f64 {
    (0.5 * (-distance / (0.5 * margin(gain))).exp()).min(0.2)
}

/// Standard deviations from what is stated beyond which a coefficient is spoken of.
const STRAINED: f64 = 2.6;

/// One sentence on an effect.
pub fn statement(effect: &Descriptor) -> String {
    format!("The model leaves out {}: {}.", effect.id.replace('_', " "), effect.what)
}

/// Why an effect stands.
pub fn evidence(place: &Place, heldout: &HeldOut, located: &locate::Place) -> Vec<String> {
    let mut out = vec![
        format!(
            "with it, {:.0} % of the error above the noise goes on data it was not fitted to (95 % interval {:.0} to {:.0} %)",
            100.0 * heldout.excess_error_removed,
            100.0 * heldout.interval_95[0],
            100.0 * heldout.interval_95[1]
        ),
        format!("the error it removes shows most in {}, {}", located.channel, located.regime),
        format!("expected signature: {}", place.chosen.signature),
    ];
    if let Some((next, distance)) = place
        .rivals
        .iter()
        .map(|r| (r.0.0, r.1))
        .chain(place.aside.iter().copied())
        .min_by(|a, b| a.1.total_cmp(&b.1))
    {
        out.push(format!(
            "the nearest other explanation, {}, is worse by {distance:.0} of {:.0} in twice the log-likelihood",
            next.id, place.gain
        ));
    }
    out
}

/// Why one of two relatives that fit best together is in doubt.
pub fn kin(one: &Descriptor, other: &Descriptor) -> String {
    format!(
        "fits best together with {}, which also takes thrust away at the blade: one of the two alone, with an onset of another form than kort's, would look like both, so {} is in doubt",
        other.id, one.id
    )
}

/// Why an effect was set aside.
pub fn why_not(leader: &str, distance: f64, gain: f64) -> String {
    let share = 100.0 * (1.0 - distance / gain.max(1e-9));
    if share > 0.0 {
        format!("explains {share:.0} % of what {leader} explains; the rest stays in the residual")
    } else {
        format!("explains nothing of what {leader} explains")
    }
}

/// Coefficients that the baseline's fit needs far from what the rig states: a symptom even where the fit
/// is good.
pub fn strained(baseline: &Fit) -> Option<String> {
    let far: Vec<String> = baseline
        .hypothesis
        .free
        .iter()
        .zip(&baseline.values)
        .filter_map(|(free, value)| {
            let (stated, sigma) = free.prior.filter(|_| matches!(free.target, Target::Base(_)))?;
            let strain = (value - stated) / sigma;
            (strain.abs() > STRAINED).then(|| {
                format!(
                    "{} {:+.0} % (stated to {:.0} %)",
                    free.name,
                    100.0 * (value / stated - 1.0),
                    200.0 * (sigma / stated).abs()
                )
            })
        })
        .collect();
    (!far.is_empty()).then(|| {
        format!(
            "the baseline fits only with coefficients far from what the rig states: {}. Check what is stated: they may hide physics that the model leaves out",
            far.join(", ")
        )
    })
}

/// A name that was fitted and removes next to nothing of the error on held-out data.
pub fn weak(effect: &str, heldout: &HeldOut) -> Alternative {
    Alternative {
        effect: effect.into(),
        probability: 0.05,
        why_not: format!(
            "fits better within the noise's colour, but removes only {:.0} % of the error above the noise on held-out data",
            100.0 * heldout.excess_error_removed.max(0.0)
        ),
    }
}

/// What a term adds to, and its variables.
pub fn enters(term: &Descriptor) -> (&'static str, &'static [&'static str]) {
    match term.id {
        id if id.starts_with("term_shaft_changes") => {
            ("load torque on the shaft [N m], against the rotation", &["time_s"])
        }
        id if id.starts_with("term_drive_changes") => ("drive command", &["command", "time_s"]),
        id if id.starts_with("term_flow_changes") => ("ambient flow [m/s]", &["time_s"]),
        id if id.starts_with("term_sensor_changes") => ("thrust reading [N]", &["time_s"]),
        "term_column_shaft" => ("shaft torque [N m]", &["column", "shaft_speed_rad_s"]),
        "term_column_drive" => ("drive command", &["column", "command"]),
        "term_column_ambient" => ("ambient flow [m/s]", &["column"]),
        "term_column_thrust" => ("thrust reading [N]", &["column"]),
        "term_shaft_flow" => ("shaft torque [N m]", &["shaft_speed_rad_s", "flow_m_s"]),
        "term_shaft_switched" => ("shaft torque [N m]", &["shaft_speed_rad_s", "time_s"]),
        id if id.starts_with("term_shaft") => ("shaft torque [N m]", &["shaft_speed_rad_s"]),
        "term_drive_switched" => ("drive command", &["command", "time_s"]),
        id if id.starts_with("term_drive") => ("drive command", &["command"]),
        "term_blade_torque_odd" => ("blade torque [N m]", &["shaft_speed_rad_s"]),
        "term_blade_thrust_flow" | "term_blade_thrust_step" => {
            ("thrust [N]", &["shaft_speed_rad_s", "flow_m_s"])
        }
        id if id.starts_with("term_blade") => ("thrust [N]", &["shaft_speed_rad_s"]),
        "term_flow_switched" => ("ambient flow [m/s]", &["time_s"]),
        id if id.starts_with("term_flow") => ("force on the axial flow [N]", &["flow_m_s"]),
        "term_sensor_thrust_switched" => ("thrust reading [N]", &["time_s"]),
        _ => ("thrust reading [N]", &["thrust_n"]),
    }
}

/// The term's formula with numbers.
pub fn expression(term: &Descriptor, values: &[f64], driver: Option<&str>) -> String {
    if changes::is_change(term) {
        return changed(term, values);
    }
    let mut text = term.equation.to_string();
    let (size, reference, shape) = (
        values.first().copied().unwrap_or(0.0),
        values.get(1).copied().unwrap_or(1.0),
        values.get(2).copied().unwrap_or(0.0),
    );
    if term.id.ends_with("_switched") {
        text = text.replace("from a time on", &format!("from t = {shape:.2} s on"));
    }
    for symbol in ["p Om0", "p v0"] {
        text = text.replace(symbol, &format!("{:.4}", shape * reference));
    }
    for (symbol, value) in [("Om0", reference), ("u0", reference), ("v0", reference), ("T0", reference)] {
        text = text.replace(symbol, &format!("{value:.4}"));
    }
    text = text.replace("^p", &format!("^{shape:.2}"));
    if let Some(name) = driver.filter(|_| term.id.starts_with("term_column")) {
        text = text.replace(" x", &format!(" (standardised {name})"));
    }
    // The size last: "k" stands alone in every equation.
    let number = format!("{size:.5}");
    text.replace("-k ", &format!("-{number} ")).replace("+ k", &format!("+ {number}")).replace("--", "+")
}

/// The formula of changes in mid-run: every step with its instant.
fn changed(term: &Descriptor, values: &[f64]) -> String {
    let (head, unit) = match term.path {
        Path::Shaft => ("as before", " N m"),
        Path::Drive => ("command x (1", ""),
        Path::Flow => ("as before", " m/s"),
        _ => ("as before", " N"),
    };
    let mut text = head.to_string();
    for (size, at) in changes::steps(values) {
        let plus = if size < 0.0 { "-" } else { "+" };
        text.push_str(&format!(" {plus} {:.4}{unit} from t = {at:.2} s on,", size.abs()));
    }
    text.pop();
    if term.path == Path::Drive {
        text.push(')');
    }
    text
}

/// When changes come.
pub fn changes(values: &[f64]) -> String {
    let list: Vec<String> = changes::steps(values).iter().map(|s| format!("{:.2} s", s.1)).collect();
    format!("changes in mid-run, at {}", list.join(", "))
}

/// Another path on which the same changes might act.
pub fn elsewhere(other: &Descriptor, distance: f64, gain: f64) -> String {
    let what = match other.path {
        Path::Shaft => "a load on the shaft",
        Path::Drive => "a change of the drive's gain",
        Path::Flow => "a change of the inflow",
        _ => "a step of the thrust reading",
    };
    let how = if distance > 0.0 {
        format!("fits worse by {distance:.0}")
    } else {
        format!("fits better by {:.0}, by how fast it acts", -distance)
    };
    format!(
        "the same changes as {what} would be of another path: it {how} (of {gain:.0} in twice the log-likelihood); where the difference is small, only a recorded current or torque parts them"
    )
}

/// Columns that were not used.
pub fn unused(series: &[Series], problem: &Problem, driver: Option<&str>) -> Vec<String> {
    let mut used: Vec<&str> =
        vec!["time_s", "ambient_m_s", "shaft_angle_rad", "supply_v", "depth_m", "temperature_c"];
    for recording in &problem.recordings {
        used.push(recording.driving.column());
        used.extend(recording.channels.iter().map(|c| c.response.name()));
    }
    let mut left: Vec<&str> = series
        .iter()
        .flat_map(|s| s.columns.iter().map(|c| c.0.as_str()))
        .filter(|name| !used.contains(name))
        .collect();
    left.sort_unstable();
    left.dedup();
    let mut notes = Vec::new();
    if let Some(name) = driver {
        notes.push(format!("what the baseline leaves follows the column {name}; it was tried as a driver"));
        left.retain(|c| *c != name);
    }
    if !left.is_empty() {
        notes.push(format!(
            "columns not used: {} (tried as drivers of the residual where they vary)",
            left.join(", ")
        ));
    }
    notes
}

/// One paragraph to act on.
#[expect(clippy::too_many_arguments, reason = "a summary of everything")]
pub fn summary(
    verdict: Verdict,
    findings: &[Finding],
    mismatch: &[Mismatch],
    term: Option<&EmpiricalTerm>,
    next: Option<&NextExperiment>,
    baseline: &Baseline,
    outcome: &Outcome,
    thin: Option<&str>,
) -> String {
    let model = &baseline.model;
    let list = |f: &[&Finding]| f.iter().map(|f| f.effect.replace('_', " ")).collect::<Vec<_>>().join(" or ");
    let gain = |h: &HeldOut| format!("{:.0} %", 100.0 * h.excess_error_removed);
    let strayed: Vec<String> = outcome
        .baseline
        .hypothesis
        .free
        .iter()
        .zip(&outcome.baseline.values)
        .filter_map(|(f, v)| {
            let (mean, sigma) = f.prior?;
            ((v - mean).abs() > 3.0 * sigma).then(|| format!("{} ({v:.4} against {mean:.4} stated)", f.name))
        })
        .collect();
    let mut text = match verdict {
        Verdict::NoMismatch => {
            let mut text = format!(
                "{model}, re-fitted within the stated tolerances, explains the recording down to its noise: nothing is missing that this excitation can show."
            );
            if !strayed.is_empty() {
                text.push_str(&format!(" Check the stated values of {}.", strayed.join(", ")));
            }
            text
        }
        Verdict::Explained => {
            let named: Vec<String> = findings
                .iter()
                .map(|f| {
                    format!("{} ({}, probability {:.2})", f.effect.replace('_', " "), f.path, f.probability)
                })
                .collect();
            format!(
                "{model} leaves out {}. Adding it removes {} of the error above the noise on data it was not fitted to. It shows most in {}, {}.",
                named.join(" and "),
                findings.first().map_or_else(String::new, |f| gain(&f.heldout)),
                mismatch.first().map_or("", |m| &m.channel),
                mismatch.first().map_or("", |m| &m.regime),
            )
        }
        Verdict::Ambiguous => {
            let groups: Vec<&Finding> = findings.iter().filter(|f| !f.confounded_with.is_empty()).collect();
            format!(
                "{model} leaves something out on the {} path, and this excitation cannot tell which of these it is: {}.",
                mismatch.first().map_or("", |m| &m.path),
                list(&groups),
            )
        }
        Verdict::Unexplained => {
            let mut text = format!(
                "The mismatch is real ({} path, most in {}, {}), and no effect in the catalogue explains it.",
                mismatch.first().map_or("?", |m| &m.path),
                mismatch.first().map_or("?", |m| &m.channel),
                mismatch.first().map_or("?", |m| &m.regime),
            );
            if let Some(term) = term {
                let holds = if term.heldout.excess_error_removed > 0.05 {
                    format!(
                        "it removes {} of the error above the noise on held-out data",
                        gain(&term.heldout)
                    )
                } else {
                    "it does not hold on the held-out part of this recording: take it as a hint only".into()
                };
                text.push_str(&format!(
                    " An empirical term describes it: {} = {}; {holds}.",
                    term.enters, term.expression
                ));
            }
            text
        }
        Verdict::InsufficientData => {
            format!("The recording cannot tell: {}.", thin.unwrap_or("too little changes in it"))
        }
    };
    if let Some(next) = next {
        text.push_str(&format!(" Run next: {}.", next.excitation));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Free, Hypothesis};
    use kort_thruster::effects;
    use kort_thruster::parameters::Parameter;

    #[test]
    fn rivals_that_are_as_near_share_the_odds_and_far_ones_get_none() {
        let effect = |id| effects::find(id).unwrap();
        let place = |distance: f64| Place {
            chosen: effect("coulomb_friction"),
            rivals: vec![((effect("torque_channel_bias"), Vec::new()), distance)],
            aside: Vec::new(),
            gain: 1000.0,
        };
        let even = odds(&place(0.0));
        assert_eq!(even[0], even[1]);
        assert!((even.iter().sum::<f64>() - SURE).abs() < 1e-12);
        let far = odds(&place(near(&place(0.0), effect("torque_channel_bias"))));
        assert!(far[0] > 0.9 && far[1] < 0.03, "{far:?}");
    }

    #[test]
    fn a_threshold_is_told_as_a_speed() {
        let told = |id| {
            let term = crate::library::TERMS.iter().find(|t| t.id == id).unwrap();
            expression(term, &[2.0, 1.5, 0.4], None)
        };
        assert_eq!(told("term_blade_thrust_step"), "thrust + 2.00000 sgn(Om) where |vp| > 0.6000");
        assert_eq!(told("term_shaft_step"), "shaft torque -2.00000 sgn(Om) where |Om| > 0.6000");
    }

    #[test]
    fn a_coefficient_far_from_what_is_stated_is_spoken_of() {
        let fit = |inertia: f64| Fit {
            hypothesis: Hypothesis {
                effects: Vec::new(),
                free: vec![Free {
                    target: Target::Base(Parameter::InertiaKgM2),
                    name: "inertia_kg_m2",
                    unit: "kg m^2",
                    prior: Some((0.010, 0.0005)),
                    low: 0.0,
                    high: 1.0,
                    size: 0.010,
                    acts: None,
                }],
                start: vec![inertia],
                fixed: Vec::new(),
            },
            values: vec![inertia],
            chi2: 0.0,
            penalty: 0.0,
            residual: nalgebra::DVector::zeros(0),
            columns: vec![None],
            at_bound: vec![false],
        };
        assert_eq!(strained(&fit(0.011)), None);
        let said = strained(&fit(0.0115)).unwrap();
        assert!(said.contains("inertia_kg_m2 +15 % (stated to 10 %)"), "{said}");
    }
}
