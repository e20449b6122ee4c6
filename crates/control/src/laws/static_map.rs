//! Static inversion: constant torque from the bollard map, no feedback.
//!
//! Reference: (19), (20) of Whitcomb & Yoerger; docs/control.md D1. `tau = Td / 16.1` on the stand,
//! plus the friction known at the speed the map expects.
//!
//! Assumes: still water, steady state, known torque constant. Needs measured: nothing.
//!
//! Fails: thrust rises only as fast as the bare shaft and water do (0.23 s on the stand, slower at
//! low thrust); ambient flow shifts thrust per torque; unknown friction is lost
//! thrust; runs away when the blades ventilate.

use super::{Demand, LawInput};
use crate::limits::LimitSet;

/// The law has no state.
#[derive(Clone, Copy, Debug)]
pub struct StaticMapLaw;

impl StaticMapLaw {
    /// Torque of the map.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let map = &input.model.map;
        let speed = map.speed_rad_s(input.thrust_n);
        let torque = map.torque_for_thrust_n_m(input.thrust_n) + input.model.friction_n_m(speed);
        Demand { torque_n_m: torque, speed_rad_s: speed, limits: LimitSet::default() }
    }

    /// Nothing to follow.
    pub fn settle(&mut self, _applied_n_m: f64, _dt_s: f64) {}
}
