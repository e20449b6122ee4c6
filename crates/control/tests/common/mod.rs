//! A closed loop of controller and plant for the suites.
#![allow(dead_code)]

pub mod watched;

use kort_control::{Controller, ControllerConfig, Measurement, Output, Reference};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

pub const STAND: &str = include_str!("stand.toml");

/// A thruster of 76 mm with a fast shaft and a slow drive.
pub const SMALL: &str = r#"
[rig]
name = "small"
[propeller]
radius_m = 0.038
duct_length_m = 0.038
pitch_rad = 0.38
lift_max = 0.9
drag_max = 0.9
[flow]
density_kg_m3 = 998
flux_coefficient = 2.0
added_mass_coefficient = 1.5
[motor]
inertia_kg_m2 = 5e-5
torque_constant_nm_a = 0.0195
winding_resistance_ohm = 0.2
viscous_friction_nm_s = 5e-5
[amplifier]
kind = "current"
time_constant_s = 0.015
current_limit_a = 24
supply_v = 16
[sensors]
encoder_counts_per_rev = 84
speed_filter_time_constant_s = 0.010
"#;

/// The suites' thrusters: the two above and every one of `config/thrusters/` that has a propeller.
pub fn rigs() -> Vec<Rig> {
    let mut rigs = vec![Rig::from_toml(STAND).unwrap(), Rig::from_toml(SMALL).unwrap()];
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/thrusters");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).map(|d| d.flatten().map(|f| f.path()).collect()).unwrap_or_default();
    files.sort();
    for file in files.iter().filter(|f| f.extension().is_some_and(|e| e == "toml")) {
        let rig = Rig::from_toml(&std::fs::read_to_string(file).unwrap()).unwrap();
        if rig.propeller.is_some() {
            rigs.push(rig);
        }
    }
    rigs
}

pub struct Loop {
    pub plant: Plant,
    pub controller: Controller,
    pub kind: AmplifierKind,
    pub dt: f64,
    pub time_s: f64,
    pub ambient_m_s: f64,
    pub force_sensor: bool,
    /// The force sensor stands still at this value.
    pub stuck_n: Option<f64>,
    pub flow_meter: bool,
}

impl Loop {
    pub fn new(rig: &Rig, config: &ControllerConfig, dt: f64) -> Self {
        Self::with_truth(rig, config, dt, &[])
    }

    /// Parameters of the truth multiplied by factors that the controller does not know.
    pub fn with_truth(rig: &Rig, config: &ControllerConfig, dt: f64, factors: &[(Parameter, f64)]) -> Self {
        let mut p = Parameters::stated(rig);
        for (parameter, factor) in factors {
            p.set(*parameter, p.get(*parameter) * factor);
        }
        Self {
            plant: Plant::new(ModelName::Model2, rig, &p, &[], dt).with_encoder_quantised(true),
            controller: Controller::new(rig, config, dt).unwrap(),
            kind: rig.amplifier.kind,
            dt,
            time_s: 0.0,
            ambient_m_s: 0.0,
            force_sensor: true,
            stuck_n: None,
            flow_meter: false,
        }
    }

    pub fn measured(&self) -> Measurement {
        let s = self.plant.sensed();
        Measurement {
            shaft_speed_rad_s: Some(s.shaft_speed_rad_s),
            current_a: (self.kind != AmplifierKind::Speed).then_some(s.current_a),
            thrust_n: self.force_sensor.then_some(self.stuck_n.unwrap_or(s.thrust_n)),
            flow_m_s: self.flow_meter.then_some(s.flow_m_s),
            ambient_m_s: None,
            supply_v: s.supply_v.is_finite().then_some(s.supply_v),
            shaft_angle_rad: Some(s.shaft_angle_rad),
        }
    }

    pub fn tick(&mut self, reference: Reference) -> Output {
        self.tick_with(&self.measured(), reference)
    }

    /// One tick with what the controller is shown.
    pub fn tick_with(&mut self, measured: &Measurement, reference: Reference) -> Output {
        let output = self.controller.tick(measured, reference, self.dt);
        let command = match self.kind {
            AmplifierKind::Current => output.command.current_a,
            AmplifierKind::Voltage => output.command.voltage_v.unwrap(),
            AmplifierKind::Speed => output.command.speed_rad_s.unwrap(),
        };
        self.plant.step(&Tick {
            time_s: self.time_s,
            command,
            ambient_m_s: (self.ambient_m_s, self.ambient_m_s),
            ..Tick::default()
        });
        self.time_s += self.dt;
        output
    }

    pub fn run(&mut self, reference: Reference, seconds: f64) -> Output {
        let mut last = Output::default();
        for _ in 0..(seconds / self.dt).round() as usize {
            last = self.tick(reference);
        }
        last
    }

    pub fn thrust(&self) -> f64 {
        self.plant.truth().thrust_n
    }
}
