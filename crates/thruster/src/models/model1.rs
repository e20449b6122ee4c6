//! Model 1, Yoerger, Cooke & Slotine 1990: the shaft speed alone, from an energy balance.
//!
//! Assumes still water, `vp = eta r tan(p) Om`, `vw = vp`, no added mass. The water in the duct
//! is the inertia: the shaft's own does not enter, nor does friction.

use super::{DriveInput, Model};
use crate::blade::BladeLoad;
use crate::motor::Motor;
use crate::parameters::{Parameter as P, Parameters};

/// Equations (7)-(9).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model1 {
    motor: Motor,
    /// `eta r tan(p)`, m: axial flow over shaft speed.
    pub slip_m: f64,
    /// Mass of water in the duct, `rho V`, kg.
    pub duct_mass_kg: f64,
    /// Duct area `a`, m^2.
    pub area_m2: f64,
    density_kg_m3: f64,
}

/// State of a model that knows the shaft alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShaftState {
    /// Shaft speed `Om`, rad/s.
    pub shaft_speed_rad_s: f64,
}

impl From<[f64; 1]> for ShaftState {
    fn from([shaft_speed_rad_s]: [f64; 1]) -> Self {
        Self { shaft_speed_rad_s }
    }
}

impl From<ShaftState> for [f64; 1] {
    fn from(s: ShaftState) -> Self {
        [s.shaft_speed_rad_s]
    }
}

impl Model1 {
    /// The model with these parameters; they must be those of a propeller.
    pub fn new(p: &Parameters) -> Self {
        Self {
            motor: Motor::new(p).frictionless(),
            slip_m: p.get(P::Efficiency) * p.get(P::RadiusM) * p.get(P::PitchRad).tan(),
            duct_mass_kg: p.duct_mass_kg(),
            area_m2: p.area_m2(),
            density_kg_m3: p.get(P::DensityKgM3),
        }
    }
}

impl Model<1> for Model1 {
    type State = ShaftState;
    type Input = DriveInput;

    fn rates(&self, [speed]: &[f64; 1], input: &DriveInput) -> [f64; 1] {
        // (9); with Q/(slip^2 rho V) the inertia is that of the water in the duct.
        let torque = self.motor.torque_n_m(input.drive, *speed);
        let volume = self.duct_mass_kg / self.density_kg_m3;
        [torque / (self.slip_m * self.slip_m * self.duct_mass_kg)
            - self.slip_m * self.area_m2 / (2.0 * volume) * speed * speed.abs()]
    }

    fn load(&self, state: ShaftState, _: &DriveInput) -> BladeLoad {
        let speed = state.shaft_speed_rad_s;
        // (7), and (8) at the fixed point of (9): Q = T slip / 2.
        let thrust_n = self.density_kg_m3 * self.area_m2 * self.slip_m * self.slip_m * speed * speed.abs();
        BladeLoad { thrust_n, torque_n_m: 0.5 * self.slip_m * thrust_n }
    }

    fn rough_steady_state(&self, input: &DriveInput) -> [f64; 1] {
        [rough_speed(
            self.motor.torque_n_m(input.drive, 0.0),
            0.5 * self.density_kg_m3 * self.area_m2 * self.slip_m.powi(3),
        )]
    }
}

/// Speed at which a square-law load takes a torque.
pub(super) fn rough_speed(torque_n_m: f64, load_nm_s2: f64) -> f64 {
    torque_n_m.signum() * (torque_n_m.abs() / load_nm_s2).sqrt()
}
