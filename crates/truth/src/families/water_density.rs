//! The water is lighter or heavier than stated.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Water};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["even", "layers that drift by", "lighter where the jet mixes"],
    anchors: &[Quantity::Lift, Quantity::Drag, Quantity::Flux, Quantity::AddedMass, Quantity::TorqueConstant],
    fits: wet,
    draw,
    ..Family::new("water_density")
};

enum Form {
    Even,
    /// Changes a little over the run.
    Layers(f64),
    /// A little less of it at full flow.
    Mixing(f64),
}

struct Density {
    form: Form,
    side: f64,
    error: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Even,
        1 => Form::Layers(dice.between(-0.3, 0.3)),
        _ => Form::Mixing(dice.between(0.05, 0.2)),
    };
    Box::new(Density { form, side: dice.side(), error: 0.0 })
}

impl Density {
    fn gain(&self, now: &Now) -> f64 {
        1.0 + self.error
            * match self.form {
                Form::Even => 1.0,
                Form::Layers(share) => 1.0 + share * (now.time_s / now.full.duration_s - 0.5),
                Form::Mixing(share) => 1.0 - share * now.relative_flow().abs(),
            }
    }
}

impl Physics for Density {
    fn set(&mut self, strength: f64) {
        self.error = 0.9 * strength * self.side;
    }

    fn forces(&self, now: &Now, thrust_n: &mut f64, torque_n_m: &mut f64) {
        *thrust_n *= self.gain(now);
        *torque_n_m *= self.gain(now);
    }

    fn water(&self, now: &Now, water: &mut Water) {
        water.flux_gain *= self.gain(now);
        water.mass_gain *= self.gain(now);
    }
}
