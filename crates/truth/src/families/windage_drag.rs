//! Drag of discs and hub, about the square of speed.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["square", "turbulent disc, power 1.8", "rough disc, power 2.15"],
    anchors: &[Quantity::Drag, Quantity::TorqueConstant, Quantity::Viscous],
    fits: any,
    draw,
    ..Family::new("windage_drag")
};

/// kw |v|^n sgn v: n = 2 for constant drag, 1.8 for a smooth disc whose boundary layer is turbulent
/// (von Karman 1921), above 2 where roughness wakes up.
struct Windage {
    power: f64,
    full_n_m: f64,
    level_n_m: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let power = [2.0, dice.between(1.78, 1.86), dice.between(2.08, 2.2)][form.min(2)];
    Box::new(Windage { power, full_n_m: 0.9 * machine.torque_limit_n_m(), level_n_m: 0.0 })
}

impl Physics for Windage {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let v = now.relative_speed();
        shaft.torque_n_m += self.level_n_m * v.signum() * v.abs().powf(self.power);
    }
}
