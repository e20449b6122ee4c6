//! Torque that varies with the angle of the rotor.

use std::cell::Cell;

use nalgebra::Complex;

use super::{Available, Context, Descriptor, Effect, Hooks, Path, Scale, Spec, angle_known, free_shaft};
use crate::plant::{Balance, Local};
use crate::real::Real;
use crate::rig::Rig;

/// Orders of shaft angle at once.
pub const ORDERS: usize = 6;
/// Values of one order: itself, cogging by sine and cosine, ripple by sine and cosine.
const EACH: usize = 5;

/// One order's cogging; its ripple too; then those of several orders.
const FORMS: &[&[usize]] = &[
    &[1, 2],
    &[1, 2, 3, 4],
    &[1, 2, 6, 7],
    &[1, 2, 6, 7, 11, 12],
    &[1, 2, 6, 7, 11, 12, 16, 17],
    &[1, 2, 6, 7, 11, 12, 16, 17, 21, 22],
    &[1, 2, 6, 7, 11, 12, 16, 17, 21, 22, 26, 27],
];

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "torque_ripple_cogging",
    path: Path::Drive,
    what: "magnets and slots make torque vary with rotor angle: cogging (always there) and ripple (in proportion to current); at order 1 \
           also a weight off the axis of a level shaft, which a rig states as [load]",
    equation: "tau += sum over up to six whole orders k of (As + Bs im) sin(k q) + (Ac + Bc im) cos(k q); A [N m], B [N m/A], q \
               shaft angle [rad]",
    signature: "lines at orders of shaft angle in speed and torque, their frequency follows the shaft; largest at creep speed",
    confused_with: &["encoder_eccentricity", "coulomb_friction", "position_dependent_friction"],
    separated_by: "a slow creep over full turns, averaged over angle; cogging stays with the current off; a resolver's \
                   error shows in speed but not in thrust",
    reference: "Jahns & Soong 1996 (IEEE Trans. Ind. Electron. 43:321)",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: FORMS,
    parameters,
    starts,
    needs,
    build: both!(build),
};

/// Waves of an order that the shaft must turn through to show that they come again.
const WAVES: f64 = 2.0;

/// Names of one order's values.
macro_rules! names {
    ($($n:literal)*) => {
        [$([
            concat!("order_", $n),
            concat!("cogging_sin_", $n, "_n_m"),
            concat!("cogging_cos_", $n, "_n_m"),
            concat!("ripple_sin_", $n, "_nm_a"),
            concat!("ripple_cos_", $n, "_nm_a"),
        ]),*]
    };
}
const NAMES: [[&str; EACH]; ORDERS] = names!(1 2 3 4 5 6);
/// Orders where none are told: what misalignment, poles, slots and their common multiples give.
const USUAL: [f64; ORDERS] = [6.0, 12.0, 24.0, 36.0, 2.0, 4.0];

fn parameters(scale: &Scale) -> Vec<Spec> {
    let (torque, per_a) = (scale.torque_n_m, scale.torque_n_m / scale.current_a);
    let cogging =
        |name| Spec::strength(name, "N m", 0.02 * torque, -0.5 * torque, 0.5 * torque).sigma(0.04 * torque);
    let ripple =
        |name| Spec::strength(name, "N m/A", 0.02 * per_a, -0.5 * per_a, 0.5 * per_a).sigma(0.04 * per_a);
    let order = |place: usize, [order, sin, cos, ripple_sin, ripple_cos]: [&'static str; EACH]| {
        let parts = [cogging(sin), cogging(cos), ripple(ripple_sin), ripple(ripple_cos)];
        // A fit frees the orders beyond the first only in a form that lists them.
        let parts = parts.map(|s| if place == 0 { s } else { Spec { start: 0.0, held: true, ..s } });
        std::iter::once(Spec::held(order, "1", USUAL[place], 1.0, 720.0)).chain(parts)
    };
    NAMES.into_iter().enumerate().flat_map(|(place, names)| order(place, names)).collect()
}

/// One start a first order: what an eccentric rotor and misalignment give, the poles, the slots, six times the pole pairs, and the
/// least common multiple of slots and poles of common windings. Nothing acts at the other orders. Of one that the shaft never
/// turns through two waves nothing tells that it comes again: several such bend to any curve over the angle, as a weight, a spring
/// or a stop makes.
fn starts(scale: &Scale) -> Vec<Vec<f64>> {
    let (torque, per_a) = (0.02 * scale.torque_n_m, 0.02 * scale.torque_n_m / scale.current_a);
    [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 18, 21, 24, 30, 36, 42, 48, 60, 72, 84]
        .iter()
        .filter(|order| come_again(&[f64::from(**order)], scale.turned_rad))
        .map(|order| {
            let mut values = vec![f64::from(*order), torque, torque, per_a, per_a];
            USUAL[1..].iter().for_each(|usual| values.extend([*usual, 0.0, 0.0, 0.0, 0.0]));
            values
        })
        .collect()
}

/// Whether a shaft that turns so far, rad, meets what these orders make together often enough to show that it comes again: once
/// in a wave of the greatest order that divides them all.
pub fn come_again(orders: &[f64], turned_rad: f64) -> bool {
    let divisor = |a: u32, b: u32| {
        let (mut a, mut b) = (a, b);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let common = orders.iter().map(|order| order.round() as u32).fold(0, divisor);
    f64::from(common) * turned_rad >= WAVES * std::f64::consts::TAU
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    angle_known(rig, available)
}

/// Orders at which nothing acts, and nothing is asked how it would, are left out.
fn build<T: Real>(values: &[T], _: &Context<T>) -> Box<dyn Effect<T>> {
    let nothing = |v: &T| *v == T::ZERO && v.same_slopes(T::ZERO);
    let orders = values
        .chunks_exact(EACH)
        .filter(|v| !v[1..].iter().all(nothing))
        .map(|v| Order {
            order: v[0].re().round() as i32,
            cogging_n_m: [v[1], v[2]],
            ripple_nm_a: [v[3], v[4]],
        })
        .collect();
    Box::new(TorqueRipple { orders, turned: Cell::default() })
}

struct Order<T> {
    order: i32,
    cogging_n_m: [T; 2],
    ripple_nm_a: [T; 2],
}

struct TorqueRipple<T> {
    orders: Vec<Order<T>>,
    /// Where the shaft was when last asked: two stages of a step in three ask where the one before did.
    turned: Cell<Turned>,
}

/// A shaft angle with sine and cosine of each order's multiple of it.
#[derive(Clone, Copy, Default)]
struct Turned {
    angle_rad: Option<f64>,
    multiples: [Complex<f64>; ORDERS],
}

impl<T: Real> TorqueRipple<T> {
    /// `exp(i k q)` for every order k: one sine and cosine, and powers of it.
    fn turned(&self, angle_rad: f64) -> [Complex<f64>; ORDERS] {
        let mut turned = self.turned.get();
        if turned.angle_rad != Some(angle_rad) {
            turned.angle_rad = Some(angle_rad);
            let once = Complex::cis(angle_rad);
            for (multiple, order) in turned.multiples.iter_mut().zip(&self.orders) {
                *multiple = once.powi(order.order);
            }
            self.turned.set(turned);
        }
        turned.multiples
    }
}

impl<T: Real> Effect<T> for TorqueRipple<T> {
    fn brisk(&self) -> bool {
        true
    }

    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let angle = at.shaft_angle_rad;
        for (order, multiple) in self.orders.iter().zip(self.turned(angle.re())) {
            let turns = angle * f64::from(order.order);
            let (sin, cos) = (turns.chain(multiple.im, multiple.re), turns.chain(multiple.re, -multiple.im));
            let amplitude = |i: usize| order.cogging_n_m[i] + order.ripple_nm_a[i] * at.current_a;
            balance.shaft_torque_n_m += amplitude(0) * sin + amplitude(1) * cos;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::come_again;

    #[test]
    fn orders_come_again_together_once_in_the_wave_of_their_common_divisor() {
        let turn = std::f64::consts::TAU;
        assert!(come_again(&[12.0], 0.2 * turn) && !come_again(&[12.0], 0.15 * turn));
        assert!(come_again(&[12.0, 72.0, 18.0], 0.4 * turn), "six times a turn");
        assert!(!come_again(&[6.0, 7.0], 1.9 * turn) && come_again(&[6.0, 7.0], 2.0 * turn));
    }
}
