//! The rig warms up a little in the run: drag falls by less than a percent of the torque.

use super::{Kind, Noise};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Physics, Shaft};

/// The kind.
pub const KIND: Kind = Kind {
    name: "warm_up",
    names: &["friction_warm_up", "thermal_drift_kt", "viscous_friction"],
    share: 0.2,
    fits: |_| true,
    draw,
};

struct Warm {
    torque_n_m: f64,
    time_s: f64,
}

fn draw(_: &Machine, full: &Scale, dice: &mut Dice) -> Noise {
    Noise::Physical(Box::new(Warm {
        torque_n_m: dice.log_between(0.0005, 0.004) * full.torque_n_m,
        time_s: dice.between(0.2, 1.0) * full.duration_s,
    }))
}

impl Physics for Warm {
    fn set(&mut self, _: f64) {}

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        shaft.torque_n_m += self.torque_n_m * (-now.time_s / self.time_s).exp() * now.relative_speed();
    }
}
