//! Friction that grows with speed: oil, water in the gap, eddy currents.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["linear", "grease of a power below one", "eddy currents"],
    anchors: &[Quantity::Viscous, Quantity::TorqueConstant],
    fits: any,
    draw,
    ..Family::new("viscous_friction")
};

enum Form {
    /// kf v.
    Linear,
    /// A shear-thinning grease: |v|^n, n below one.
    Grease(f64),
    /// Induced currents: v / (1 + (v/vc)^2).
    Eddy(f64),
}

struct Drag {
    form: Form,
    full_n_m: f64,
    level_n_m: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Linear,
        1 => Form::Grease(dice.between(0.75, 0.95)),
        _ => Form::Eddy(dice.between(1.5, 4.0)),
    };
    Box::new(Drag { form, full_n_m: 0.8 * machine.torque_limit_n_m(), level_n_m: 0.0 })
}

impl Physics for Drag {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let v = now.relative_speed();
        shaft.torque_n_m += self.level_n_m
            * match self.form {
                Form::Linear => v,
                // Straight below a hundredth of full speed: no jump at rest.
                Form::Grease(power) => v * v.abs().max(0.01).powf(power - 1.0),
                Form::Eddy(corner) => v / (1.0 + (v / corner).powi(2)),
            };
    }
}
