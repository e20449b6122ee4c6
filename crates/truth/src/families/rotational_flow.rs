//! The wake turns with the propeller.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Water};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["swirl balance", "stator takes a part", "wall friction beside the wash"],
    fits: wet,
    draw,
    ..Family::new("rotational_flow")
};

enum Form {
    /// Angular momentum in, washed out by the flow.
    Balance,
    /// Stator vanes turn a share back at once.
    Stator(f64),
    /// The wall brakes it too, in proportion to its square.
    Wall(f64),
}

struct Swirl {
    form: Form,
    inertia: f64,
    strength: f64,
    tangential: Lag,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Balance,
        1 => Form::Stator(dice.between(0.2, 0.5)),
        _ => Form::Wall(dice.between(0.2, 0.8)),
    };
    Box::new(Swirl { form, inertia: dice.between(0.15, 1.0), strength: 0.0, tangential: Lag::default() })
}

impl Physics for Swirl {
    fn set(&mut self, strength: f64) {
        self.strength = 2.5 * strength;
    }

    fn rest(&mut self) {
        self.tangential = Lag::default();
    }

    fn water(&self, _: &Now, water: &mut Water) {
        let kept = if let Form::Stator(share) = self.form { 1.0 - share } else { 1.0 };
        water.swirl_m_s += kept * self.tangential.value;
    }

    /// The blades' torque spins a column of water up; the axial flow carries it away.
    fn advance(&mut self, now: &Now, step_s: f64) {
        let Some(blades) = &now.machine.blades else { return };
        let column = blades.density_kg_m3 * blades.area_m2();
        let swirl = self.tangential.value;
        let wall = if let Form::Wall(share) = self.form { share * swirl.abs() } else { 0.0 };
        let wash = (now.flow_m_s.abs() + wall + 0.02 * now.full.flow_m_s) / self.strength.max(1e-6);
        let settled = now.blade_torque_n_m / blades.arm_m() / (column * wash);
        let inertia = self.inertia.max(0.05 / self.strength.max(1e-3));
        self.tangential.follow(settled, blades.duct_length_m * inertia / wash, step_s);
    }
}
