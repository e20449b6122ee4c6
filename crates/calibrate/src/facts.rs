//! What a session has found so far.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A sensor at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RestReading {
    /// Readings.
    pub count: u32,
    /// Mean, in the signal's unit.
    pub mean: f64,
    /// Standard deviation of one reading.
    pub sigma: f64,
    /// Readings that one independent one stands for: noise may have a memory.
    pub memory: f64,
    /// Smallest step between two readings; zero if all were equal.
    pub step: f64,
}

/// Standard errors in a tolerance: a session states some thirty quantities, and in 99 sessions of 100 all of them are to
/// lie inside. That is 1 - 0.99^(1/30) outside for each. With three each is right, and one session in twelve has one
/// outside.
pub const ALL_INSIDE: f64 = 3.59;
/// What a quantity may lie outside with, on either side: as above.
const OUTSIDE_EACH_SIDE: f64 = 1.67e-4;

/// [`ALL_INSIDE`] where the standard error itself is known from a few independent readings only.
fn all_inside_of(independent: f64) -> f64 {
    let freedom = (independent - 1.0).max(1.0);
    StudentsT::new(0.0, 1.0, freedom).map_or(ALL_INSIDE, |t| t.inverse_cdf(1.0 - OUTSIDE_EACH_SIDE))
}

impl RestReading {
    /// Tolerance of the mean; half a step more where noise is too small to carry over it. A reading that never changed is a
    /// whole number of steps: no step is larger than it. Zero where it always read nothing: its step is not known then.
    pub fn tolerance(&self) -> f64 {
        let independent = f64::from(self.count.max(1)) / self.memory.max(1.0);
        // About the mean of the same readings they scatter a little less than about the truth.
        let error = self.sigma / (independent - 1.0).max(1.0).sqrt();
        let step = if self.step > 0.0 { self.step } else { self.mean.abs() };
        all_inside_of(independent) * error + if self.sigma < 0.6 * step { 0.5 * step } else { 0.0 }
    }
}

/// How a sensor answers pulses, as if all were ahead: readings, each by what it weighs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Answer {
    /// Sum of the readings above the zero, in the signal's unit times the weight's.
    pub sum: f64,
    /// Sum of the weights.
    pub weights: f64,
    /// Sum of their squares.
    pub squares: f64,
}

impl Answer {
    /// Takes a reading above its zero; the weight has the sign of what should push.
    pub fn take(&mut self, above_zero: f64, weight: f64) {
        if above_zero.is_finite() && weight.is_finite() {
            self.sum += above_zero * weight;
            self.weights += weight;
            self.squares += weight * weight;
        }
    }

    /// The answer over its standard error, given how the sensor reads at rest; zero without readings of any weight.
    pub fn significance(&self, rest: &RestReading) -> f64 {
        if self.squares <= 0.0 || rest.count < 2 {
            return 0.0;
        }
        let memory = rest.memory.max(1.0);
        // The zero has an error of its own, and a converter's step is no smaller than its digit.
        let one = rest.sigma.max(0.3 * rest.step).max(1e-12);
        let error = one * (memory * (self.squares + self.weights.powi(2) / f64::from(rest.count))).sqrt();
        self.sum / error
    }
}

/// Breakaway one way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Breakaway {
    /// Motor torque at which the shaft began to turn, N m.
    pub torque_n_m: f64,
    /// Its tolerance, N m.
    pub tolerance_n_m: f64,
}

/// A level held until it settled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// Drive, in the unit of the drive.
    pub drive: f64,
    /// Shaft speed, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Thrust above its zero, N; NaN if not measured.
    pub thrust_n: f64,
    /// Its tolerance: noise, zero, and what still moved, N.
    pub thrust_tolerance_n: f64,
    /// Motor current above its zero, A; NaN if not measured.
    pub current_a: f64,
}

/// All of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Sensors at rest, in the order of the signal table; no readings: not measured.
    pub rest: Vec<RestReading>,
    /// Drive at which the shaft first moved, in the unit of the drive.
    pub first_drive: f64,
    /// 1 if the shaft sensor shows what is commanded, -1 if the opposite; 0 before anything moved.
    pub side: f64,
    /// How thrust, flow and blade torque answer pulses ahead, of first and further ones.
    pub answers: [Answer; 3],
    /// What pushed the water lately, as speed squared with its sign, (rad/s)^2, and when that was, s.
    pub pushed: (f64, f64),
    /// Breakaway ahead and astern, where it was looked for.
    pub breakaway: [Option<Breakaway>; 2],
    /// Levels of the working range.
    pub levels: Vec<Level>,
    /// Words on what was left out, by stage.
    pub left_out: Vec<(&'static str, String)>,
}

/// Signals whose answers are gathered, in the order of [`Facts::answers`].
pub const WITNESSES: [&str; 3] = ["thrust_n", "flow_m_s", "torque_n_m"];

/// Significance from which an answer has a sign.
pub const SURE: f64 = 6.0;

impl Facts {
    /// How a signal reads at rest; no readings if it is not measured.
    pub fn at_rest(&self, signal: &str) -> RestReading {
        let place = kort_proto::signals::SIGNALS.iter().position(|s| s.name == signal);
        place.and_then(|k| self.rest.get(k)).copied().unwrap_or_default()
    }

    /// Is it measured at all?
    pub fn measures(&self, signal: &str) -> bool {
        self.at_rest(signal).count > 0
    }

    /// Sign of a witness's answer to a pulse ahead: 1, -1, or 0 while it is not sure.
    pub fn sign_of(&self, witness: usize) -> f64 {
        let z = self.answers[witness].significance(&self.at_rest(WITNESSES[witness]));
        if z.abs() > SURE { z.signum() } else { 0.0 }
    }
}
