//! Closed loops around a machine. Their set-point is logged; their law is not.

use crate::machine::Machine;
use crate::physics::Reading;

/// A law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Controller {
    /// Shaft speed by proportional and integral action: command per rad/s and per rad.
    Speed {
        /// A or V per rad/s.
        proportional: f64,
        /// A or V per rad.
        integral: f64,
    },
    /// Shaft angle by proportional action and damping: command per rad and per rad/s.
    Angle {
        /// A or V per rad.
        proportional: f64,
        /// A or V per rad/s.
        damping: f64,
    },
}

/// Memory of a law.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    integral: f64,
}

impl Controller {
    /// Command for a set-point and what is measured, within the machine's limits; five decimals, as
    /// a log would print it.
    pub fn update(
        &self,
        state: &mut State,
        wanted: f64,
        reading: &Reading,
        machine: &Machine,
        tick_s: f64,
    ) -> f64 {
        let limit = machine.command_limit();
        let asked = match *self {
            Controller::Speed { proportional, integral } => {
                let error = wanted - reading.speed_rad_s;
                let asked = proportional * error + state.integral;
                // The integral waits while the command stands at its limit.
                if asked.abs() < limit || asked * error < 0.0 {
                    state.integral += integral * error * tick_s;
                }
                asked
            }
            Controller::Angle { proportional, damping } => {
                proportional * (wanted - reading.angle_rad) - damping * reading.speed_rad_s
            }
        };
        (asked.clamp(-limit, limit) * 1e5).round() / 1e5
    }

    /// Column of the set-point.
    pub fn column(&self) -> &'static str {
        match self {
            Controller::Speed { .. } => "speed_cmd_rad_s",
            Controller::Angle { .. } => "shaft_angle_cmd_rad",
        }
    }
}
