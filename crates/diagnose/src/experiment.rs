//! The run that would settle what this one cannot: of the shipped test signals, the one on which
//! the rivals' fitted models differ most.

use std::collections::BTreeMap;

use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::parameters::Parameter;
use kort_thruster::rig::Rig;
use kort_thruster::scenario::{EffectUse, NoReplays, Run, Scenario};

use crate::baseline::{Member, members, recompose};
use crate::fit::Fit;
use crate::judge::{Outcome, Place};
use crate::library::is_term;
use crate::report::NextExperiment;
use crate::search::Search;
use crate::verdict::kin_of;

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

/// Two explanations that this recording leaves open.
struct Open<'a> {
    place: &'a Place,
    rival: &'static Descriptor,
    mine: Vec<Member>,
    theirs: Vec<Member>,
    all: Vec<&'static str>,
}

impl<'a> Open<'a> {
    fn of(search: &Search, outcome: &'a Outcome) -> Option<Self> {
        let all = members(&search.problem, &outcome.last);
        let without = |id: &str| -> Vec<Member> { all.iter().filter(|m| m.0.id != id).cloned().collect() };
        if let Some(place) = outcome.places.iter().find(|p| !p.rivals.is_empty()) {
            let (rival, _) = place.rivals.first()?;
            let mut theirs = all.clone();
            *theirs.iter_mut().find(|m| m.0.id == place.chosen.id)? = rival.clone();
            let names = std::iter::once(place.chosen.id).chain(place.rivals.iter().map(|r| r.0.0.id));
            return Some(Self { place, rival: rival.0, mine: all.clone(), theirs, all: names.collect() });
        }
        let (place, other) = kin_of(&outcome.places).next()?;
        let (mine, theirs) = (without(other.chosen.id), without(place.chosen.id));
        Some(Self { place, rival: other.chosen, mine, theirs, all: vec![place.chosen.id, other.chosen.id] })
    }
}

/// The next experiment, if anything is left open.
pub fn next(search: &Search, outcome: &Outcome, rig: &Rig) -> Option<NextExperiment> {
    let Some(open) = Open::of(search, outcome) else { return unexplained(outcome) };
    let fitted = |list: &[Member]| {
        let (hypothesis, columns) = recompose(&outcome.last, list, &search.scale);
        search.problem.fit(&hypothesis, &columns, 4)
    };
    let (mine, theirs) = (fitted(&open.mine), fitted(&open.theirs));
    let best = SIGNALS
        .iter()
        .filter_map(|(text, words)| {
            let scenario: Scenario = toml::from_str(text).ok()?;
            let a = respond(&scenario, rig, search, &mine)?;
            let b = respond(&scenario, rig, search, &theirs)?;
            Some((difference(&a, &b, &search.scale), scenario, *words))
        })
        .max_by(|x, y| x.0.total_cmp(&y.0))?;
    let (chosen, rival) = (open.place.chosen, open.rival);
    let mut scenario = with_effects(best.1, search, &mine);
    scenario.what = format!("Parts {} from {}: {}", chosen.id, rival.id, best.2);
    scenario.name = format!("separate-{}-{}", chosen.id, rival.id).replace('_', "-");
    Some(NextExperiment {
        separates: open.all.iter().map(|id| (*id).to_string()).collect(),
        excitation: best.2.into(),
        why: why(search, chosen, rival, best.0),
        scenario: serde_json::to_value(&scenario).ok()?,
    })
}

fn why(search: &Search, chosen: &Descriptor, rival: &Descriptor, difference: f64) -> String {
    let percent = 100.0 * difference;
    let (sizes, advice) = match (search.free_in_time(chosen), search.free_in_time(rival)) {
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
fn unexplained(outcome: &Outcome) -> Option<NextExperiment> {
    let term = outcome.places.iter().map(|p| p.chosen).find(|e| is_term(e));
    let why = match term {
        Some(term) if crate::changes::is_change(term) => {
            "with the change in force and without it, current recorded: a load takes the same torque at every level, a drive that loses gain a share of it".into()
        }
        Some(term) => format!(
            "steady levels both ways show on the {} path how the unknown term goes with speed and direction; then repeat this run to see whether it stays",
            term.path.name()
        ),
        None if outcome.excess.is_some() && outcome.places.is_empty() => {
            "steady levels both ways show whether what is left follows speed and direction at all; then repeat this run to see whether it stays".into()
        }
        None => return None,
    };
    let (text, words) = SIGNALS[1];
    let mut scenario: Scenario = toml::from_str(text).ok()?;
    scenario.name = "locate-the-unknown".into();
    Some(NextExperiment {
        separates: vec!["unknown".into()],
        excitation: words.into(),
        why,
        scenario: serde_json::to_value(&scenario).ok()?,
    })
}

fn respond(scenario: &Scenario, rig: &Rig, search: &Search, fit: &Fit) -> Option<Vec<Vec<f64>>> {
    let (parameters, _) = search.problem.assemble(&fit.hypothesis, &fit.values);
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
    scenario.effects = members(&search.problem, fit)
        .iter()
        .filter(|m| !is_term(m.0) && !search.free_in_time(m.0))
        .map(|(effect, values)| EffectUse { effect: effect.id.into(), parameters: named(effect, values) })
        .collect();
    scenario
}

fn named(effect: &kort_thruster::effects::Descriptor, values: &[f64]) -> BTreeMap<String, f64> {
    // Only names are wanted here, and they do not depend on the scale.
    let unit = Scale {
        shaft_speed_rad_s: 1.0,
        torque_n_m: 1.0,
        thrust_n: 1.0,
        flow_m_s: 1.0,
        current_a: 1.0,
        command: 1.0,
        supply_v: 1.0,
        winding_resistance_ohm: 1.0,
        inertia_kg_m2: 1.0,
        tick_s: 0.002,
        duration_s: 60.0,
    };
    (effect.parameters)(&unit).iter().map(|s| s.name.to_string()).zip(values.iter().copied()).collect()
}
