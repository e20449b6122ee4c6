//! The run that would settle what this one cannot: of the shipped test signals, the one on which
//! the rivals' fitted models differ most.

use std::collections::BTreeMap;

use kort_identify::fit::Fit;
use kort_scenario::{EffectUse, NoReplays, Run, Scenario};
use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::parameters::Parameter;
use kort_thruster::rig::{Load, Rig};

use crate::decide::Decision;
use crate::flexible::{SHAFT_OVER_ANGLE, is_term};
use crate::load_steps::LOAD_STEPS;
use crate::report::NextExperiment;
use crate::search::{Search, Set};

/// Test signals to choose from: shipped scenario, what it does in an engineer's words.
const SIGNALS: &[(&str, &str)] = &[
    (
        include_str!("../../../config/scenarios/slow-reversal-ramp.toml"),
        "a slow ramp through zero in both directions",
    ),
    (
        include_str!("../../../config/scenarios/staircase.toml"),
        "a staircase of steady levels, up and down, both ways",
    ),
    (include_str!("../../../config/scenarios/chirp.toml"), "a chirp of 0.05 to 5 Hz about a mean"),
    (
        include_str!("../../../config/scenarios/identification-random-levels.toml"),
        "random steps both ways, logged with the fastest rate there is",
    ),
    (include_str!("../../../config/scenarios/tow.toml"), "steps while towed ahead and astern"),
];

/// The next experiment, if anything is left open.
pub fn next(search: &Search, decision: &Decision, best: &Set, rig: &Rig) -> Option<NextExperiment> {
    let Some(place) = decision.named.iter().find(|n| !n.rivals.is_empty() && best.contains(&n.effect)) else {
        return unexplained(search, decision, rig);
    };
    let rival = *place.rivals.first()?;
    let mut other: Set = best.iter().copied().filter(|id| *id != place.effect).collect();
    other.push(rival);
    other.sort_unstable();
    let (mine, theirs) = (search.fits.get(best)?, search.fits.get(&other)?);
    let (chosen, rival) = (search.descriptor(place.effect)?, search.descriptor(rival)?);
    let best_signal = SIGNALS
        .iter()
        .filter_map(|(text, words)| {
            let scenario: Scenario = toml::from_str(text).ok()?;
            let a = respond(&scenario, rig, search, mine)?;
            let b = respond(&scenario, rig, search, theirs)?;
            Some((difference(&a, &b, &search.problem.scale), scenario, *words))
        })
        .max_by(|x, y| x.0.total_cmp(&y.0))?;
    let mut scenario = with_effects(best_signal.1, search, mine);
    scenario.what = format!("Parts {} from {}: {}", chosen.id, rival.id, best_signal.2);
    scenario.name = format!("separate-{}-{}", chosen.id, rival.id).replace('_', "-");
    let separates = std::iter::once(place.effect).chain(place.rivals.iter().copied());
    Some(NextExperiment {
        separates: separates.map(str::to_string).collect(),
        excitation: best_signal.2.into(),
        why: why(search, chosen, rival, best_signal.0),
        scenario: serde_json::to_value(&scenario).ok()?,
    })
}

fn why(search: &Search, chosen: &Descriptor, rival: &Descriptor, difference: f64) -> String {
    let percent = 100.0 * difference;
    let (sizes, advice) = match (
        free_in_time(chosen, &search.problem.scale),
        free_in_time(rival, &search.problem.scale),
    ) {
        (false, false) => (
            format!(
                "fitted to this recording, {} and {} would then differ by {percent:.1} % of full scale on the channel where they differ most",
                chosen.id, rival.id
            ),
            chosen.separated_by,
        ),
        (true, true) => (
            format!("{} and {} change freely with time and come again another way", chosen.id, rival.id),
            chosen.separated_by,
        ),
        (chosen_is_free, _) => {
            let (formed, free) = if chosen_is_free { (rival, chosen) } else { (chosen, rival) };
            let text = format!(
                "{} would come back as fitted to this recording and differ from its absence by up to {percent:.1} % of full scale, {} changes freely with time and would come back another way",
                formed.id, free.id
            );
            (text, formed.separated_by)
        }
    };
    if difference < 0.003 {
        format!("{sizes}: none of the shipped test signals parts them well; what does is {advice}")
    } else {
        format!("{sizes}; the catalogue's advice: {advice}")
    }
}

/// A real mismatch without a name: the richest signal there is, both ways.
fn unexplained(search: &Search, decision: &Decision, rig: &Rig) -> Option<NextExperiment> {
    let term = search.descriptor(decision.term?)?;
    let (text, words) = SIGNALS[1];
    let (excitation, why) = of_unknown(term, rig, words);
    let mut scenario: Scenario = toml::from_str(text).ok()?;
    scenario.name = "locate-the-unknown".into();
    Some(NextExperiment {
        separates: vec!["unknown".into()],
        excitation,
        why,
        scenario: serde_json::to_value(&scenario).ok()?,
    })
}

/// What to run for a term without a name, of which a signal both ways tells most, and why.
fn of_unknown(term: &Descriptor, rig: &Rig, both_ways: &str) -> (String, String) {
    let why = format!(
        "steady levels both ways show on the {} path how the unknown goes with speed and direction; then repeat this run to see whether it stays",
        term.path.name()
    );
    if term.id == LOAD_STEPS.id {
        let why = "with the change in force and without it, current recorded: a load takes the same torque at every level, a drive that loses gain a share of it";
        return (both_ways.into(), why.into());
    }
    if term.id == SHAFT_OVER_ANGLE.id && rig.load == Load::None {
        let again =
            "this recording again, with what hangs on the shaft (a weight, a spring) stated in the rig";
        let weight = "torque that goes with the shaft's angle is what a weight on an arm, a wheel out of balance, a spring or a cable does, and it hides all else; \
                      a weight is stated as [load] kind = \"pendulum\", mass_kg, length_m";
        return (
            format!("{again}; where nothing does, {both_ways}"),
            format!("{weight}. Where nothing hangs there, {why}"),
        );
    }
    (both_ways.into(), why)
}

/// Whether an effect changes freely with time, and so comes again another way.
fn free_in_time(effect: &Descriptor, scale: &Scale) -> bool {
    (effect.parameters)(scale).iter().any(|s| s.acts.is_some())
}

fn respond(scenario: &Scenario, rig: &Rig, search: &Search, fit: &Fit) -> Option<Vec<Vec<f64>>> {
    let (parameters, _) = fit.hypothesis.assemble(&search.problem.stated, &fit.values);
    let mut run = with_effects(scenario.clone(), search, fit);
    run.noise = 0.0;
    run.turbulence = None;
    run.model = search.problem.model;
    run.parameters = Parameter::ALL.iter().map(|p| (*p, parameters.get(*p))).collect();
    let mut run = Run::new(&run, rig, &mut NoReplays).ok()?;
    let names = ["shaft_speed_rad_s", "thrust_n", "flow_m_s", "torque_n_m", "current_a"];
    let at: Vec<Option<usize>> = names.iter().map(|n| run.columns().iter().position(|c| c == n)).collect();
    let mut out: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
    let mut row = Vec::new();
    while run.next_row(&mut row).is_some() {
        for (column, at) in out.iter_mut().zip(&at) {
            if let Some(v) = at.and_then(|i| row.get(i)).filter(|v| v.is_finite()) {
                column.push(*v);
            }
        }
    }
    Some(out)
}

/// Root mean square difference over full scale, largest channel.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>], scale: &Scale) -> f64 {
    let full = [scale.shaft_speed_rad_s, scale.thrust_n, scale.flow_m_s, scale.torque_n_m, scale.current_a];
    a.iter()
        .zip(b)
        .zip(full)
        .filter(|((x, y), _)| !x.is_empty() && x.len() == y.len())
        .map(|((x, y), full)| {
            let sum: f64 = x.iter().zip(y).map(|(p, q)| (p - q).powi(2)).sum();
            (sum / x.len() as f64).sqrt() / full
        })
        .fold(0.0, f64::max)
}

/// A scenario with what was found in force. What changes freely with time stays out: it does not come again
/// as it came.
fn with_effects(mut scenario: Scenario, search: &Search, fit: &Fit) -> Scenario {
    let scale = &search.problem.scale;
    scenario.effects = search
        .problem
        .members(&fit.hypothesis, &fit.values)
        .iter()
        .filter(|m| !is_term(m.effect.id) && !free_in_time(m.effect, scale))
        .map(|m| EffectUse { effect: m.effect.id.into(), parameters: named(m.effect, &m.values, scale) })
        .collect();
    scenario
}

fn named(effect: &Descriptor, values: &[f64], scale: &Scale) -> BTreeMap<String, f64> {
    (effect.parameters)(scale).iter().map(|s| s.name.to_string()).zip(values.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flexible::TERMS;

    const SERVO: &str =
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.006\ntorque_constant_nm_a = 0.35\n";
    const WEIGHT: &str = "[load]\nkind = \"pendulum\"\nmass_kg = 0.5\nlength_m = 0.1\n";

    #[test]
    fn what_pulls_at_an_angle_is_asked_for_where_the_rig_states_no_load() {
        let [bare, loaded] =
            [SERVO.to_string(), format!("{SERVO}{WEIGHT}")].map(|text| Rig::from_toml(&text).unwrap());
        for term in TERMS {
            let (excitation, why) = of_unknown(term, &bare, "a staircase");
            let asked = term.id == SHAFT_OVER_ANGLE.id;
            assert_eq!(excitation.contains("hangs on the shaft"), asked, "{}: {excitation}", term.id);
            assert_eq!(why.contains("[load]"), asked, "{}: {why}", term.id);
            assert!(excitation.contains("a staircase"));
            assert_eq!(of_unknown(term, &loaded, "a staircase").0, "a staircase");
        }
    }
}
