//! A stretch of a test signal as it is written.

use serde::{Deserialize, Serialize};

/// One stretch of a signal. Values are in the unit of the signal it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Segment {
    /// One value.
    Hold {
        /// The value.
        value: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Values one after the other.
    Steps {
        /// The values.
        values: Vec<f64>,
        /// How long each is held, s.
        each_s: f64,
    },
    /// Equal steps from one value to another, both included.
    Staircase {
        /// First level.
        from: f64,
        /// Last level.
        to: f64,
        /// Number of levels.
        levels: u32,
        /// How long each is held, s.
        each_s: f64,
    },
    /// A straight line.
    Ramp {
        /// Value at the start.
        from: f64,
        /// Value at the end.
        to: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Full ahead, full astern, and so on.
    Reversals {
        /// Size of both.
        amplitude: f64,
        /// How long each is held, s.
        each_s: f64,
        /// Number of reversals; one more level than that.
        count: u32,
    },
    /// A sine.
    Sine {
        /// Amplitude.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Frequency, Hz.
        frequency_hz: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// A sine whose frequency rises evenly in octaves a second.
    Chirp {
        /// Amplitude.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Frequency at the start, Hz.
        from_hz: f64,
        /// Frequency at the end, Hz.
        to_hz: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Sines of equal size, evenly spaced in octaves, with Schroeder's phases (low peaks), scaled
    /// so that their sum stays within the amplitude.
    Multisine {
        /// Largest size of the sum.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Lowest frequency, Hz.
        from_hz: f64,
        /// Highest frequency, Hz.
        to_hz: f64,
        /// Number of sines.
        tones: u32,
        /// How long, s.
        duration_s: f64,
    },
    /// Pseudo-random binary sequence of maximum length.
    Prbs {
        /// Size of both levels about the mean.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Shortest time between changes, s.
        each_s: f64,
        /// Length of the shift register, 5 to 15: the sequence repeats after `2^order - 1` steps.
        #[serde(default = "order")]
        order: u32,
        /// How long, s.
        duration_s: f64,
    },
    /// Random levels held for random times: sees gains and lags over the whole range.
    RandomLevels {
        /// Smallest level.
        low: f64,
        /// Largest level.
        high: f64,
        /// Shortest hold, s.
        shortest_s: f64,
        /// Longest hold, s.
        longest_s: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Points over time, straight lines between them.
    Points {
        /// Pairs of time since the segment's start [s] and value, times rising.
        points: Vec<[f64; 2]>,
    },
    /// A column of a recording.
    Replay {
        /// File, or name of a shipped recording.
        recording: String,
        /// Column, after the map.
        column: String,
        /// Column map for a foreign log.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        columns: Option<String>,
        /// Where to begin in the recording, s after its first row.
        #[serde(default)]
        from_s: f64,
        /// How long, s; to the recording's end if left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        duration_s: Option<f64>,
        /// Factor on the values.
        #[serde(default = "one")]
        scale: f64,
    },
}

impl Segment {
    /// Its kind, as written.
    pub const fn kind(&self) -> &'static str {
        match self {
            Segment::Hold { .. } => "hold",
            Segment::Steps { .. } => "steps",
            Segment::Staircase { .. } => "staircase",
            Segment::Ramp { .. } => "ramp",
            Segment::Reversals { .. } => "reversals",
            Segment::Sine { .. } => "sine",
            Segment::Chirp { .. } => "chirp",
            Segment::Multisine { .. } => "multisine",
            Segment::Prbs { .. } => "prbs",
            Segment::RandomLevels { .. } => "random_levels",
            Segment::Points { .. } => "points",
            Segment::Replay { .. } => "replay",
        }
    }
}

fn order() -> u32 {
    9
}

fn one() -> f64 {
    1.0
}
