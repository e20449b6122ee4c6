//! Model 1 (Yoerger) inverted.
//!
//! Reference: Yoerger, Cooke & Slotine 1990; (7)-(9) of Whitcomb & Yoerger; docs/control.md D3:
//! `tau = (1/2) eta r tan(p) Td + Omr' / beta`, `beta = 1 / (eta^2 r^2 tan^2(p) rho V)`.
//!
//! No single `eta` serves both terms: on the paper's stand (18) asks for 0.49, (20) for 2.31, and
//! with the first the law gives a fifth of the torque. Here the level takes the `eta` of torque per
//! thrust (20), the derivative that of thrust per speed squared (18).
//!
//! Assumes: the water moves with the blades (no flow state), quasi-static.
//! Needs measured: nothing.
//!
//! Fails: no flow transient, so no overshoot is foreseen or prevented; the shaft's own inertia is
//! not in the model; all that fails in `static_map` fails here.

use super::{Demand, LawInput};
use crate::limits::LimitSet;
use crate::model::ControlModel;

/// A running Model 1 inversion.
#[derive(Clone, Copy, Debug)]
pub struct Model1Inversion {
    smoothing_s: f64,
    /// From where the shaft is at the first tick.
    speed_rad_s: Option<f64>,
}

impl Model1Inversion {
    /// At rest. The reference's derivative is taken over the shaft loop's own time scale.
    pub fn new(model: &ControlModel) -> Self {
        let (crossover, _) = model.speed_loop(56f64.to_radians());
        Self { smoothing_s: 1.0 / crossover, speed_rad_s: None }
    }

    /// Torque of the inverted model.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let blade = &input.model.blade;
        let advance = blade.radius_m * blade.pitch_rad.tan();
        let eta = (input.model.map.thrust_n_s2 / (blade.density_kg_m3 * blade.area_m2())).sqrt() / advance;
        let target = input.model.map.speed_rad_s(input.thrust_n);
        let before = self.speed_rad_s.unwrap_or_else(|| input.speed_rad_s());
        let rate = (target - before) / (self.smoothing_s + input.dt_s);
        let speed = before + rate * input.dt_s;
        self.speed_rad_s = Some(speed);
        let inertia = (eta * advance).powi(2) * input.model.duct_water_kg;
        // (1/2) eta r tan(p) with the eta of (20) is the static map's torque per thrust.
        let torque = input.model.map.torque_for_thrust_n_m(input.thrust_n)
            + inertia * rate
            + input.model.friction_n_m(speed);
        Demand { torque_n_m: torque, speed_rad_s: speed, limits: LimitSet::default() }
    }

    /// Nothing to follow.
    pub fn settle(&mut self, _applied_n_m: f64, _dt_s: f64) {}
}
