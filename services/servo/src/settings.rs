//! The servo's settings: what `kort.toml` says, with what it leaves out taken from the rig.

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;
use serde::Deserialize;

use crate::direction::Shaft;
use crate::drives::kind_of;
use crate::water::Water;

/// Ticks without a needed reading that trip where every tick has one.
const MISSING_TICKS: u32 = 3;

/// Section `limits` as written.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct LimitKeys {
    current_a: Option<f64>,
    trip_current_a: Option<f64>,
    continuous_current_a: Option<f64>,
    thermal_time_constant_s: Option<f64>,
    speed_rad_s: Option<f64>,
    trip_speed_rad_s: Option<f64>,
    full_drive_s: Option<f64>,
    supply_low_v: Option<f64>,
    supply_high_v: Option<f64>,
    temperature_c: Option<f64>,
}

impl LimitKeys {
    /// Bounds that contradict each other: which keys, and the words from the first one on. What is not written is named as
    /// what stands in its place.
    fn crossed(&self, rig_current_a: f64) -> Vec<([&'static str; 2], String)> {
        let mut crossed = Vec::new();
        let current_a = self.current_a.unwrap_or(rig_current_a);
        if let Some(trip) = self.trip_current_a.filter(|trip| *trip < current_a) {
            let whose =
                if self.current_a.is_none() { ", which is amplifier.current_limit_a of the rig" } else { "" };
            crossed.push((
                ["limits.trip_current_a", "limits.current_a"],
                format!(
                    "limits.trip_current_a` = {trip} is below current_a = {current_a}{whose}\nhint: 1.25 times current_a"
                ),
            ));
        }
        if let Some(trip) = self.trip_speed_rad_s {
            let words = match self.speed_rad_s {
                Some(speed) if trip < speed => Some(format!(
                    "limits.trip_speed_rad_s` = {trip} is below speed_rad_s = {speed}\nhint: 1.15 times speed_rad_s"
                )),
                None => Some(format!(
                    "limits.trip_speed_rad_s` = {trip}, but speed_rad_s is not stated, and by default no speed is its largest: it would trip before any drive is taken away\nhint: state speed_rad_s too, at most {trip}; 1.15 times that is trip_speed_rad_s where it is left out"
                )),
                _ => None,
            };
            crossed.extend(words.map(|words| (["limits.trip_speed_rad_s", "limits.speed_rad_s"], words)));
        }
        if let (Some(low), Some(high)) = (self.supply_low_v, self.supply_high_v)
            && low >= high
        {
            crossed.push((
                ["limits.supply_low_v", "limits.supply_high_v"],
                format!(
                    "limits.supply_low_v` = {low} is not below supply_high_v = {high}\nhint: the band around the supply's nominal voltage"
                ),
            ));
        }
        crossed
    }
}

/// Section `checks` as written.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct CheckKeys {
    frozen_s: Option<f64>,
    spike_rad_s: Option<f64>,
    inflow_m_s: Option<f64>,
}

/// Limits and checks in force; every value finite or plus infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Unit of the drive.
    pub kind: DriveKind,
    /// Largest drive, in the unit of the drive.
    pub drive_max: f64,
    /// Largest motor current, A.
    pub current_a: f64,
    /// Measured current that trips, A.
    pub trip_current_a: f64,
    /// Current the motor bears for ever, A.
    pub continuous_current_a: f64,
    /// Time constant of the I2t budget, s.
    pub thermal_time_constant_s: f64,
    /// Shaft speed from which drive is taken away, rad/s.
    pub speed_rad_s: f64,
    /// Measured shaft speed that trips, rad/s.
    pub trip_speed_rad_s: f64,
    /// Shortest time from zero to full drive, s.
    pub full_drive_s: f64,
    /// Band of the supply, V.
    pub supply_v: (f64, f64),
    /// Motor temperature that trips, deg C.
    pub temperature_c: f64,
    /// Ticks without a reading of current or shaft speed that trip.
    pub missing_ticks: u32,
    /// Longest time the shaft sensor may stand still while the motor pulls, s.
    pub frozen_s: f64,
    /// Largest believable change of shaft speed in one tick, rad/s.
    pub spike_rad_s: f64,
    /// Winding resistance, ohm, and back-EMF constant, V s: a voltage drive's current limit.
    pub winding: (f64, f64),
    /// What the shaft sensor's direction is held against.
    pub shaft: Shaft,
    /// What torque, speed and thrust are held against.
    pub water: Water,
}

impl Limits {
    /// What is in force on a rig where the configuration says nothing else, by the largest drive, current and shaft
    /// speed, in a loop of this period.
    pub fn usual(rig: &Rig, drive_max: f64, current_a: f64, speed_rad_s: f64, period_s: f64) -> Self {
        let kt = rig.motor.torque_constant_nm_a.value;
        // Fastest honest change in one tick: full torque reversed on the bare inertia, tenfold,
        // and some counts of the encoder.
        let fastest = 2.0 * kt * current_a / rig.motor.inertia_kg_m2.value * period_s;
        let water = Water::of(rig, current_a, speed_rad_s, None);
        let count = rig.sensors.encoder_counts_per_rev.map_or(0.0, |n| std::f64::consts::TAU / n / period_s);
        Self {
            kind: kind_of(rig),
            drive_max,
            current_a,
            trip_current_a: 1.25 * current_a,
            continuous_current_a: current_a,
            thermal_time_constant_s: 60.0,
            speed_rad_s,
            trip_speed_rad_s: 1.15 * speed_rad_s,
            full_drive_s: 0.005,
            supply_v: (f64::NEG_INFINITY, f64::INFINITY),
            temperature_c: f64::INFINITY,
            missing_ticks: MISSING_TICKS,
            frozen_s: 0.5,
            spike_rad_s: 10.0 * fastest + 4.0 * count,
            winding: (rig.motor.winding_resistance_ohm.map_or(f64::NAN, |r| r.value), kt),
            shaft: Shaft::of(rig, current_a, &water),
            water,
        }
    }
}

/// Everything the pure servo needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Period of the loop, ns.
    pub period_ns: u64,
    /// Age of the newest command at which the servo trips, ns.
    pub command_timeout_ns: u64,
    /// Limits and checks.
    pub limits: Limits,
}

impl Settings {
    /// Reads the settings of a thruster.
    ///
    /// # Errors
    /// [`ConfigError`] names file, key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let mut wrong = Vec::new();
        let read = Self::read(config, id, thruster, rig, &mut wrong);
        match wrong.into_iter().next() {
            Some(first) => Err(first),
            None => read,
        }
    }

    /// The same, with everything that is wrong with sections and bounds; an error where reading ended.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn read(
        config: &Config,
        id: &str,
        thruster: &Thruster,
        rig: &Rig,
        wrong: &mut Vec<ConfigError>,
    ) -> Result<Self, ConfigError> {
        let section = |part: &str| format!("thrusters.{id}.{part}");
        let keys = config.section(&section("limits"), &thruster.limits);
        let keys: LimitKeys = keys.map_err(|error| wrong.push(error)).unwrap_or_default();
        let checks = config.section(&section("checks"), &thruster.checks);
        let checks: CheckKeys = checks.map_err(|error| wrong.push(error)).unwrap_or_default();
        let rig_current_a = Some(rig.amplifier.current_limit_a).filter(|a| a.is_finite()).unwrap_or(10_000.0);
        let rig_supply_v = rig.amplifier.supply_v.filter(|v| v.is_finite()).unwrap_or(10_000.0);
        // Twice the speed at which the back EMF is all of the supply: a stream may drive the shaft beyond that speed.
        let rig_speed_rad_s = rig
            .amplifier
            .supply_v
            .map(|v| 2.0 * v / rig.motor.torque_constant_nm_a.value)
            .filter(|v| (0.1..10_000.0).contains(v))
            .unwrap_or(10_000.0);
        // Beyond what rig and physics know a limit protects nothing; one that is not a number never trips.
        let bounds: [(&str, Option<f64>, f64, f64, &str); 13] = [
            (
                "limits.current_a",
                keys.current_a,
                1e-3,
                rig_current_a,
                "at most amplifier.current_limit_a of the rig",
            ),
            ("limits.trip_current_a", keys.trip_current_a, 1e-3, 2.0 * rig_current_a, "1.25 times current_a"),
            (
                "limits.continuous_current_a",
                keys.continuous_current_a,
                1e-3,
                rig_current_a,
                "the motor's data sheet",
            ),
            (
                "limits.thermal_time_constant_s",
                keys.thermal_time_constant_s,
                0.1,
                36_000.0,
                "60 for a small motor",
            ),
            (
                "limits.speed_rad_s",
                keys.speed_rad_s,
                0.1,
                rig_speed_rad_s,
                "what propeller and gear bear; the most is twice amplifier.supply_v over motor.torque_constant_nm_a of the rig",
            ),
            (
                "limits.trip_speed_rad_s",
                keys.trip_speed_rad_s,
                0.1,
                2.0 * rig_speed_rad_s,
                "1.15 times speed_rad_s",
            ),
            ("limits.full_drive_s", keys.full_drive_s, 1e-9, 60.0, "0.005 for a stiff drive"),
            (
                "limits.supply_low_v",
                keys.supply_low_v,
                0.0,
                2.0 * rig_supply_v,
                "the band around the supply's nominal voltage",
            ),
            (
                "limits.supply_high_v",
                keys.supply_high_v,
                0.0,
                2.0 * rig_supply_v,
                "the band around the supply's nominal voltage",
            ),
            (
                "limits.temperature_c",
                keys.temperature_c,
                -20.0,
                250.0,
                "the winding's class, for example 120",
            ),
            ("checks.frozen_s", checks.frozen_s, 0.01, 60.0, "0.5"),
            ("checks.inflow_m_s", checks.inflow_m_s, 0.0, 50.0, "the fastest the vehicle goes through water"),
            (
                "checks.spike_rad_s",
                checks.spike_rad_s,
                1e-3,
                4.0 * rig_speed_rad_s,
                "leave the key out: it follows from the rig",
            ),
        ];
        let mut told = Vec::new();
        for (key, value, low, high, hint) in bounds {
            if let Some(value) = value.filter(|v| !(low..=high).contains(v)) {
                told.push(key);
                wrong.push(config.error(format!(
                    "`thrusters.{id}.{key}` = {value} is outside {low} to {high}\nhint: {hint}"
                )));
            }
        }
        if let Some(inflow) = checks.inflow_m_s.filter(|_| rig.propeller.is_none()) {
            wrong.push(config.error(format!(
                "`thrusters.{id}.checks.inflow_m_s` = {inflow}, and the rig has no propeller that a stream could turn\nhint: leave the key out: on a dry shaft only what hangs on it gives back"
            )));
        }
        let crossed = keys.crossed(rig.amplifier.current_limit_a);
        // Bounds that are crossed by a value that is wrong already are told by that one.
        let crossed = crossed.into_iter().filter(|(of, _)| !told.iter().any(|key| of.contains(key)));
        wrong.extend(crossed.map(|(_, words)| config.error(format!("`thrusters.{id}.{words}"))));
        let need = |key: &str, value: f64, instead: &str| {
            // One that stands there and is none is told already.
            let refused = || wrong.first().filter(|_| told.contains(&key)).cloned();
            let missing = || config.error(format!("`thrusters.{id}.{key}` is missing\nhint: {instead}"));
            Some(value).filter(|v| v.is_finite()).ok_or_else(|| refused().unwrap_or_else(missing))
        };
        let current_a = need(
            "limits.current_a",
            keys.current_a.unwrap_or(rig.amplifier.current_limit_a),
            "set it, or state amplifier.current_limit_a in the rig",
        )?;
        let speed_rad_s = keys.speed_rad_s.unwrap_or(f64::INFINITY);
        let drive_max = match kind_of(rig) {
            DriveKind::Voltage => rig.amplifier.supply_v.ok_or_else(|| {
                config.error(format!(
                    "`thrusters.{id}.rig`: amplifier.supply_v is missing, the largest command of a voltage drive\nhint: state it in the rig"
                ))
            })?,
            DriveKind::Speed => need(
                "limits.speed_rad_s",
                speed_rad_s,
                "a drive commanded by speed needs its largest: what propeller and gear bear",
            )?,
            DriveKind::Current | DriveKind::Duty => current_a,
        };
        let period_s = thruster.servo_period_ns() as f64 * 1e-9;
        let usual = Limits::usual(rig, drive_max, current_a, speed_rad_s, period_s);
        let water = Water::of(rig, current_a, speed_rad_s, checks.inflow_m_s);
        let limits = Limits {
            trip_current_a: keys.trip_current_a.unwrap_or(usual.trip_current_a),
            continuous_current_a: keys.continuous_current_a.unwrap_or(usual.continuous_current_a),
            thermal_time_constant_s: keys.thermal_time_constant_s.unwrap_or(usual.thermal_time_constant_s),
            trip_speed_rad_s: keys.trip_speed_rad_s.unwrap_or(usual.trip_speed_rad_s),
            full_drive_s: keys.full_drive_s.unwrap_or(usual.full_drive_s),
            supply_v: (
                keys.supply_low_v.unwrap_or(usual.supply_v.0),
                keys.supply_high_v.unwrap_or(usual.supply_v.1),
            ),
            temperature_c: keys.temperature_c.unwrap_or(usual.temperature_c),
            frozen_s: checks.frozen_s.unwrap_or(usual.frozen_s),
            spike_rad_s: checks.spike_rad_s.unwrap_or(usual.spike_rad_s),
            shaft: Shaft::of(rig, current_a, &water),
            water,
            ..usual
        };
        // 3.5 of the controller's periods, so that zero torque is reached within five.
        let command_timeout_ns = thruster.controller_period_ns() * 7 / 2;
        Ok(Self { period_ns: thruster.servo_period_ns(), command_timeout_ns, limits })
    }

    /// With readings of the drive that stand for `life_ns`: one that tells more seldom than the loop asks.
    pub fn with_reading_life(mut self, life_ns: u64) -> Self {
        let ticks = u32::try_from(life_ns.div_ceil(self.period_ns.max(1))).unwrap_or(u32::MAX);
        // Some ticks more, so that a device that falls silent is told by its own fault.
        self.limits.missing_ticks = ticks.saturating_add(MISSING_TICKS);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guard::Guard;
    use kort_proto::faults::Fault;
    use kort_proto::signals::Signals;

    /// Old values of a turning shaft are told where no `limits.speed_rad_s` is stated too.
    #[test]
    fn a_stale_angle_is_told_without_a_speed_limit() {
        const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
        let config = Config::parse("[thrusters.t1]\nrig = \"r\"\namplifier = \"vesc\"\n", None).unwrap();
        let rig = Rig::from_toml(RIG).unwrap();
        let limits = Settings::new(&config, "t1", config.thruster("t1").unwrap(), &rig).unwrap().limits;
        assert_eq!(limits.speed_rad_s, f64::INFINITY);
        let mut guard = Guard::new(limits, 1e-3);
        let stale =
            Signals { current_a: 0.6, shaft_speed_rad_s: 20.0, shaft_angle_rad: 3.0, ..Signals::UNKNOWN };
        let seen = (0..1500).fold(0, |seen, _| seen | guard.inspect(&stale, 0.6, 1));
        assert_eq!(seen, Fault::SensorFrozen.bit());
    }
}
