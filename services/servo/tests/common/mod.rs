//! A rig on the stand, behind the servo's guard.

use std::path::PathBuf;

use kort_proto::config::Config;
use kort_proto::faults::Fault;
use kort_proto::signals::Signals;
use kort_scenario::Measuring;
use kort_servo::guard::Guard;
use kort_servo::settings::{Limits, Settings};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

pub const PERIOD_S: f64 = 2e-3;

/// A rig on the stand, behind the servo's guard.
pub struct Stand {
    pub name: String,
    pub rig: Rig,
    pub limits: Limits,
    /// The thruster's own slipstream at full drive, m/s.
    pub slipstream_m_s: f64,
}

/// A motor of 0.01 kg m^2 without a propeller on a current drive, with what hangs on it.
pub fn dry(load: &str) -> Stand {
    let text = format!(
        "[rig]\nname = \"dry\"\nclass = \"bench\"\n[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\n\
         torque_constant_nm_a = 0.5\nviscous_friction_nm_s = 0.02\n[amplifier]\nkind = \"current\"\ncurrent_limit_a = 8.0\n\
         time_constant_s = 0.002\n[sensors]\nspeed_filter_time_constant_s = 0.01\n[load]\n{load}\n"
    );
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), text).expect("written");
    stand(&file.path().to_owned())
}

/// What hangs on dry shafts.
pub const LOADS: [&str; 4] = [
    "kind = \"none\"",
    "kind = \"fan\"\nfan_coefficient_nm_s2 = 0.0002",
    "kind = \"pendulum\"\nmass_kg = 1.0\nlength_m = 0.2",
    "kind = \"two_mass\"\ninertia_kg_m2 = 0.02\nstiffness_nm_rad = 20.0\ndamping_nm_s = 0.02",
];

/// Every shipped rig.
pub fn stands() -> Vec<Stand> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/thrusters");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("the rigs").map(|entry| entry.expect("a rig").path()).collect();
    files.sort();
    files.iter().map(stand).collect()
}

fn stand(file: &PathBuf) -> Stand {
    let rig = Rig::from_toml(&std::fs::read_to_string(file).expect("a rig")).expect("a rig");
    // What the rig does not say is the deployment's to say.
    let limits = match rig.amplifier.kind {
        AmplifierKind::Speed => "limits = { speed_rad_s = 157.0 }",
        _ if rig.amplifier.current_limit_a.is_infinite() => "limits = { current_a = 24.0 }",
        _ => "",
    };
    let text = format!(
        "[thrusters.t1]\nrig = \"{}\"\namplifier = \"simulated\"\nservo = {{ rate_hz = 500 }}\ncontroller = {{ rate_hz = 50 }}\n{limits}\n",
        file.display()
    );
    let config = Config::parse(&text, None).expect("a deployment");
    let thruster = config.thruster("t1").expect("t1");
    let limits = Settings::new(&config, "t1", thruster, &rig).expect("settings").limits;
    let p = Parameters::stated(&rig);
    let scale = kort_scenario::scale(&rig, &p, limits.drive_max, PERIOD_S, 60.0);
    let flux = p.get(Parameter::DensityKgM3) * p.area_m2();
    let slipstream_m_s = if rig.propeller.is_some() { (2.0 * scale.thrust_n / flux).sqrt() } else { 0.0 };
    Stand { name: rig.name.clone(), rig, limits, slipstream_m_s }
}

/// What is done to a stand.
pub struct Trial<'a> {
    /// Wish for the drive as a share of the largest, by time in s.
    pub wish: &'a dyn Fn(f64) -> f64,
    /// Inflow as a share of the slipstream.
    pub inflow: f64,
    /// True inertia as a multiple of the stated one.
    pub inertia: f64,
    /// What the sensors make of what they see, by time in s.
    pub shown: &'a dyn Fn(f64, Signals) -> Signals,
    /// The fault that is waited for.
    pub fault: Fault,
    pub until_s: f64,
    /// Water's density as a share of the stated one: less with air in it, more on fouled blades.
    pub density: f64,
}

impl Stand {
    /// When the guard says so, s.
    pub fn trips_at(&self, trial: &Trial) -> Option<f64> {
        let mut p = Parameters::stated(&self.rig);
        p.set(Parameter::InertiaKgM2, p.get(Parameter::InertiaKgM2) * trial.inertia);
        p.set(Parameter::DensityKgM3, p.get(Parameter::DensityKgM3) * trial.density);
        let scale = kort_scenario::scale(&self.rig, &p, self.limits.drive_max, PERIOD_S, 60.0);
        let mut plant =
            Plant::new(ModelName::Model2, &self.rig, &p, &[], PERIOD_S).with_encoder_quantised(true);
        let mut measuring = Measuring::new(&self.rig.sensors, scale, 1.0, 7);
        let mut guard = Guard::new(self.limits, PERIOD_S);
        let inflow = trial.inflow * self.slipstream_m_s;
        let mut drive = 0.0;
        for n in 0..(trial.until_s / PERIOD_S) as u64 {
            let time_s = n as f64 * PERIOD_S;
            plant.step(&Tick { time_s, command: drive, ambient_m_s: (inflow, inflow), ..Tick::default() });
            let read = measuring.read(time_s, &plant.sensed());
            let current_a =
                if self.rig.amplifier.kind == AmplifierKind::Speed { f64::NAN } else { read.current_a };
            let measured = Signals {
                current_a,
                shaft_speed_rad_s: read.shaft_speed_rad_s,
                shaft_angle_rad: read.shaft_angle_rad,
                thrust_n: read.thrust_n,
                ..Signals::UNKNOWN
            };
            let measured = (trial.shown)(time_s, measured);
            if guard.inspect(&measured, drive, 1) & trial.fault.bit() != 0 {
                return Some(time_s);
            }
            drive = guard.limit((trial.wish)(time_s) * self.limits.drive_max, drive).0;
        }
        None
    }
}
