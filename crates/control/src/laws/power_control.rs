//! Power control.
//!
//! Reference: Smogeli 2006; docs/control.md D6: `Pr ~ |Tr|^1.5`, `Qp = Pr / |Om|`, with the rig's static
//! map in place of the open-water coefficients.
//!
//! Assumes: the shaft turns; power per thrust is the still-water one.
//! Needs measured: shaft speed.
//!
//! Fails: singular at standstill, so from there up to two thirds of the expected speed the static
//! torque is raised in a straight line, to one and a half times at most; a shaft that turns against
//! the reference is braked with the static torque. Still races in ventilation, if less.

use super::{Demand, LawInput};
use crate::limits::LimitSet;

/// The law has no state.
#[derive(Clone, Copy, Debug)]
pub struct PowerControl;

/// Torque, N m, that spends the still-water power of a thrust at a shaft speed.
pub(super) fn power_torque_n_m(thrust_n: f64, speed_rad_s: f64, input: &LawInput) -> f64 {
    let map = &input.model.map;
    let (expected, torque) = (map.speed_rad_s(thrust_n), map.torque_for_thrust_n_m(thrust_n));
    // Speed in the reference's direction, as a share of the expected one.
    let share = if expected == 0.0 { 0.0 } else { speed_rad_s / expected };
    if share <= 0.0 { torque } else { torque * (1.0 / share).min(1.0 + 0.75 * share) }
}

impl PowerControl {
    /// Torque of the power reference, and friction as the shaft turns now.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let speed = input.speed_rad_s();
        let torque = power_torque_n_m(input.thrust_n, speed, input) + input.model.friction_n_m(speed);
        let target = input.model.map.speed_rad_s(input.thrust_n);
        Demand { torque_n_m: torque, speed_rad_s: target, limits: LimitSet::default() }
    }

    /// Nothing to follow.
    pub fn settle(&mut self, _applied_n_m: f64, _dt_s: f64) {}
}
