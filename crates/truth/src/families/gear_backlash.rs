//! Play in a gear.

use super::{Family, geared};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Link, Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["dead zone", "dead zone with a soft flank", "impact that damps with depth"],
    fits: geared,
    draw,
    ..Family::new("gear_backlash")
};

enum Form {
    /// k (|d| - b/2) beyond the play, c d' in contact.
    Plain,
    /// k (|d| - b/2)^1.5: Hertz contact, scaled to the same force at the play's own size.
    Hertz,
    /// k e (1 + c d'): Hunt and Crossley 1975.
    Impact,
}

struct Play {
    form: Form,
    far_share: f64,
    far_kg_m2: f64,
    natural_rad_s: f64,
    full_rad: f64,
    half_rad: f64,
}

fn draw(form: usize, machine: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Plain,
        1 => Form::Hertz,
        _ => Form::Impact,
    };
    let far_share = dice.between(0.4, 0.8);
    Box::new(Play {
        form,
        far_share,
        far_kg_m2: machine.inertia_kg_m2 * far_share,
        natural_rad_s: std::f64::consts::TAU * dice.between(40.0, 70.0),
        full_rad: 0.2 * full.speed_rad_s,
        half_rad: 0.0,
    })
}

impl Physics for Play {
    fn set(&mut self, strength: f64) {
        self.half_rad = strength * self.full_rad;
    }

    fn link(&self, _: &Now, twist: f64, slip: f64) -> Option<Link> {
        let reduced = self.far_kg_m2 * (1.0 - self.far_share);
        let stiffness = reduced * self.natural_rad_s.powi(2);
        let damper = 0.6 * self.natural_rad_s * reduced;
        let depth = twist.abs() - self.half_rad;
        let torque_n_m = if depth <= 0.0 {
            0.0
        } else {
            let way = twist.signum();
            let pressed = match self.form {
                Form::Plain => way * stiffness * depth + damper * slip,
                Form::Hertz => {
                    way * stiffness * depth * (depth / (depth + 0.02 * self.full_rad)).sqrt() + damper * slip
                }
                Form::Impact => way * stiffness * depth * (1.0 + (way * slip * 4.0 / self.natural_rad_s / (depth + 1e-3)).clamp(-0.9, 2.0)),
            };
            // Flanks push, they do not pull.
            way * (way * pressed).max(0.0)
        };
        Some(Link { far_share: self.far_share, torque_n_m })
    }

    fn quick(&self) -> bool {
        true
    }
}
