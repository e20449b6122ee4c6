//! Astern is not ahead: camber, hub, duct.

use super::{Family, wet};
use crate::blades::Inflow;
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Water};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["in lift and drag", "in pitch", "in the duct", "by camber"],
    fits: wet,
    draw,
    ..Family::new("forward_reverse_asymmetry")
};

enum Form {
    /// CL and CD scaled astern.
    Coefficients { drag: f64 },
    /// Another angle of the chord astern.
    Pitch(f64),
    /// Another flux coefficient astern, and less lift.
    Duct(f64),
    /// Zero lift at another angle: CL - c cos^2 a.
    Camber,
}

struct Astern {
    form: Form,
    strength: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Coefficients { drag: dice.between(-0.3, 0.8) },
        1 => Form::Pitch(dice.side() * 0.3),
        2 => Form::Duct(dice.between(0.6, 1.5)),
        _ => Form::Camber,
    };
    Box::new(Astern { form, strength: 0.0 })
}

impl Physics for Astern {
    fn set(&mut self, strength: f64) {
        self.strength = strength;
    }

    fn bends_polar(&self) -> bool {
        true
    }

    fn polar(&self, now: &Now, inflow: &Inflow, lift: &mut f64, drag: &mut f64) {
        let (s, astern) = (self.strength, inflow.tangential_m_s < 0.0);
        let Some(blades) = &now.machine.blades else { return };
        match self.form {
            Form::Coefficients { drag: share } if astern => {
                *lift *= 1.0 - 0.8 * s;
                *drag *= 1.0 - share * s;
            }
            Form::Pitch(turn) if astern => {
                // First order in the turn of the chord.
                let attack = inflow.attack_rad();
                *lift += 2.0 * turn * s * blades.lift_max * (2.0 * attack).cos();
                *drag += 2.0 * turn * s * blades.drag_max * (2.0 * attack).sin();
            }
            Form::Duct(_) if astern => *lift *= 1.0 - 0.3 * s,
            // The back of the blade is hollow seen astern.
            Form::Camber => {
                let side = if astern { -1.0 } else { 1.0 };
                *lift += side * 0.5 * s * blades.lift_max * inflow.attack_rad().cos().powi(2);
            }
            _ => {}
        }
    }

    fn water(&self, now: &Now, water: &mut Water) {
        if let Form::Duct(share) = self.form
            && now.flow_m_s < 0.0
        {
            water.flux_gain += 2.0 * share * self.strength;
        }
    }
}
