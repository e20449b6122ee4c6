//! Torque control.
//!
//! Reference: Smogeli 2006; docs/control.md D6: `Qr = (KQ0 / KT0) D Tr`, here with the rig's own static
//! map in place of the open-water coefficients, plus friction at the measured speed.
//!
//! Assumes: torque per thrust is nearly constant, which holds under varying inflow much better
//! than thrust per speed squared. Needs measured: shaft speed, for friction only.
//!
//! Fails: rise time is the bare plant's; friction and torque-constant errors are thrust errors;
//! runs away in ventilation, nothing holds the speed.

use super::{Demand, LawInput};
use crate::limits::LimitSet;

/// The law has no state.
#[derive(Clone, Copy, Debug)]
pub struct TorqueControl;

impl TorqueControl {
    /// Torque that the thrust costs in still water, and friction as the shaft turns now.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let map = &input.model.map;
        let torque =
            map.torque_for_thrust_n_m(input.thrust_n) + input.model.friction_n_m(input.speed_rad_s());
        Demand {
            torque_n_m: torque,
            speed_rad_s: map.speed_rad_s(input.thrust_n),
            limits: LimitSet::default(),
        }
    }

    /// Nothing to follow.
    pub fn settle(&mut self, _applied_n_m: f64, _dt_s: f64) {}
}
