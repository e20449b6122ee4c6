//! The supply cannot drive the current against the back-EMF.

use super::{Family, current_driven};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Drive, Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["hard", "less with current", "soft at full modulation"],
    anchors: &[Quantity::TorqueConstant],
    fits: current_driven,
    draw,
    ..Family::new("voltage_limit_backemf")
};

enum Form {
    /// |R i + ke v| <= V.
    Hard,
    /// Dead times and switches take a share that grows with current.
    Switches(f64),
    /// Gain goes before the limit is reached.
    Soft(f64),
}

struct Ceiling {
    form: Form,
    loss: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Hard,
        1 => Form::Switches(dice.between(0.02, 0.08)),
        _ => Form::Soft(dice.between(0.05, 0.15)),
    };
    Box::new(Ceiling { form, loss: 0.0 })
}

impl Physics for Ceiling {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn drive(&self, now: &Now, drive: &mut Drive) {
        let machine = now.machine;
        let full = machine.winding_resistance_ohm * now.full.current_a
            + machine.torque_constant_nm_a * now.full.speed_rad_s;
        let limit = full * (1.05 - 0.8 * self.loss);
        drive.voltage_limit_v = drive.voltage_limit_v.min(match self.form {
            Form::Hard => limit,
            Form::Switches(share) => limit * (1.0 - share * now.relative_current().abs()),
            Form::Soft(knee) => {
                let asked = (machine.winding_resistance_ohm * drive.target
                    + machine.torque_constant_nm_a * now.speed_rad_s)
                    .abs();
                let from = limit * (1.0 - knee);
                let over = ((asked - from) / (limit - from)).max(0.0);
                from + (limit - from) * over.tanh().max(if over == 0.0 { 1.0 } else { 0.0 })
            }
        });
    }
}
