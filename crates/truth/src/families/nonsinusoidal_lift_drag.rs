//! Lift and drag are no single sine of the angle of attack.

use super::{Family, wet};
use crate::blades::Inflow;
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["profile drag and harmonics", "thin section below stall", "drag bucket"],
    anchors: &[Quantity::Drag],
    fits: wet,
    draw,
    ..Family::new("nonsinusoidal_lift_drag")
};

enum Form {
    /// CD + cd0 + c4 (1 - cos 4a), CL + b4 sin 4a.
    Harmonics { drag: f64, lift: f64 },
    /// Steeper lift near zero, less beyond: CL (1 + b (1 - (a/a0)^2)) within a0, and profile drag.
    Thin { angle: f64, drag: f64 },
    /// Drag that is small within a bucket: cd0 ((a - ai)/w)^2 up to a limit.
    Bucket { ideal: f64, width: f64 },
}

struct Section {
    form: Form,
    lift: f64,
    drag: f64,
    strength: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Harmonics { drag: dice.between(-0.3, 0.6), lift: dice.between(-0.8, 0.8) },
        1 => Form::Thin { angle: dice.between(0.25, 0.4), drag: dice.between(0.1, 0.4) },
        _ => Form::Bucket { ideal: dice.between(0.03, 0.1), width: dice.between(0.08, 0.16) },
    };
    let (lift, drag) = machine.blades.as_ref().map_or((1.0, 1.0), |b| (b.lift_max, b.drag_max));
    Box::new(Section { form, lift, drag, strength: 0.0 })
}

impl Physics for Section {
    fn set(&mut self, strength: f64) {
        self.strength = strength;
    }

    fn bends_polar(&self) -> bool {
        true
    }

    fn polar(&self, _: &Now, inflow: &Inflow, lift: &mut f64, drag: &mut f64) {
        let (attack, s) = (inflow.attack_rad(), self.strength);
        match self.form {
            Form::Harmonics { drag: c4, lift: b4 } => {
                *lift += s * b4 * self.lift * (4.0 * attack).sin();
                *drag += s * self.drag * (0.6 + c4 * (1.0 - (4.0 * attack).cos()));
            }
            Form::Thin { angle, drag: cd0 } => {
                *lift *= 1.0 + 1.5 * s * (1.0 - (attack / angle).powi(2)).max(0.0);
                *drag += s * cd0 * self.drag;
            }
            Form::Bucket { ideal, width } => {
                *drag += 0.7 * s * self.drag * ((attack.abs() - ideal) / width).powi(2).min(1.0);
            }
        }
    }
}
