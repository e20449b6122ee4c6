//! From what was asked for to a signal that may be played on a thruster, or to the reason why not.

use kort_scenario::{Command, Excitation, NoReplays, Scenario, ScenarioError, Segment};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::problem::{Kind, Problem};
use crate::view::{Setpoint, SetpointRange};

/// Longest signal, s.
pub const LONGEST_S: f64 = 3600.0;
/// Shortest time between two changes of a random signal, s: the controllers are no faster.
const SHORTEST_S: f64 = 0.005;
/// Fastest sine, Hz: of one whose half waves are shorter than that nothing is left but a line.
const FASTEST_HZ: f64 = 0.5 / SHORTEST_S;
/// Most sines of a multisine.
const TONES_MAX: u32 = 200;
/// Instants that the largest value is looked for at.
const PEAK_SAMPLES: f64 = 50_000.0;

/// What a signal commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Commanded {
    /// Thrust, N.
    #[default]
    ThrustN,
    /// Shaft speed, rad/s.
    SpeedRadS,
}

impl Commanded {
    fn unit(self) -> &'static str {
        match self {
            Commanded::ThrustN => "N",
            Commanded::SpeedRadS => "rad/s",
        }
    }

    fn range(self, range: SetpointRange) -> f64 {
        match self {
            Commanded::ThrustN => range.thrust_n,
            Commanded::SpeedRadS => range.speed_rad_s,
        }
    }

    /// The setpoint of this value.
    pub fn setpoint(self, value: f64) -> Setpoint {
        match self {
            Commanded::ThrustN => Setpoint::ThrustN(value),
            Commanded::SpeedRadS => Setpoint::SpeedRadS(value),
        }
    }
}

/// What somebody wants to play.
#[derive(Debug)]
pub struct Wanted {
    /// What it is called.
    pub name: String,
    /// What the segments' values mean.
    pub command: Command,
    /// What is commanded, where the values are shares; asked for explicitly.
    pub commanded: Option<Commanded>,
    /// The signal.
    pub segments: Vec<Segment>,
    /// Length, s, where it is not that of the segments.
    pub duration_s: Option<f64>,
    /// Seed of what is random.
    pub seed: u64,
    /// No setpoint goes beyond this either way; the thruster's range if left out.
    pub limit: Option<f64>,
    /// What a scenario says of the plant.
    pub left_out: Vec<String>,
}

/// A signal that may be played.
#[derive(Debug)]
pub struct Prepared {
    /// What it is called.
    pub name: String,
    /// What it commands.
    pub commanded: Commanded,
    /// No setpoint goes beyond this either way.
    pub limit: f64,
    /// Largest size that it reaches.
    pub peak: f64,
    /// Length, s.
    pub duration_s: f64,
    /// What a scenario says of the plant: the thruster brings its own.
    pub left_out: Vec<String>,
    scale: f64,
    signal: Excitation,
}

impl Prepared {
    /// Prepares a signal for a thruster with this range.
    pub fn new(wanted: Wanted, range: SetpointRange) -> Result<Prepared, Problem> {
        let (own, share) = match wanted.command {
            Command::ThrustCmdN => (Some(Commanded::ThrustN), false),
            Command::SpeedCmdRadS => (Some(Commanded::SpeedRadS), false),
            Command::Share => (None, true),
            other => {
                return Err(Problem::new(
                    Kind::OutOfRange,
                    format!(
                        "command = {:?} goes to a drive; a thruster is commanded by thrust or shaft speed",
                        other.name()
                    ),
                )
                .hint("shares of the limit fit every thruster")
                .allowed(["thrust_cmd_n", "speed_cmd_rad_s", "share"]));
            }
        };
        if let (Some(own), Some(asked)) = (own, wanted.commanded)
            && own != asked
        {
            return Err(Problem::new(
                Kind::InvalidField,
                format!("command asks for {} and the scenario's values are {}", asked.unit(), own.unit()),
            )
            .hint("leave command out: it is for scenarios in shares"));
        }
        let commanded = own.or(wanted.commanded).unwrap_or_default();
        let (unit, bound) = (commanded.unit(), commanded.range(range));
        let limit = wanted.limit.unwrap_or(bound);
        if !(limit > 0.0 && limit <= bound) {
            return Err(Problem::new(
                Kind::OutOfRange,
                format!("limit = {limit} is outside 0 to {bound:?} {unit}, 0 not included"),
            )
            .hint("GET /v1/thrusters shows the bound as range"));
        }
        wanted.segments.iter().enumerate().try_for_each(|(at, segment)| modest(at, segment))?;
        let signal =
            Excitation::new("segments", &wanted.segments, wanted.seed, &mut NoReplays).map_err(told)?;
        let duration_s = wanted.duration_s.unwrap_or(signal.duration_s());
        if !(duration_s > 0.0 && duration_s <= LONGEST_S) {
            return Err(Problem::new(
                Kind::OutOfRange,
                format!("the signal lasts {duration_s} s; allowed is above 0, at most {LONGEST_S}"),
            )
            .hint(
                "at least one segment, for example {\"kind\": \"hold\", \"value\": 10, \"duration_s\": 5}",
            ));
        }
        let scale = if share { limit } else { 1.0 };
        let peak = scale * signal.peak((duration_s / PEAK_SAMPLES).max(0.001));
        if peak > limit * (1.0 + 1e-9) {
            return Err(Problem::new(
                Kind::OutOfRange,
                format!("the signal reaches {peak:.2} {unit}; allowed is a limit of {limit:?} {unit}"),
            )
            .hint("make its amplitude smaller, or raise limit"));
        }
        let Wanted { name, left_out, .. } = wanted;
        Ok(Prepared { name, commanded, limit, peak, duration_s, left_out, scale, signal })
    }

    /// The setpoint at this time; never beyond the limit, whatever the signal does between the instants looked at.
    pub fn setpoint(&self, time_s: f64) -> Setpoint {
        self.commanded.setpoint(self.value(time_s))
    }

    /// Its value at this time.
    pub fn value(&self, time_s: f64) -> f64 {
        let value = self.scale * self.signal.value(time_s);
        // A phase beyond all numbers has no sine: nothing is commanded then.
        if value.is_finite() { value.clamp(-self.limit, self.limit) } else { 0.0 }
    }
}

/// What a scenario wants to play, and what of it only a simulation can do.
pub fn from_scenario(scenario: Scenario, commanded: Option<Commanded>, limit: Option<f64>) -> Wanted {
    let said = [
        ("ambient", !scenario.ambient.is_empty()),
        ("turbulence", scenario.turbulence.is_some()),
        ("supply", !scenario.supply.is_empty()),
        ("depth", !scenario.depth.is_empty()),
        ("temperature", !scenario.temperature.is_empty()),
        ("parameters", !scenario.parameters.is_empty()),
        ("effects", !scenario.effects.is_empty()),
    ];
    Wanted {
        name: if scenario.name.is_empty() { "scenario".into() } else { scenario.name },
        command: scenario.command,
        commanded,
        segments: scenario.segments,
        duration_s: scenario.duration_s,
        seed: scenario.seed,
        limit,
        left_out: said.into_iter().filter(|(_, there)| *there).map(|(name, _)| name.to_owned()).collect(),
    }
}

/// What a parser expects, but for a kind that is not played here.
pub fn without_replay(words: &str) -> String {
    words.replace(", `replay`", "")
}

/// Refuses what would only cost time and memory here, and what is not played at all.
fn modest(at: usize, segment: &Segment) -> Result<(), Problem> {
    let refused = |key: &str, found: String, allowed: String| {
        Err(Problem::new(
            Kind::OutOfRange,
            format!("segments[{at}].{key} = {found} is outside what is allowed: {allowed}"),
        )
        .hint("correct the value"))
    };
    if let Segment::Replay { .. } = segment {
        let words = format!("segments[{at}].kind = \"replay\": replays are not played on a thruster");
        let hint = "kort simulate plays them on a plant; here any other kind of segment is played";
        return Err(Problem::new(Kind::InvalidField, words).hint(hint));
    }
    let too_fast = |key: &str, hz: f64| refused(key, hz.to_string(), format!("at most {FASTEST_HZ}"));
    match segment {
        Segment::Prbs { each_s: s, .. } | Segment::RandomLevels { shortest_s: s, .. } if *s < SHORTEST_S => {
            let key = if matches!(segment, Segment::Prbs { .. }) { "each_s" } else { "shortest_s" };
            refused(key, s.to_string(), format!("{SHORTEST_S} or more"))
        }
        Segment::Prbs { duration_s: s, .. }
        | Segment::RandomLevels { duration_s: s, .. }
        | Segment::Multisine { duration_s: s, .. }
            if *s > LONGEST_S =>
        {
            refused("duration_s", s.to_string(), format!("at most {LONGEST_S}"))
        }
        Segment::Sine { frequency_hz: hz, .. } if *hz > FASTEST_HZ => too_fast("frequency_hz", *hz),
        Segment::Chirp { to_hz, from_hz, .. } | Segment::Multisine { to_hz, from_hz, .. }
            if to_hz.max(*from_hz) > FASTEST_HZ =>
        {
            too_fast(if to_hz > from_hz { "to_hz" } else { "from_hz" }, to_hz.max(*from_hz))
        }
        Segment::Multisine { tones, .. } if *tones > TONES_MAX => {
            refused("tones", tones.to_string(), format!("at most {TONES_MAX}"))
        }
        _ => Ok(()),
    }
}

fn told(wrong: Vec<ScenarioError>) -> Problem {
    Problem::of_many(Kind::OutOfRange, &wrong, "see the keys of a scenario in docs/recordings.md")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RANGE: SetpointRange = SetpointRange { thrust_n: 200.0, speed_rad_s: 120.0 };

    fn wanted(segments: Vec<Segment>) -> Wanted {
        let scenario = Scenario { segments, command: Command::ThrustCmdN, ..Scenario::default() };
        from_scenario(scenario, None, None)
    }

    fn refusal(wanted: Wanted) -> String {
        serde_json::to_string(&Prepared::new(wanted, RANGE).unwrap_err()).unwrap()
    }

    #[test]
    fn shares_are_shares_of_the_limit_and_newtons_are_newtons() {
        let half = || vec![Segment::Hold { value: 0.5, duration_s: 2.0 }];
        let share = Wanted { command: Command::Share, limit: Some(60.0), ..wanted(half()) };
        assert_eq!(Prepared::new(share, RANGE).unwrap().setpoint(1.0), Setpoint::ThrustN(30.0));
        let speed =
            Wanted { command: Command::Share, commanded: Some(Commanded::SpeedRadS), ..wanted(half()) };
        assert_eq!(Prepared::new(speed, RANGE).unwrap().setpoint(1.0), Setpoint::SpeedRadS(60.0));
        assert_eq!(Prepared::new(wanted(half()), RANGE).unwrap().setpoint(1.0), Setpoint::ThrustN(0.5));
    }

    #[test]
    fn a_replay_is_not_played_and_nobody_is_told_to_try_one() {
        let replay = "[[segments]]\nkind = \"replay\"\nrecording = \"a.csv\"\ncolumn = \"thrust_cmd_n\"\n";
        let scenario = Scenario::from_text_with_all(replay).unwrap();
        let told = refusal(from_scenario(scenario, Some(Commanded::ThrustN), None));
        assert!(told.contains("replays are not played on a thruster"), "{told}");
        let unknown = Scenario::from_text_with_all("[[segments]]\nkind = \"replai\"\n").unwrap_err();
        let words = without_replay(&unknown[0].to_string());
        assert!(words.contains("`prbs`") && !words.contains("`replay`"), "{words}");
    }

    #[test]
    fn what_goes_beyond_the_limit_or_to_a_drive_is_refused_with_the_reason() {
        let hold = |value| vec![Segment::Hold { value, duration_s: 2.0 }];
        assert!(refusal(wanted(hold(201.0))).contains("a limit of 200.0 N"));
        assert!(refusal(Wanted { limit: Some(50.0), ..wanted(hold(51.0)) }).contains("reaches 51.00 N"));
        assert!(refusal(Wanted { limit: Some(201.0), ..wanted(hold(1.0)) }).contains("limit = 201"));
        assert!(refusal(Wanted { limit: Some(f64::NAN), ..wanted(hold(1.0)) }).contains("limit = NaN"));
        assert!(refusal(wanted(Vec::new())).contains("lasts 0 s"));
        assert!(
            refusal(Wanted { command: Command::CurrentCmdA, ..wanted(hold(1.0)) }).contains("current_cmd_a")
        );
        assert!(refusal(wanted(vec![Segment::Hold { value: 1.0, duration_s: 3601.0 }])).contains("3601"));
        let fast = Segment::Prbs { amplitude: 1.0, mean: 0.0, each_s: 1e-6, order: 9, duration_s: 10.0 };
        assert!(refusal(wanted(vec![fast])).contains("segments[0].each_s"));
        let odd = Segment::Sine { amplitude: 1.0, mean: 0.0, frequency_hz: -1.0, duration_s: 1.0 };
        assert!(refusal(wanted(vec![odd])).contains("segments[0].frequency_hz"));
    }

    proptest! {
        /// Whatever is played, no setpoint is beyond the limit or no number.
        #[test]
        fn no_setpoint_is_beyond_the_limit(amplitude in 0.0..300.0f64, mean in -100.0..100.0f64, limit in 1.0..200.0f64, to_hz in 0.1..50.0f64) {
            let chirp = Segment::Chirp { amplitude, mean, from_hz: 0.1, to_hz, duration_s: 5.0 };
            if let Ok(signal) = Prepared::new(Wanted { limit: Some(limit), ..wanted(vec![chirp]) }, RANGE) {
                for step in 0..2000 {
                    prop_assert!(signal.value(f64::from(step) * 0.0037).abs() <= limit);
                }
            } else {
                prop_assert!(amplitude + mean.abs() > limit * 0.99);
            }
        }
    }
}
