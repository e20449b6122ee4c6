//! Vapour on the blades at top speed.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["loss in proportion", "breakdown along a tanh", "lift lost, drag risen", "loss by a square root"],
    fits: wet,
    draw,
    ..Family::new("cavitation")
};

/// Losses over the cavitation number sigma relative to its onset: x = 1 - sigma/sigma_i where vapour is.
struct Vapour {
    form: usize,
    /// Speed at which it begins, over the largest.
    onset: f64,
    loss: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Vapour { form, onset: dice.between(0.55, 0.8), loss: 0.0 })
}

impl Physics for Vapour {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn forces(&self, now: &Now, thrust_n: &mut f64, torque_n_m: &mut f64) {
        let Some(blades) = &now.machine.blades else { return };
        let first = self.onset * (blades.arm_m() * now.full.speed_rad_s).hypot(now.full.flow_m_s);
        let sigma = (first / now.blade_speed_m_s().max(1e-6)).powi(2);
        let x = (1.0 - sigma).max(0.0);
        let (thrust, torque) = match self.form {
            0 => (2.5 * x, 2.5 * x),
            1 => ((4.0 * x * x).tanh() * 1.5, (4.0 * x * x).tanh() * 1.1),
            2 => (2.5 * x, 0.8 * x),
            _ => (1.4 * x.sqrt() * x, 1.2 * x.sqrt() * x),
        };
        *thrust_n *= (1.0 - self.loss * thrust).max(0.05);
        *torque_n_m *= (1.0 - self.loss * torque).max(0.05);
    }
}
