//! Limits on references and commands, and what they do to integrators and to a switch of law.
//!
//! A limit in force is no fault: it is reported by name, and the law is told what was applied so
//! that its integrator follows (back-calculation, D10: `xi' = Ki e + (u_applied - u) / Tt`).

use serde::{Deserialize, Serialize};

/// A limit that can be in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Motor current at the rig's limit.
    Current,
    /// Rate of change of motor current.
    CurrentRate,
    /// Thrust reference beyond what the thruster can give in still water.
    ThrustReference,
    /// Rate of change of the thrust reference.
    ThrustReferenceRate,
    /// Shaft speed (reference or measured) at its cap.
    ShaftSpeed,
    /// Voltage at the supply's limit.
    Voltage,
    /// Anti-spin has taken the speed over.
    AntiSpin,
    /// The trim on the force sensor is at its authority.
    Trim,
}

impl Limit {
    /// Every limit.
    pub const ALL: [Self; 8] = [
        Self::Current,
        Self::CurrentRate,
        Self::ThrustReference,
        Self::ThrustReferenceRate,
        Self::ShaftSpeed,
        Self::Voltage,
        Self::AntiSpin,
        Self::Trim,
    ];

    /// Stable name, as in reports and the service's state.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Current => "current",
            Self::CurrentRate => "current_rate",
            Self::ThrustReference => "thrust_reference",
            Self::ThrustReferenceRate => "thrust_reference_rate",
            Self::ShaftSpeed => "shaft_speed",
            Self::Voltage => "voltage",
            Self::AntiSpin => "anti_spin",
            Self::Trim => "trim",
        }
    }
}

/// The limits in force at one tick, as bits in the order of [`Limit::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitSet(pub u32);

impl LimitSet {
    /// Marks a limit as in force.
    pub fn set(&mut self, limit: Limit) {
        self.0 |= 1 << limit as u32;
    }

    /// Whether a limit is in force.
    pub fn contains(self, limit: Limit) -> bool {
        self.0 & (1 << limit as u32) != 0
    }

    /// The limits in force.
    pub fn iter(self) -> impl Iterator<Item = Limit> {
        Limit::ALL.into_iter().filter(move |l| self.contains(*l))
    }
}

/// A value that may move only so fast.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RateLimiter {
    last: f64,
}

impl RateLimiter {
    /// Moves towards `target` by at most `rate_per_s * dt_s`; says whether the rate was in force.
    pub fn step(&mut self, target: f64, rate_per_s: f64, dt_s: f64) -> (f64, bool) {
        let most = rate_per_s * dt_s;
        let step = (target - self.last).clamp(-most, most);
        let limited = (target - self.last).abs() > most;
        self.last = if limited { self.last + step } else { target };
        (self.last, limited)
    }

    /// Starts again from `value`.
    pub fn reset(&mut self, value: f64) {
        self.last = value;
    }
}

/// An integrator that follows what was applied.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integrator {
    /// Its state, in the unit of the output.
    pub state: f64,
}

impl Integrator {
    /// Adds `gain * error * dt`, held within plus and minus `authority`; says whether it is there.
    pub fn step(&mut self, rate: f64, authority: f64, dt_s: f64) -> bool {
        let next = self.state + rate * dt_s;
        self.state = next.clamp(-authority, authority);
        self.state != next
    }

    /// Lets go of what can no longer be checked, as its sensor is gone.
    pub fn fade(&mut self, time_s: f64, dt_s: f64) {
        self.state *= 1.0 - (dt_s / time_s.max(dt_s)).min(1.0);
    }

    /// Back-calculation: draws the state towards what makes the output equal to what was applied.
    pub fn follow(&mut self, asked: f64, applied: f64, tracking_time_s: f64, dt_s: f64) {
        if asked != applied {
            let share = (dt_s / tracking_time_s.max(dt_s)).min(1.0);
            let pull = (applied - asked) * share;
            // Only ever unwinds: a limit never charges an integrator past zero.
            let next = self.state + pull;
            self.state = if next * self.state < 0.0 {
                0.0
            } else if next.abs() < self.state.abs() {
                next
            } else {
                self.state
            };
        }
    }
}

/// Bumpless transfer: at a switch the last output is held and fades into the new one exponentially, so that neither
/// law needs to know the other. Not their difference is kept: what a law that starts afresh asks for at its
/// first tick (a rate from nothing, an inverted lag) says little of what it asks for at the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bumpless {
    held: f64,
    /// Share of the held output.
    share: f64,
    pending: bool,
}

/// Share of the held output that is none.
const FADED: f64 = 1e-6;

impl Bumpless {
    /// The next output shall continue from the last one.
    pub fn arm(&mut self) {
        self.pending = true;
    }

    /// The output with what is left of the held one.
    pub fn step(&mut self, output: f64, last_output: f64, fade_s: f64, dt_s: f64) -> f64 {
        if std::mem::take(&mut self.pending) {
            (self.held, self.share) = (last_output, 1.0);
        } else {
            self.share *= 1.0 - (dt_s / fade_s.max(dt_s)).min(1.0);
        }
        if self.share < FADED || !self.held.is_finite() {
            self.share = 0.0;
            return output;
        }
        output + self.share * (self.held - output)
    }

    /// Forgets what was held.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_switch_starts_from_the_last_output_and_fades() {
        let mut b = Bumpless::default();
        b.arm();
        assert_eq!(b.step(1.0, 5.0, 0.1, 0.001), 5.0);
        let mut last = 5.0;
        for _ in 0..2000 {
            last = b.step(1.0, last, 0.1, 0.001);
        }
        assert!((last - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_a_law_asks_for_at_its_first_tick_alone_does_not_show() {
        let mut b = Bumpless::default();
        b.arm();
        assert_eq!(b.step(80.0, 5.0, 0.1, 0.001), 5.0);
        for _ in 0..300 {
            assert!((b.step(5.0, 5.0, 0.1, 0.001) - 5.0).abs() < 1e-9);
        }
    }

    #[test]
    fn back_calculation_unwinds_but_never_charges() {
        let mut i = Integrator { state: 2.0 };
        for _ in 0..10_000 {
            i.follow(10.0, 5.0, 0.05, 0.001);
        }
        assert_eq!(i.state, 0.0);
    }

    #[test]
    fn rate_limiter_reaches_its_target_exactly() {
        let mut r = RateLimiter::default();
        for _ in 0..7 {
            r.step(0.55, 100.0, 0.001);
        }
        assert_eq!(r.step(0.55, 100.0, 0.001), (0.55, false));
    }
}
