//! Test signals tried on fitted models: on which of them, and in which channel, do two sets of effects differ most?

use std::collections::BTreeMap;

use kort_identify::fit::Fit;
use kort_scenario::{EffectUse, NoReplays, Run, Scenario};
use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::experiment::free_in_time;
use crate::flexible::is_term;
use crate::report::NextExperiment;
use crate::search::{Search, Set};

/// A test signal: shipped scenario, what it does in an engineer's words.
pub type Signal = (&'static str, &'static str);
/// What shows how something goes with speed and direction.
pub const STAIRCASE: Signal = (
    include_str!("../../../config/scenarios/staircase.toml"),
    "a staircase of steady levels, up and down, both ways",
);
/// What moves everything.
pub const RANDOM_LEVELS: Signal = (
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

/// A test signal on which two sets differ.
pub struct Differs {
    /// Root mean square over full scale, on the channel where it is largest.
    difference: f64,
    /// That channel: of those that were recorded, where it shows on one.
    channel: &'static str,
    recorded: bool,
    /// Fastest that the shaft turns on it in either model, over the fastest that was recorded.
    fastest: f64,
    /// The signal's scenario, with what was found in force.
    pub scenario: Scenario,
    /// The signal, in an engineer's words.
    pub words: &'static str,
}

impl Differs {
    /// How much shows at most, and where.
    pub fn most(&self) -> String {
        let record = if self.recorded { "" } else { ", which was not recorded: record it" };
        format!("{:.1} % of full scale in {}{record}", 100.0 * self.difference, self.channel)
    }

    /// What to run: this signal, or what the catalogue advises where it shows nothing.
    pub fn told(
        &self,
        separates: impl Iterator<Item = &'static str>,
        sizes: String,
        advice: &str,
    ) -> Option<NextExperiment> {
        let (shows, keeps) = (self.difference >= SHOWS, self.fastest <= RUNS_AWAY);
        let why = match (keeps, shows) {
            (true, true) => format!("{sizes}; the catalogue's advice: {advice}"),
            (true, false) => format!(
                "{sizes}: none of the shipped test signals shows that well; the best of them is {}",
                self.words
            ),
            (false, _) => format!(
                "little brakes this shaft: under the shipped test signals that would show it, at their full levels, it runs away, to {:.0} times the fastest speed that was recorded on {}; run that at a small share of its levels, or under a speed loop",
                self.fastest, self.words
            ),
        };
        Some(NextExperiment {
            separates: separates.map(str::to_string).collect(),
            excitation: if shows && keeps { self.words } else { advice }.into(),
            why,
            scenario: serde_json::to_value(&self.scenario).ok()?,
        })
    }
}

/// The test signal on which two fitted sets differ most, with what the first one holds in force.
pub fn where_they_differ(search: &Search, rig: &Rig, best: &Set, other: &Set) -> Option<Differs> {
    let (mine, theirs) = (search.fits.get(best)?, search.fits.get(other)?);
    let differ = |(text, words): &Signal| {
        let scenario: Scenario = toml::from_str(text).ok()?;
        let a = respond(&scenario, rig, search, mine)?;
        let b = respond(&scenario, rig, search, theirs)?;
        let fastest = [&a, &b].map(|speed| speed[0].iter().fold(0.0_f64, |m, s| m.max(s.abs())));
        let fastest = fastest[0].max(fastest[1]) / search.problem.scale.shaft_speed_rad_s;
        Some(Tried { scenario, words, differences: differences(&a, &b, &search.problem.scale), fastest })
    };
    let signals = SIGNALS.iter().filter(|signal| rig.propeller.is_some() || **signal != TOW);
    let mut all: Vec<Tried> = signals.filter_map(differ).collect();
    let channels: Vec<_> = search.problem.recordings.iter().flat_map(|r| &r.channels).collect();
    let recorded = CHANNELS.map(|channel| channels.iter().any(|c| c.response.name() == channel));
    let most = |recorded_only: bool| {
        let each = all
            .iter()
            .enumerate()
            .flat_map(|(k, tried)| tried.differences.iter().enumerate().map(move |(c, d)| (k, c, *d)));
        // Where a shaft runs away everything differs by much: a run that keeps it goes before.
        let keeps = |k: usize| all[k].fastest <= RUNS_AWAY;
        each.filter(|(_, c, _)| recorded[*c] || !recorded_only).max_by(|x, y| {
            (keeps(x.0) && x.2 >= SHOWS).cmp(&(keeps(y.0) && y.2 >= SHOWS)).then(x.2.total_cmp(&y.2))
        })
    };
    let (k, c, difference) = most(true).filter(|most| most.2 >= SHOWS).or_else(|| most(false))?;
    let Tried { scenario, words, fastest, .. } = all.swap_remove(k);
    let scenario = with_effects(scenario, search, mine);
    Some(Differs { difference, channel: CHANNELS[c], recorded: recorded[c], fastest, scenario, words })
}

/// A test signal on which two sets were simulated.
struct Tried {
    scenario: Scenario,
    words: &'static str,
    /// Root mean square over full scale, by channel.
    differences: [f64; 5],
    /// Fastest that the shaft turns in either, over the fastest that was recorded.
    fastest: f64,
}

/// Difference over full scale below which a signal shows nothing.
const SHOWS: f64 = 0.003;
/// Times the fastest speed recorded that a shaft may turn at on a test signal: full command takes a propeller that was logged at a
/// ninth of it so far, and a dry shaft that nothing brakes further with every second.
const RUNS_AWAY: f64 = 3.0;

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

fn respond(scenario: &Scenario, rig: &Rig, search: &Search, fit: &Fit) -> Option<Vec<Vec<f64>>> {
    let (parameters, _) = fit.hypothesis.assemble(&search.problem.stated, &fit.values);
    let scenario = with_effects(scenario.clone(), search, fit);
    let rig = with_largest_command(rig, &search.problem.scale, parameters.get(Parameter::TorqueConstantNmA));
    let mut run = without_noise(scenario, search.problem.model, &rig, &parameters)?;
    let at: Vec<Option<usize>> = CHANNELS.iter().map(|n| run.columns().iter().position(|c| c == n)).collect();
    let mut out: Vec<Vec<f64>> = vec![Vec::new(); CHANNELS.len()];
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

/// Channels on which responses are compared.
const CHANNELS: [&str; 5] = ["shaft_speed_rad_s", "thrust_n", "flow_m_s", "torque_n_m", "current_a"];

/// Root mean square difference over full scale, by channel.
fn differences(a: &[Vec<f64>], b: &[Vec<f64>], scale: &Scale) -> [f64; 5] {
    let full = [scale.shaft_speed_rad_s, scale.thrust_n, scale.flow_m_s, scale.torque_n_m, scale.current_a];
    std::array::from_fn(|c| {
        let (x, y) = (&a[c], &b[c]);
        let sum: f64 = x.iter().zip(y).map(|(p, q)| (p - q).powi(2)).sum();
        if x.len() == y.len() && full[c] > 0.0 { (sum / x.len().max(1) as f64).sqrt() / full[c] } else { 0.0 }
    })
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

    const SERVO: &str =
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.006\ntorque_constant_nm_a = 0.35\n";

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
            let scenario = toml::from_str(text).unwrap();
            let (channel, recorded, fastest) = ("current_a", false, 1.0);
            let differs = Differs { difference, channel, recorded, fastest, scenario, words };
            differs.told(["a", "b"].into_iter(), "how far".into(), "known weights on the stand").unwrap()
        };
        let (shown, not) = (told(2.0 * SHOWS), told(0.5 * SHOWS));
        assert!(shown.excitation == words && shown.why.contains("known weights"));
        assert_eq!(not.excitation, "known weights on the stand");
        assert!(not.why.contains(words) && !not.scenario.is_null());
    }

    #[test]
    fn of_a_shaft_that_runs_away_no_multiple_of_its_full_scale_is_told() {
        let (text, words) = STAIRCASE;
        let told = |difference: f64, fastest: f64| {
            let scenario = toml::from_str(text).unwrap();
            let differs = Differs {
                difference,
                channel: "shaft_speed_rad_s",
                recorded: true,
                fastest,
                scenario,
                words,
            };
            let size = differs.most();
            differs.told(["a"].into_iter(), size, "a coast-down").unwrap()
        };
        let (kept, away) = (told(0.2, 1.5), told(40.0, 120.0));
        assert!(kept.excitation == words && kept.why.contains("20.0 % of full scale"), "{}", kept.why);
        assert!(
            away.excitation == "a coast-down" && away.why.contains("120 times the fastest"),
            "{}",
            away.why
        );
    }
}
