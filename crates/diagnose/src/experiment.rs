//! The run that would settle what this one cannot: of the shipped test signals, the one on which
//! the rivals' fitted models differ most.

use std::collections::BTreeMap;

use kort_identify::fit::Fit;
use kort_scenario::{EffectUse, NoReplays, Run, Scenario};
use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{AmplifierKind, Load, Rig};

use crate::decide::{Decision, Named};
use crate::flexible::{SHAFT_OVER_ANGLE, is_term};
use crate::load_steps::LOAD_STEPS;
use crate::report::{Mismatch, NextExperiment, Remainder, Verdict};
use crate::search::{Search, Set};

/// A test signal: shipped scenario, what it does in an engineer's words.
type Signal = (&'static str, &'static str);
const STAIRCASE: Signal = (
    include_str!("../../../config/scenarios/staircase.toml"),
    "a staircase of steady levels, up and down, both ways",
);
const RANDOM_LEVELS: Signal = (
    include_str!("../../../config/scenarios/identification-random-levels.toml"),
    "random steps both ways, logged with the fastest rate there is",
);
/// Only where there is water.
const TOW: Signal =
    (include_str!("../../../config/scenarios/tow.toml"), "steps while towed ahead and astern");
/// Test signals to choose from.
const SIGNALS: [Signal; 5] = [
    (
        include_str!("../../../config/scenarios/slow-reversal-ramp.toml"),
        "a slow ramp through zero in both directions",
    ),
    STAIRCASE,
    (include_str!("../../../config/scenarios/chirp.toml"), "a chirp of 0.05 to 5 Hz about a mean"),
    RANDOM_LEVELS,
    TOW,
];

/// What a recording leaves open beside its names.
#[derive(Clone, Copy)]
pub struct Open<'a> {
    /// The path on which what is left acts, where that is more than noise.
    pub path: Option<&'a str>,
    /// Why the recordings have too little in them to tell anything.
    pub thin: Option<&'a str>,
}

impl<'a> Open<'a> {
    /// What stands in a report.
    pub fn of(
        decision: &Decision,
        remainder: Option<&'a Remainder>,
        mismatch: &'a [Mismatch],
        thin: Option<&'a str>,
    ) -> Self {
        let nameless = mismatch.first().filter(|_| decision.named.is_empty()).map(|m| m.path.as_str());
        Self {
            path: remainder.map(|r| r.path.as_str()).or(nameless),
            thin: thin.filter(|_| decision.verdict == Verdict::InsufficientData),
        }
    }
}

/// The next experiment, if anything is left open: what moves enough to tell anything; what parts a name from its rivals;
/// what shows more of a term without a name; what shows whether a name in doubt is there; what shows more of what is left
/// without either.
pub fn next(
    search: &Search,
    decision: &Decision,
    best: &Set,
    rig: &Rig,
    open: Open,
) -> Option<NextExperiment> {
    let mut members = decision.named.iter().filter(|n| best.contains(&n.effect));
    let contested = members.clone().find(|n| !n.rivals.is_empty());
    let doubted = members.find(|n| !n.believed);
    let term = decision.term.and_then(|id| search.descriptor(id));
    let found = too_little(open)
        .or_else(|| from_rivals(search, best, rig, contested?))
        .or_else(|| steady_levels(of_unknown(term?, rig, STAIRCASE.1)))
        .or_else(|| from_absence(search, best, rig, doubted?))
        .or_else(|| steady_levels((STAIRCASE.1.into(), along(open.path?))));
    found.map(|mut next| {
        if let Err(key) = rig.amplifier.largest_command(rig.motor.torque_constant_nm_a.value) {
            next.why += &format!("; its levels are shares of the largest command: state {key} in the rig");
        }
        next
    })
}

/// The rig with a largest command where it states none: as much as was recorded.
fn with_largest_command(rig: &Rig, scale: &Scale, torque_constant_nm_a: f64) -> Rig {
    let mut rig = rig.clone();
    if rig.amplifier.largest_command(torque_constant_nm_a).is_err() {
        match rig.amplifier.kind {
            AmplifierKind::Current => rig.amplifier.current_limit_a = scale.current_a,
            AmplifierKind::Voltage => rig.amplifier.supply_v = Some(scale.command),
            AmplifierKind::Speed => rig.amplifier.supply_v = Some(scale.command * torque_constant_nm_a),
        }
    }
    rig
}

/// Of recordings with too little in them: the signal that moves everything.
fn too_little(open: Open) -> Option<NextExperiment> {
    let why = format!("{}; this moves all that is to be told", open.thin?);
    unknown(RANDOM_LEVELS.0, "move-everything", (RANDOM_LEVELS.1.into(), why))
}

/// Of what has no name: steady levels, described by what to run and why.
fn steady_levels(told: (String, String)) -> Option<NextExperiment> {
    unknown(STAIRCASE.0, "locate-the-unknown", told)
}

fn unknown(text: &str, name: &str, (excitation, why): (String, String)) -> Option<NextExperiment> {
    let mut scenario: Scenario = toml::from_str(text).ok()?;
    scenario.name = name.into();
    Some(NextExperiment {
        separates: vec!["unknown".into()],
        excitation,
        why,
        scenario: serde_json::to_value(&scenario).ok()?,
    })
}

/// The signal that parts a name best from the likeliest of its rivals.
fn from_rivals(search: &Search, best: &Set, rig: &Rig, place: &Named) -> Option<NextExperiment> {
    let rival = *place.rivals.first()?;
    // A rival may stand there with another beside it: what counts is the likeliest set that has it in the place.
    let in_place = |set: &&Set| {
        let rest = best.iter().filter(|id| **id != place.effect);
        set.contains(&rival) && !set.contains(&place.effect) && rest.into_iter().all(|id| set.contains(id))
    };
    let other =
        search.fits.keys().filter(in_place).min_by(|a, b| search.cost(a).total_cmp(&search.cost(b)))?;
    let (chosen, rival) = (search.descriptor(place.effect)?, search.descriptor(rival)?);
    let mut most = where_they_differ(search, rig, best, other)?;
    most.scenario.what = format!("Parts {} from {}: {}", chosen.id, rival.id, most.words);
    most.scenario.name = format!("separate-{}-{}", chosen.id, rival.id).replace('_', "-");
    let separates = std::iter::once(place.effect).chain(place.rivals.iter().copied());
    let (sizes, advice) = why(search, chosen, rival, most.difference);
    most.told(separates, sizes, advice)
}

/// The signal on which a name in doubt shows most.
fn from_absence(search: &Search, best: &Set, rig: &Rig, place: &Named) -> Option<NextExperiment> {
    let without: Set = best.iter().copied().filter(|id| *id != place.effect).collect();
    let chosen = search.descriptor(place.effect)?;
    let mut most = where_they_differ(search, rig, best, &without)?;
    most.scenario.what = format!("Shows whether {} is there: {}", chosen.id, most.words);
    most.scenario.name = format!("show-{}", chosen.id).replace('_', "-");
    let size = if free_in_time(chosen, &search.problem.scale) {
        format!("{} changes freely with time and would come back another way", chosen.id)
    } else {
        let percent = 100.0 * most.difference;
        format!(
            "as fitted to this recording, {} would then make {percent:.1} % of full scale on the channel where it shows most",
            chosen.id
        )
    };
    most.told(std::iter::once(place.effect), size, chosen.separated_by)
}

/// A test signal on which two sets differ.
struct Differs {
    /// Root mean square over full scale, on the channel where it is largest.
    difference: f64,
    scenario: Scenario,
    words: &'static str,
}

impl Differs {
    /// What to run: this signal, or what the catalogue advises where it shows nothing.
    fn told(
        &self,
        separates: impl Iterator<Item = &'static str>,
        sizes: String,
        advice: &str,
    ) -> Option<NextExperiment> {
        let shows = self.difference >= SHOWS;
        let why = if shows {
            format!("{sizes}; the catalogue's advice: {advice}")
        } else {
            format!(
                "{sizes}: none of the shipped test signals shows that well; the best of them is {}",
                self.words
            )
        };
        Some(NextExperiment {
            separates: separates.map(str::to_string).collect(),
            excitation: if shows { self.words } else { advice }.into(),
            why,
            scenario: serde_json::to_value(&self.scenario).ok()?,
        })
    }
}

/// The test signal on which two fitted sets differ most, with what the first one holds in force.
fn where_they_differ(search: &Search, rig: &Rig, best: &Set, other: &Set) -> Option<Differs> {
    let (mine, theirs) = (search.fits.get(best)?, search.fits.get(other)?);
    let differ = |(text, words): &Signal| {
        let scenario: Scenario = toml::from_str(text).ok()?;
        let a = respond(&scenario, rig, search, mine)?;
        let b = respond(&scenario, rig, search, theirs)?;
        Some(Differs { difference: difference(&a, &b, &search.problem.scale), scenario, words })
    };
    let signals = SIGNALS.iter().filter(|signal| rig.propeller.is_some() || **signal != TOW);
    let most = signals.filter_map(differ).max_by(|x, y| x.difference.total_cmp(&y.difference))?;
    Some(Differs { scenario: with_effects(most.scenario, search, mine), ..most })
}

/// How much two rivals differ on a signal, and what the catalogue says parts them.
fn why(search: &Search, chosen: &Descriptor, rival: &Descriptor, difference: f64) -> (String, &'static str) {
    let percent = 100.0 * difference;
    match (free_in_time(chosen, &search.problem.scale), free_in_time(rival, &search.problem.scale)) {
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
    }
}

/// Difference over full scale below which a signal shows nothing.
const SHOWS: f64 = 0.003;

/// What to run for a term without a name, of which a signal both ways tells most, and why.
fn of_unknown(term: &Descriptor, rig: &Rig, both_ways: &str) -> (String, String) {
    let why = along(term.path.name());
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

fn along(path: &str) -> String {
    format!(
        "steady levels both ways show on the {path} path how the unknown goes with speed and direction; then repeat this run to see whether it stays"
    )
}

/// Whether an effect changes freely with time, and so comes again another way.
fn free_in_time(effect: &Descriptor, scale: &Scale) -> bool {
    (effect.parameters)(scale).iter().any(|s| s.acts.is_some())
}

fn respond(scenario: &Scenario, rig: &Rig, search: &Search, fit: &Fit) -> Option<Vec<Vec<f64>>> {
    let (parameters, _) = fit.hypothesis.assemble(&search.problem.stated, &fit.values);
    let scenario = with_effects(scenario.clone(), search, fit);
    let rig = with_largest_command(rig, &search.problem.scale, parameters.get(Parameter::TorqueConstantNmA));
    let mut run = without_noise(scenario, search.problem.model, &rig, &parameters)?;
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

/// A run of a scenario under a fit's parameters.
fn without_noise(
    mut scenario: Scenario,
    model: ModelName,
    rig: &Rig,
    parameters: &Parameters,
) -> Option<Run> {
    scenario.noise = 0.0;
    scenario.turbulence = None;
    scenario.model = model;
    // A limit that the rig does not state is infinite, which no file can say.
    let all = Parameter::ALL.iter().map(|p| (*p, parameters.get(*p)));
    scenario.parameters = all.filter(|(_, value)| value.is_finite()).collect();
    Run::new(&scenario, rig, &mut NoReplays).ok()
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
    fn a_rig_that_states_no_limit_is_tried_on_every_signal() {
        for (drive, key) in [
            ("kind = \"current\"", Some("amplifier.current_limit_a")),
            ("kind = \"current\"\ncurrent_limit_a = 3", None),
            ("kind = \"voltage\"", Some("amplifier.supply_v")),
            ("kind = \"voltage\"\nsupply_v = 12", None),
        ] {
            let winding = "winding_resistance_ohm = 1.0\n";
            let rig = Rig::from_toml(&format!("{SERVO}{winding}[amplifier]\n{drive}\n")).unwrap();
            assert_eq!(rig.amplifier.largest_command(0.35).err(), key);
            let parameters = Parameters::stated(&rig);
            let rig = with_largest_command(&rig, &Scale::ANY, 0.35);
            for (text, words) in SIGNALS {
                let scenario: Scenario = toml::from_str(text).unwrap();
                let run = without_noise(scenario, ModelName::Model2, &rig, &parameters);
                assert!(run.is_some(), "{words} on {drive}");
            }
        }
    }

    #[test]
    fn where_no_signal_shows_a_difference_the_catalogue_s_advice_is_what_to_run() {
        let (text, words) = STAIRCASE;
        let told = |difference: f64| {
            let differs = Differs { difference, scenario: toml::from_str(text).unwrap(), words };
            differs.told(["a", "b"].into_iter(), "how far".into(), "known weights on the stand").unwrap()
        };
        let (shown, not) = (told(2.0 * SHOWS), told(0.5 * SHOWS));
        assert!(shown.excitation == words && shown.why.contains("known weights"));
        assert_eq!(not.excitation, "known weights on the stand");
        assert!(not.why.contains(words) && !not.scenario.is_null());
    }

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
