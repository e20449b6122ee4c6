//! The motor: from what the drive imposes to torque on the shaft, equations (10)-(12).

use crate::parameters::{Parameter as P, Parameters};

/// What the drive imposes on the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Torque on the shaft, N m.
    Torque(f64),
    /// Motor current `im`, A: a current amplifier.
    Current(f64),
    /// Motor voltage `Vm`, V: the winding's inductance is neglected, `im = (Vm - ke Om) / R`.
    Voltage(f64),
}

impl Drive {
    /// The same kind of drive with another value.
    pub fn plus(self, by: f64) -> Self {
        match self {
            Self::Torque(x) => Self::Torque(x + by),
            Self::Current(x) => Self::Current(x + by),
            Self::Voltage(x) => Self::Voltage(x + by),
        }
    }
}

/// Motor and shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Inertia `I` of everything that turns, kg m^2.
    pub inertia_kg_m2: f64,
    /// Torque constant `kt`, N m/A; the back-EMF constant has the same number in V s.
    pub torque_constant_nm_a: f64,
    /// Winding resistance `R`, ohm; only a voltage drive needs it.
    pub winding_resistance_ohm: f64,
    /// Viscous friction `kf`, N m s.
    pub viscous_friction_nm_s: f64,
    /// `1/I`: inner loops do not divide.
    per_inertia: f64,
}

impl Motor {
    /// The motor with these values.
    pub fn new(p: &Parameters) -> Self {
        Self {
            inertia_kg_m2: p.get(P::InertiaKgM2),
            torque_constant_nm_a: p.get(P::TorqueConstantNmA),
            winding_resistance_ohm: p.get(P::WindingResistanceOhm),
            viscous_friction_nm_s: p.get(P::ViscousFrictionNmS),
            per_inertia: 1.0 / p.get(P::InertiaKgM2),
        }
    }

    /// The same motor without friction.
    pub fn frictionless(self) -> Self {
        Self { viscous_friction_nm_s: 0.0, ..self }
    }

    /// Motor current, A, at a shaft speed. A torque is taken as what current makes it.
    pub fn current_a(&self, drive: Drive, shaft_speed_rad_s: f64) -> f64 {
        match drive {
            Drive::Torque(torque) => torque / self.torque_constant_nm_a,
            Drive::Current(current) => current,
            Drive::Voltage(voltage) => {
                (voltage - self.torque_constant_nm_a * shaft_speed_rad_s) / self.winding_resistance_ohm
            }
        }
    }

    /// Torque of drive and friction on the shaft, N m: `kt im - kf Om`.
    #[inline(always)]
    pub fn torque_n_m(&self, drive: Drive, shaft_speed_rad_s: f64) -> f64 {
        let torque = match drive {
            Drive::Torque(torque) => torque,
            other => self.torque_constant_nm_a * self.current_a(other, shaft_speed_rad_s),
        };
        torque - self.viscous_friction_nm_s * shaft_speed_rad_s
    }

    /// `Om'`, rad/s^2, equation (10), against a blade torque, N m.
    #[inline(always)]
    pub fn acceleration(&self, drive: Drive, shaft_speed_rad_s: f64, blade_torque_n_m: f64) -> f64 {
        (self.torque_n_m(drive, shaft_speed_rad_s) - blade_torque_n_m) * self.per_inertia
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voltage_form_has_the_constants_of_equation_12() {
        let motor = Motor {
            inertia_kg_m2: 0.01,
            torque_constant_nm_a: 1.25,
            winding_resistance_ohm: 2.0,
            viscous_friction_nm_s: 0.02,
            per_inertia: 100.0,
        };
        let k1 = (1.25 * 1.25 / 2.0 + 0.02) / 0.01;
        let (k2, k3) = (1.25 / (2.0 * 0.01), 1.0 / 0.01);
        let (speed, voltage, load) = (30.0, 80.0, 4.0);
        let ours = motor.acceleration(Drive::Voltage(voltage), speed, load);
        assert!((ours - (-k1 * speed + k2 * voltage - k3 * load)).abs() < 1e-9);
    }
}
