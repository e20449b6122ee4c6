//! Dry friction: bearings, seals, brushes.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["coulomb", "stribeck gauss", "tustin", "bristles", "seal rising with speed"],
    fits: any,
    draw,
    ..Family::new("coulomb_friction")
};

enum Form {
    /// F = Fc.
    Plain,
    /// F = Fc + (Fs - Fc) exp(-(v/vs)^2), Armstrong-Helouvry 1994.
    Gauss { rise: f64, speed: f64 },
    /// F = Fc + (Fs - Fc) exp(-|v|/vs), Tustin 1947.
    Tustin { rise: f64, speed: f64 },
    /// Bristles that bend: z' = v - |v| z/g, F = s0 z + s1 z', LuGre (Canudas de Wit 1995).
    Bristles { rise: f64, speed: f64, bend_rad: f64 },
    /// F = Fc (1 + a |v/vmax|^p): a lip seal drags more as it turns faster.
    Seal { more: f64, power: f64 },
}

struct Rub {
    form: Form,
    full_n_m: f64,
    level_n_m: f64,
    bent: f64,
}

fn draw(form: usize, machine: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let (rise, speed) = (dice.between(0.1, 0.8), dice.between(0.01, 0.09) * full.speed_rad_s);
    let form = match form {
        0 => Form::Plain,
        1 => Form::Gauss { rise, speed },
        2 => Form::Tustin { rise, speed },
        3 => Form::Bristles { rise, speed, bend_rad: dice.log_between(2e-3, 2e-2) },
        _ => Form::Seal { more: dice.between(0.1, 0.5), power: dice.between(0.3, 1.0) },
    };
    Box::new(Rub { form, full_n_m: 0.7 * machine.torque_limit_n_m(), level_n_m: 0.0, bent: 0.0 })
}

impl Physics for Rub {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn rest(&mut self) {
        self.bent = 0.0;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let (v, level) = (now.speed_rad_s, self.level_n_m);
        match self.form {
            Form::Plain => shaft.rub(level, level),
            Form::Gauss { rise, speed } => {
                shaft.rub(level * (1.0 + rise * (-(v / speed).powi(2)).exp()), level * (1.0 + rise));
            }
            Form::Tustin { rise, speed } => {
                shaft.rub(level * (1.0 + rise * (-v.abs() / speed).exp()), level * (1.0 + rise));
            }
            Form::Bristles { .. } => shaft.torque_n_m += level * self.bent,
            Form::Seal { more, power } => {
                shaft.rub(level * (1.0 + more * now.relative_speed().abs().powf(power)), level);
            }
        }
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        if let Form::Bristles { rise, speed, bend_rad } = self.form {
            // Bend over its largest, implicit in itself: stable however stiff.
            let v = now.speed_rad_s;
            let most = 1.0 + rise * (-(v / speed).powi(2)).exp();
            self.bent = (self.bent + step_s * v / bend_rad) / (1.0 + step_s * v.abs() / (bend_rad * most));
        }
    }
}
