//! An ideal propeller: momentum theory of the actuator disc (Rankine, Froude), the least power that a
//! thrust can cost. What a law is charged beside it is its inverse figure of merit.

use kort_thruster::rig::Rig;

/// The disc of a propeller.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    density_area_kg_m: f64,
}

impl Disc {
    /// The rig's disc; one without a propeller has none and needs no power.
    pub fn of(rig: &Rig) -> Self {
        Self { density_area_kg_m: rig.blade().map_or(0.0, |b| b.density_kg_m3 * b.area_m2()) }
    }

    /// Least power for a thrust, W, in an ambient flow that is positive along the thrust's own jet:
    /// `P = T (U/2 + sqrt(U^2/4 + T/(2 rho A)))`.
    pub fn power_w(&self, thrust_n: f64, ambient_m_s: f64) -> f64 {
        if self.density_area_kg_m <= 0.0 {
            return 0.0;
        }
        let half = 0.5 * ambient_m_s;
        thrust_n * (half + (half * half + 0.5 * thrust_n / self.density_area_kg_m).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ideal_disc_has_the_limits_of_momentum_theory() {
        let disc = Disc { density_area_kg_m: 53.0 };
        // Very fast water: power is thrust times speed.
        assert!((disc.power_w(10.0, 100.0) / 1000.0 - 1.0).abs() < 1e-3);
        assert!(disc.power_w(10.0, 1.0) > disc.power_w(10.0, 0.0));
        assert!(disc.power_w(10.0, -1.0) > 0.0);
    }
}
