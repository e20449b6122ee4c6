//! How far what is logged may lie from its stamp.

use kort_thruster::rig::Rig;

/// How far an instant may lie from its stamp, s. Sensors, controller and logger take turns within a control period,
/// and nobody writes down in which order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain {
    /// A sample: the stated control period, a step of the simulation where none is stated.
    pub sample_s: f64,
    /// A command: the same; where no control period is stated, commands that are held from row to row and those that
    /// run straight lie half an interval apart, and what is between the two a quarter from either.
    pub command_s: f64,
}

impl Grain {
    pub(super) fn new(rig: &Rig, row_s: f64, tick_s: f64) -> Self {
        let stated_s = rig.sensors.control_rate_hz.map(|rate_hz| (1.0 / rate_hz).min(row_s));
        Self { sample_s: stated_s.unwrap_or(tick_s), command_s: stated_s.unwrap_or(tick_s.max(0.25 * row_s)) }
    }
}
