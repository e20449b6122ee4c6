//! An encoder off its centre.

use std::f64::consts::TAU;

use super::{Family, encoder};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["once a turn", "twice a turn", "both"],
    fits: encoder,
    draw,
    ..Family::new("encoder_eccentricity")
};

struct Wobble {
    /// Order, share, phase.
    orders: Vec<(f64, f64, f64)>,
    error_rad: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let mut order = |order: f64, share: f64| (order, share, dice.between(0.0, TAU));
    let orders = match form {
        0 => vec![order(1.0, 1.0)],
        1 => vec![order(2.0, 0.6)],
        _ => vec![order(1.0, 0.8), order(2.0, 0.3)],
    };
    Box::new(Wobble { orders, error_rad: 0.0 })
}

impl Physics for Wobble {
    fn set(&mut self, strength: f64) {
        self.error_rad = 0.6 * strength;
    }

    fn encoder(&mut self, now: &Now, angle_rad: &mut f64) {
        let q = now.angle_rad;
        *angle_rad += self.error_rad
            * self
                .orders
                .iter()
                .map(|(order, share, phase)| share * ((order * q + phase).cos() - phase.cos()))
                .sum::<f64>();
    }

}
