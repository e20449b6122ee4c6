//! What else hangs on the shaft, as torque and inertia.

use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;
use crate::rig::{Load, Rig};

/// Gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;

/// Inertia that the stated load adds to the shaft's, kg m^2.
pub fn load_inertia_kg_m2(rig: &Rig) -> f64 {
    Hanging::new(&rig.load, &Parameters::stated(rig)).inertia_kg_m2
}

/// The load at work: its torque is the sum of what each kind makes.
#[derive(Clone, Copy)]
pub(super) struct Hanging<T> {
    /// Inertia that turns with the shaft, kg m^2.
    pub(super) inertia_kg_m2: T,
    /// Against the sine of the shaft angle, N m.
    swing_n_m: T,
    /// Against the shaft, whatever it does, N m.
    weight_n_m: T,
    /// Against the square of the speed, N m s^2.
    fan_nm_s2: T,
    /// Whether there is any torque.
    pub(super) pulls: bool,
}

impl<T: Real> Hanging<T> {
    /// The rig's kind of load with the plant's parameters.
    pub(super) fn new(load: &Load, p: &Parameters<T>) -> Self {
        let none = Self {
            inertia_kg_m2: T::ZERO,
            swing_n_m: T::ZERO,
            weight_n_m: T::ZERO,
            fan_nm_s2: T::ZERO,
            pulls: true,
        };
        let mass = p.get(P::LoadMassKg);
        match load {
            Load::None => Self { pulls: false, ..none },
            Load::Pendulum { .. } => {
                let length = p.get(P::LoadLengthM);
                let swing_n_m = mass * length * GRAVITY_M_S2;
                Self { inertia_kg_m2: mass * length * length, swing_n_m, ..none }
            }
            // The twist is the flexible coupling's; both inertias turn together.
            Load::TwoMass { .. } => Self { inertia_kg_m2: p.get(P::LoadInertiaKgM2), pulls: false, ..none },
            Load::Fan { .. } => Self { fan_nm_s2: p.get(P::FanCoefficientNmS2), ..none },
            Load::Slide { lead_m_rev, incline_rad, .. } => {
                let lead_m_rad = lead_m_rev.value / std::f64::consts::TAU;
                let lift = GRAVITY_M_S2 * incline_rad.value.sin() * lead_m_rad;
                Self { inertia_kg_m2: mass * (lead_m_rad * lead_m_rad), weight_n_m: mass * lift, ..none }
            }
        }
    }

    /// Torque on the shaft, N m; positive accelerates ahead.
    #[inline(always)]
    pub(super) fn torque_n_m(&self, angle_rad: T, speed_rad_s: T) -> T {
        -(self.swing_n_m * angle_rad.sin_cos().0)
            - self.weight_n_m
            - self.fan_nm_s2 * speed_rad_s * speed_rad_s.abs()
    }
}
