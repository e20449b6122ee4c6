//! Momentum of the water in the duct, equation (6) with ambient flow (6a).

use crate::parameters::{Parameter as P, Parameters};

/// `T = m vp' + dbeta rho a (vp - va)|vp|`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Momentum {
    /// Accelerated mass `m = rho a l gamma`, kg.
    pub added_mass_kg: f64,
    /// `dbeta rho a`, kg/m.
    pub flux_kg_m: f64,
    /// `1/m`: inner loops do not divide.
    per_kg: f64,
}

impl Momentum {
    /// The duct with these values.
    pub fn new(p: &Parameters) -> Self {
        let added_mass_kg = p.duct_mass_kg() * p.get(P::AddedMassCoefficient);
        Self {
            added_mass_kg,
            flux_kg_m: p.get(P::FluxCoefficient) * p.get(P::DensityKgM3) * p.area_m2(),
            per_kg: 1.0 / added_mass_kg,
        }
    }

    /// Thrust that a steady axial flow carries away, N.
    #[inline(always)]
    pub fn flux_n(&self, axial_m_s: f64, ambient_m_s: f64) -> f64 {
        self.flux_kg_m * (axial_m_s - ambient_m_s) * axial_m_s.abs()
    }

    /// `vp'`, m/s^2, under a thrust, N; flows in m/s, positive ahead.
    #[inline(always)]
    pub fn acceleration(&self, thrust_n: f64, axial_m_s: f64, ambient_m_s: f64) -> f64 {
        (thrust_n - self.flux_n(axial_m_s, ambient_m_s)) * self.per_kg
    }
}
