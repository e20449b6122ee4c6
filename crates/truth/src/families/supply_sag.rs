//! Cable and battery: the bus falls under load.

use super::{Family, sags};
use crate::dice::Dice;
use crate::machine::{DriveKind, Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Drive, Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["resistance", "resistance and recovery", "battery that empties"],
    anchors: &[Quantity::TorqueConstant, Quantity::Resistance],
    fits: sags,
    draw,
    ..Family::new("supply_sag")
};

struct Sag {
    /// Shares of the drop that come at once, within `slow_s`, and with the charge taken.
    shares: [f64; 3],
    slow_s: f64,
    slow: Lag,
    taken: f64,
    drop: f64,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let part = dice.between(0.3, 0.6);
    let shares = match form {
        0 => [1.0, 0.0, 0.0],
        1 => [1.0 - part, part, 0.0],
        _ => [1.0 - part, 0.0, 2.0 * part],
    };
    Box::new(Sag { shares, slow_s: dice.between(0.03, 0.15) * full.duration_s, slow: Lag::default(), taken: 0.0, drop: 0.0 })
}

/// Power into the motor over its largest.
fn load(now: &Now) -> f64 {
    let machine = now.machine;
    let power = |current: f64, speed: f64| {
        (machine.winding_resistance_ohm * current + machine.torque_constant_nm_a * speed) * current
    };
    (power(now.current_a, now.speed_rad_s) / power(now.full.current_a, now.full.speed_rad_s)).max(0.0)
}

impl Physics for Sag {
    fn set(&mut self, strength: f64) {
        self.drop = strength;
    }

    fn rest(&mut self) {
        (self.slow, self.taken) = (Lag::default(), 0.0);
    }

    fn drive(&self, now: &Now, drive: &mut Drive) {
        let drop = self.shares[0] * load(now) + self.shares[1] * self.slow.value + self.shares[2] * self.taken;
        let left = (1.0 - self.drop * drop).max(0.1);
        drive.supply_ratio *= left;
        if now.machine.drive == DriveKind::Current {
            // The rig's supply has little to spare here: what the bus lacks, the winding lacks.
            let needs = now.machine.winding_resistance_ohm * now.full.current_a
                + now.machine.torque_constant_nm_a * now.full.speed_rad_s;
            drive.voltage_limit_v = drive.voltage_limit_v.min(1.03 * needs * left);
        }
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        let load = load(now);
        self.slow.follow(load, self.slow_s, step_s);
        self.taken += load * step_s / now.full.duration_s;
    }
}
