//! The most that a reading of each signal can be: what is beyond is no reading, but a slip of instrument, wire or unit.

use kort_thruster::rig::Rig;

use crate::water::{Water, full_speed_rad_s};

/// What a force cell may read beyond its stated full scale: with its zero set, and before its converter ends.
const BEYOND_SCALE: f64 = 1.25;
/// Thrust as a multiple of the largest bollard pull, where no full scale is stated. In a crash stop blades take twice the
/// bollard pull, known to a quarter, and a shaft that a stream drives goes half as fast again: 2 x 1.25 x 1.5^2 = 5.6.
const BEYOND_PULL: f64 = 6.0;

/// The most of each signal, by the rig.
#[derive(Clone, Copy, Debug)]
pub struct Plausible {
    thrust_n: f64,
}

impl Plausible {
    /// Of a rig. What a deployment allows is less, and cannot make it wrong.
    pub fn of(rig: &Rig) -> Self {
        let by_cell = rig.sensors.thrust_full_scale_n.map(|scale| BEYOND_SCALE * scale);
        let thrust_n = by_cell.unwrap_or_else(|| {
            let current_a = rig.amplifier.current_limit_a;
            let water = Water::of(rig, current_a, full_speed_rad_s(rig, current_a), None);
            if rig.propeller.is_some() { BEYOND_PULL * water.thrust_full_n() } else { f64::INFINITY }
        });
        Self { thrust_n }
    }

    /// The largest magnitude of a signal in SI. Apart from thrust, what no thruster and no water comes near: within that the
    /// servo's own limits trip.
    pub fn most(&self, signal: &str) -> f64 {
        match signal {
            "thrust_n" => self.thrust_n,
            "current_a" | "supply_v" | "shaft_speed_rad_s" => 1e5,
            "torque_n_m" => 1e6,
            "flow_m_s" | "ambient_m_s" => 100.0,
            "temperature_c" => 1000.0,
            "depth_m" => 12_000.0,
            // An angle grows as long as the shaft turns.
            _ => 1e12,
        }
    }
}
