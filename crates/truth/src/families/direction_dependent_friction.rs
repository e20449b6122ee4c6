//! Screws, seals and gears that rub more one way than the other.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["dry and viscous", "dry, with a rise at rest", "lip seal"],
    // Dry friction that differs by direction alone is a mean and a bias; the part that grows with speed is not.
    same_sets: &[&["coulomb_friction", "torque_channel_bias"]],
    fits: any,
    draw,
    ..Family::new("direction_dependent_friction")
};

enum Form {
    /// tc and kf of each way.
    Both { viscous: [f64; 2] },
    /// tc of each way, more at rest.
    Rising { rise: f64, speed: f64 },
    /// tc (1 + a |v|^p) one way, tc the other.
    Lip { more: f64, power: f64 },
}

struct Ways {
    form: Form,
    /// Ahead and astern, mean one.
    ways: [f64; 2],
    full_n_m: f64,
    level_n_m: f64,
}

fn draw(form: usize, machine: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let apart = dice.side() * dice.between(0.1, 0.45);
    let form = match form {
        0 => {
            let mean = dice.between(0.4, 1.2);
            let apart = apart.signum() * dice.between(0.2, 0.6);
            Form::Both { viscous: [mean * (1.0 + apart), mean * (1.0 - apart)] }
        }
        1 => Form::Rising { rise: dice.between(0.1, 0.6), speed: dice.between(0.02, 0.08) * full.speed_rad_s },
        _ => Form::Lip { more: dice.between(0.5, 1.2), power: dice.between(0.4, 1.0) },
    };
    Box::new(Ways {
        form,
        ways: [1.0 + apart, 1.0 - apart],
        full_n_m: 0.6 * machine.torque_limit_n_m(),
        level_n_m: 0.0,
    })
}

impl Physics for Ways {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let v = now.relative_speed().abs();
        let way = usize::from(now.speed_rad_s < 0.0);
        let more = match self.form {
            Form::Both { viscous } => [viscous[0] * v, viscous[1] * v],
            Form::Rising { rise, speed } => [rise * (-(now.speed_rad_s / speed).powi(2)).exp(); 2],
            Form::Lip { more, power } => {
                let turned = more * v.powf(power);
                if self.ways[0] > self.ways[1] { [turned, 0.0] } else { [0.0, turned] }
            }
        };
        for ((dry, ratio), more) in shaft.dry_n_m.iter_mut().zip(self.ways).zip(more) {
            *dry += self.level_n_m * (ratio + more);
        }
        shaft.breakaway_n_m += self.level_n_m * (self.ways[way] + if v == 0.0 { more[way] } else { 0.0 });
    }
}
