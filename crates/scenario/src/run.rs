//! A scenario at work: rows of a recording, one by one.

mod drive_map;
mod effects;
mod turbulent;

use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Sensed, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::{Command, Excitation, Measuring, Replays, Scenario, ScenarioError, Segment};
use drive_map::DriveMap;
pub(crate) use effects::used;
pub use effects::{Used, used_effect};
use turbulent::Turbulent;

/// Control and log rates of a rig that states none, Hz.
const CONTROL_RATE_HZ: f64 = 500.0;
const LOG_RATE_HZ: f64 = 100.0;
/// Longest run: a day.
pub(crate) const LONGEST_S: f64 = 86_400.0;

/// A prepared scenario.
pub struct Run {
    plant: Plant,
    measuring: Measuring,
    signals: Signals,
    tick_s: f64,
    log_rate_hz: f64,
    tick: u64,
    row: u64,
    rows: u64,
    before: Sensed,
    command: f64,
    asked: f64,
    ambient_m_s: f64,
    columns: Vec<&'static str>,
}

struct Signals {
    command: Excitation,
    drive: DriveMap,
    ambient: Option<Excitation>,
    turbulence: Option<Turbulent>,
    supply: Option<Excitation>,
    depth: Option<Excitation>,
    temperature: Option<Excitation>,
}

impl Run {
    /// Prepares a scenario on a rig.
    ///
    /// # Errors
    /// All that is wrong; each [`ScenarioError`] names the key, the value found and what is allowed. What an effect may be is
    /// told once the signals can be played: it goes by their size.
    pub fn new(
        scenario: &Scenario,
        rig: &Rig,
        replays: &mut dyn Replays,
    ) -> Result<Self, Vec<ScenarioError>> {
        let mut wrong = scenario.values();
        let mut parameters = Parameters::stated(rig);
        for (parameter, number) in &scenario.parameters {
            parameters.set(*parameter, *number);
        }
        let seed = scenario.seed;
        let mut signal = |name: &str, segments: &[Segment], salt: u64| {
            let signal = Excitation::new(name, segments, seed.wrapping_add(salt), replays);
            signal.map_err(|errors| wrong.extend(errors)).ok().filter(|_| !segments.is_empty())
        };
        let command = signal("segments", &scenario.segments, 0);
        let ambient = signal("ambient", &scenario.ambient, 11);
        let supply = signal("supply", &scenario.supply, 13);
        let depth = signal("depth", &scenario.depth, 17);
        let temperature = signal("temperature", &scenario.temperature, 19);
        let drive = DriveMap::new(scenario.command, rig, &parameters).map_err(|error| wrong.push(error)).ok();
        let (Some(command), Some(drive), true) = (command, drive, wrong.is_empty()) else {
            return Err(wrong);
        };
        let turbulence = scenario.turbulence.map(|t| Turbulent::new(t, seed));
        let duration_s = scenario.duration_s.unwrap_or(command.duration_s());
        if !(duration_s > 0.0 && duration_s <= LONGEST_S) {
            let (key, found) = ("duration_s".into(), duration_s.to_string());
            return Err(vec![ScenarioError::Value { key, found, allowed: "above 0, at most 86400".into() }]);
        }
        let tick_s = 1.0 / rig.sensors.control_rate_hz.unwrap_or(CONTROL_RATE_HZ);
        let log_rate_hz = rig.sensors.log_rate_hz.unwrap_or(LOG_RATE_HZ);
        let peak = drive.to_drive(command.peak(1.0 / log_rate_hz)).abs();
        let scale = scale(rig, &parameters, peak, tick_s, duration_s);
        let effects = used(scenario, &scale)?;
        let effects: Vec<(&Descriptor, &[f64])> = effects.iter().map(|(d, v)| (*d, v.as_slice())).collect();
        let columns = columns(scenario, rig);
        let plant =
            Plant::new(scenario.model, rig, &parameters, &effects, tick_s).with_encoder_quantised(true);
        Ok(Self {
            before: plant.sensed(),
            plant,
            measuring: Measuring::new(&rig.sensors, scale, scenario.noise, seed.wrapping_add(23)),
            signals: Signals { command, drive, ambient, turbulence, supply, depth, temperature },
            tick_s,
            log_rate_hz,
            tick: 0,
            row: 0,
            rows: (duration_s * log_rate_hz + 1e-6).floor() as u64 + 1,
            command: 0.0,
            asked: 0.0,
            ambient_m_s: 0.0,
            columns,
        })
    }

    /// Columns of a row, beside `time_s`.
    pub fn columns(&self) -> &[&'static str] {
        &self.columns
    }

    /// Number of rows in all.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The next row into `values` (one a column); its time, or `None` at the end. The row at an
    /// instant shows the command that acts from then on and the state that it finds.
    pub fn next_row(&mut self, values: &mut Vec<f64>) -> Option<f64> {
        if self.row == self.rows {
            return None;
        }
        let time_s = self.row as f64 / self.log_rate_hz;
        self.row += 1;
        // The tick in which the instant lies; one on the grid shows the state before that tick.
        let within = time_s / self.tick_s;
        let tick = (within + 1e-6).floor() as u64;
        while self.tick < tick {
            self.step();
        }
        let part = (within - tick as f64).max(0.0);
        let sensed = if part < 1e-6 {
            self.show(tick as f64 * self.tick_s);
            self.plant.sensed()
        } else {
            self.step();
            self.before.between(&self.plant.sensed(), part)
        };
        let read = self.measuring.read(time_s, &sensed);
        values.clear();
        values.extend(self.columns.iter().map(|name| self.cell(name, time_s, &read)));
        Some(time_s)
    }

    /// Takes over what the signals ask for at a tick's start.
    fn show(&mut self, time_s: f64) {
        self.asked = self.signals.command.value(time_s);
        self.command = self.signals.drive.to_drive(self.asked);
    }

    fn step(&mut self) {
        let time_s = self.tick as f64 * self.tick_s;
        self.show(time_s);
        self.before = self.plant.sensed();
        let at = |s: &Option<Excitation>, t: f64| s.as_ref().map(|s| s.value(t));
        let s = &mut self.signals;
        let gust = s.turbulence.as_mut().map_or((0.0, 0.0), |t| t.next(self.tick_s));
        let ambient = (
            at(&s.ambient, time_s).unwrap_or(0.0) + gust.0,
            at(&s.ambient, time_s + self.tick_s).unwrap_or(0.0) + gust.1,
        );
        self.ambient_m_s = ambient.1;
        self.plant.step(&Tick {
            time_s,
            command: self.command,
            ambient_m_s: ambient,
            supply_v: at(&s.supply, time_s),
            depth_m: at(&s.depth, time_s),
            temperature_c: at(&s.temperature, time_s),
            ..Tick::default()
        });
        self.tick += 1;
    }

    fn cell(&self, name: &str, time_s: f64, read: &Sensed) -> f64 {
        let at = |s: &Option<Excitation>| s.as_ref().map_or(f64::NAN, |s| s.value(time_s));
        match name {
            "current_cmd_a" | "voltage_cmd_v" | "speed_cmd_rad_s" => self.command,
            "duty_cmd" | "thrust_cmd_n" => self.asked,
            "current_a" => read.current_a,
            "shaft_angle_rad" => read.shaft_angle_rad,
            "shaft_speed_rad_s" => read.shaft_speed_rad_s,
            "thrust_n" => read.thrust_n,
            "torque_n_m" => read.torque_n_m,
            "flow_m_s" => read.flow_m_s,
            "ambient_m_s" => self.ambient_m_s,
            "supply_v" => read.supply_v,
            "depth_m" => at(&self.signals.depth),
            "temperature_c" => at(&self.signals.temperature),
            _ => f64::NAN,
        }
    }
}

fn columns(scenario: &Scenario, rig: &Rig) -> Vec<&'static str> {
    let wet = rig.propeller.is_some();
    let axial = wet && scenario.model != ModelName::Model0;
    let speed_drive = rig.amplifier.kind == AmplifierKind::Speed;
    let drive = match rig.amplifier.kind {
        AmplifierKind::Current => "current_cmd_a",
        AmplifierKind::Voltage => "voltage_cmd_v",
        AmplifierKind::Speed => "speed_cmd_rad_s",
    };
    [
        (drive, true),
        ("duty_cmd", scenario.command == Command::DutyCmd),
        ("thrust_cmd_n", scenario.command == Command::ThrustCmdN),
        ("current_a", !speed_drive),
        ("shaft_angle_rad", rig.sensors.encoder_counts_per_rev.is_some()),
        ("shaft_speed_rad_s", true),
        ("thrust_n", wet && rig.sensors.thrust_sensor),
        ("torque_n_m", wet && rig.sensors.torque_transducer),
        ("flow_m_s", axial && rig.sensors.flow_meter),
        ("ambient_m_s", wet && rig.sensors.ambient_flow_recorded),
        ("supply_v", rig.amplifier.supply_v.is_some() || !scenario.supply.is_empty()),
        ("depth_m", !scenario.depth.is_empty()),
        ("temperature_c", !scenario.temperature.is_empty()),
    ]
    .into_iter()
    .filter_map(|(name, there)| there.then_some(name))
    .collect()
}

/// Sizes in use: from the largest drive command `peak` (A, V or rad/s) through the steady map.
pub fn scale(rig: &Rig, p: &Parameters, peak: f64, tick_s: f64, duration_s: f64) -> Scale {
    let kt = p.get(Parameter::TorqueConstantNmA);
    let (ct, cq) = if rig.propeller.is_some() { p.bollard_coefficients() } else { (0.0, 0.0) };
    let limit = rig.amplifier.current_limit_a;
    let speed_at = |torque: f64| if cq > 0.0 { (torque / cq).sqrt() } else { 100.0 };
    let (current, speed) = match rig.amplifier.kind {
        AmplifierKind::Current => (peak.min(limit), speed_at(kt * peak.min(limit))),
        AmplifierKind::Voltage => {
            // V = R i + kt Om, kt i = cq Om^2
            let r = p.get(Parameter::WindingResistanceOhm);
            let a = r * cq / kt;
            let speed =
                if a > 0.0 { ((kt * kt + 4.0 * a * peak).sqrt() - kt) / (2.0 * a) } else { peak / kt };
            // Out of the water current flows while the shaft is brought to speed: at first as much as at a stall.
            let current = if cq > 0.0 || r <= 0.0 { cq * speed * speed / kt } else { peak / r };
            (current.min(limit), speed)
        }
        AmplifierKind::Speed if cq > 0.0 => (cq * peak * peak / kt, peak),
        // What turns it so fast within a tenth of a second: of what a loop asks for out of the water nothing else is known.
        AmplifierKind::Speed => {
            let within_s = 0.1;
            ((p.get(Parameter::InertiaKgM2) * peak / within_s / kt).min(limit), peak)
        }
    };
    let thrust = ct * speed * speed;
    let flux = p.get(Parameter::FluxCoefficient) * p.get(Parameter::DensityKgM3) * p.area_m2();
    Scale {
        shaft_speed_rad_s: speed.max(1e-6),
        torque_n_m: (kt * current).max(1e-9),
        thrust_n: thrust.max(1e-9),
        flow_m_s: if flux > 0.0 { (thrust / flux).sqrt() } else { 1.0 },
        current_a: current.max(1e-9),
        command: peak.max(1e-9),
        supply_v: rig.amplifier.supply_v.unwrap_or(0.0),
        current_limit_a: rig.amplifier.current_limit_a,
        winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
        inertia_kg_m2: p.get(Parameter::InertiaKgM2),
        tick_s,
        duration_s,
        clock_s: [0.0, duration_s],
        angle_known: true,
        turned_rad: f64::INFINITY,
        angle_rad: [0.0; 2],
        reverses: true,
    }
}

#[cfg(test)]
mod tests;
