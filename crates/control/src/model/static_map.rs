//! The bollard steady state as a map, and how it is solved for.

use super::ControlModel;

/// Static map of the bollard steady state: thrust and torque over shaft speed squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticMap {
    /// `T / Om|Om|`, N s^2.
    pub thrust_n_s2: f64,
    /// `Q / Om|Om|`, N m s^2.
    pub torque_n_m_s2: f64,
    /// `vp / Om`, m.
    pub flow_m: f64,
    /// The three turning astern as multiples of those ahead: 1 unless the rig is known to differ.
    pub astern: [f64; 3],
}

impl StaticMap {
    /// A multiple of one side: of thrust (0), torque (1) or flow (2), by the sign of thrust or speed.
    fn side(&self, of: usize, sign: f64) -> f64 {
        if sign < 0.0 { self.astern[of] } else { 1.0 }
    }

    /// Torque of the blades at a shaft speed in still water, N m.
    pub fn torque_n_m(&self, speed_rad_s: f64) -> f64 {
        self.torque_n_m_s2 * self.side(1, speed_rad_s) * speed_rad_s * speed_rad_s.abs()
    }

    /// Axial flow at a shaft speed in still water, m/s.
    pub fn flow_m_s(&self, speed_rad_s: f64) -> f64 {
        self.flow_m * self.side(2, speed_rad_s) * speed_rad_s
    }

    /// Shaft speed that gives a thrust in still water, rad/s.
    pub fn speed_rad_s(&self, thrust_n: f64) -> f64 {
        (thrust_n.abs() / (self.thrust_n_s2 * self.side(0, thrust_n))).sqrt().copysign(thrust_n)
    }

    /// Thrust that a shaft speed gives in still water, N.
    pub fn thrust_n(&self, speed_rad_s: f64) -> f64 {
        self.thrust_n_s2 * self.side(0, speed_rad_s) * speed_rad_s * speed_rad_s.abs()
    }

    /// Torque a thrust costs in still water, N m: (20) of the paper, whatever the level.
    pub fn torque_for_thrust_n_m(&self, thrust_n: f64) -> f64 {
        thrust_n * self.torque_n_m_s2 * self.side(1, thrust_n) / (self.thrust_n_s2 * self.side(0, thrust_n))
    }
}

impl ControlModel {
    /// Steady state in still water, ahead and astern.
    pub(super) fn solve_static_map(&self) -> StaticMap {
        let ahead = self.solve_side(1.0);
        if self.foil.is_none() && self.flux_astern == 1.0 {
            return ahead;
        }
        let astern = self.solve_side(-1.0);
        StaticMap {
            astern: [
                astern.thrust_n_s2 / ahead.thrust_n_s2,
                astern.torque_n_m_s2 / ahead.torque_n_m_s2,
                astern.flow_m / ahead.flow_m,
            ],
            ..ahead
        }
    }

    /// One side of it. Everything is quadratic in speed, so one ratio `vp / ut` (and
    /// one of swirl) holds at every level; found by bisection between no flow and the pitch angle.
    fn solve_side(&self, side: f64) -> StaticMap {
        let lever = self.blade.lever_m();
        let flux = self.flux_kg_m(side);
        let surplus = |ratio: f64| {
            let swirl = self.steady_swirl(side, side * ratio);
            let load = self.row_load(side - swirl, side * ratio);
            (side * load.thrust_n - flux * ratio * ratio, load)
        };
        let (mut low, mut high) = (0.0, self.blade.pitch_rad.tan());
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if surplus(middle).0 > 0.0 { low = middle } else { high = middle }
        }
        let ratio = 0.5 * (low + high);
        let load = surplus(ratio).1;
        StaticMap {
            thrust_n_s2: (side * load.thrust_n * lever * lever).max(1e-12),
            torque_n_m_s2: (side * load.torque_n_m * lever * lever).max(1e-15),
            flow_m: ratio * lever,
            astern: [1.0; 3],
        }
    }
}
