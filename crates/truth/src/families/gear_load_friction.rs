//! Friction in proportion to what a gear carries.

use super::{Family, geared};
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Shaft};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["proportional", "with preload", "differs driving and driven"],
    anchors: &[Quantity::TorqueConstant, Quantity::Inertia, Quantity::Viscous],
    fits: geared,
    draw,
    ..Family::new("gear_load_friction")
};

enum Form {
    /// mu |tau|.
    Plain,
    /// mu sqrt(tau^2 + tau0^2): the mesh is preloaded.
    Preload(f64),
    /// mu |tau| while the motor drives, more while the load drives.
    Driven(f64),
}

struct Gear {
    form: Form,
    full_n_m: f64,
    share: f64,
    /// Share of the inertia that turns on the motor's side of the mesh: what it takes does not pass.
    motor_side: f64,
    /// What the gear carries, through the mesh's own compliance.
    carried: Lag,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Plain,
        1 => Form::Preload(dice.between(0.02, 0.1)),
        _ => Form::Driven(dice.between(1.2, 2.0)),
    };
    // Of a gear motor without a load, all of it turns on the far side.
    let motor_side = match machine.load {
        Load::None => 0.0,
        load => 1.0 - load.inertia_kg_m2() / machine.inertia_kg_m2,
    };
    let full_n_m = machine.torque_limit_n_m();
    Box::new(Gear { form, full_n_m, share: 0.0, motor_side, carried: Lag::default() })
}

impl Physics for Gear {
    fn set(&mut self, strength: f64) {
        self.share = 0.9 * strength;
    }

    fn rest(&mut self) {
        self.carried = Lag::default();
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let carried = self.carried.value;
        let load = match self.form {
            Form::Plain => carried.abs(),
            Form::Preload(share) => carried.hypot(share * self.full_n_m),
            Form::Driven(more) if carried * now.speed_rad_s < 0.0 => more * carried.abs(),
            Form::Driven(_) => carried.abs(),
        };
        shaft.rub(self.share * load, self.share * load);
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        // The motor's torque less what turns its own side: J_m (motor - load) / J.
        let motor = (1.0 - self.motor_side) * now.motor_torque_n_m;
        self.carried.follow(motor + self.motor_side * now.blade_torque_n_m, 0.001, step_s);
    }
}
