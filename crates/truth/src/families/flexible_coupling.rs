//! A belt, a long shaft, a magnetic coupling between motor and load.

use super::{Family, belt};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Link, Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["linear", "hardening", "magnetic"],
    anchors: &[Quantity::Inertia, Quantity::TorqueConstant],
    fits: belt,
    draw,
    ..Family::new("flexible_coupling")
};

enum Form {
    /// k d + c d'.
    Linear,
    /// k d (1 + (d/d0)^2) + c d': rubber.
    Hardening(f64),
    /// k d0 sin(d/d0) + c d': poles that face each other.
    Magnetic(f64),
}

/// Resonances between which it lies: 120 Hz and 1.2 Hz.
const STIFF_RAD_S: f64 = 754.0;
const SOFT_RAD_S: f64 = 7.5;

/// Resonance falls from stiff (not seen) to soft as the strength grows.
struct Coupling {
    form: Form,
    far_share: f64,
    damping: f64,
    /// Whether the encoder turns with the far side; a tachometer stays on the motor.
    read_far: bool,
    far_kg_m2: f64,
    natural_rad_s: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let far_share = dice.between(0.3, 0.75);
    // A twist that the torque at the limit makes at some hertz.
    let twist = machine.torque_limit_n_m() / (machine.inertia_kg_m2 * 400.0);
    let form = match form {
        0 => Form::Linear,
        1 => Form::Hardening(twist * dice.between(0.5, 2.0)),
        _ => Form::Magnetic(twist * dice.between(3.0, 6.0)),
    };
    Box::new(Coupling {
        form,
        far_share,
        damping: dice.between(0.03, 0.25),
        read_far: machine.sensors.tachometer_noise == 0.0 && dice.chance(0.4),
        far_kg_m2: machine.inertia_kg_m2 * far_share,
        natural_rad_s: STIFF_RAD_S,
    })
}

impl Physics for Coupling {
    fn set(&mut self, strength: f64) {
        let way = (1.0 + 0.25 * strength.max(1e-9).log10()).clamp(0.0, 1.0);
        self.natural_rad_s = STIFF_RAD_S * (SOFT_RAD_S / STIFF_RAD_S).powf(way);
    }

    fn link(&self, _: &Now, twist: f64, slip: f64) -> Option<Link> {
        let reduced = self.far_kg_m2 * (1.0 - self.far_share);
        let stiffness = reduced * self.natural_rad_s.powi(2);
        let spring = match self.form {
            Form::Linear => twist,
            Form::Hardening(scale) => twist * (1.0 + (twist / scale).powi(2).min(4.0)),
            Form::Magnetic(scale) => scale * (twist / scale).clamp(-1.5, 1.5).sin(),
        };
        let damper = 2.0 * self.damping * self.natural_rad_s * reduced;
        Some(Link { far_share: self.far_share, torque_n_m: stiffness * spring + damper * slip })
    }

    fn encoder(&mut self, now: &Now, angle_rad: &mut f64) {
        if self.read_far {
            *angle_rad -= now.twist_rad;
        }
    }

    fn quick(&self) -> bool {
        self.natural_rad_s > 200.0
    }
}
