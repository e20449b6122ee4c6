//! The paper's stand in closed loop, watched by the monitor of mismatch.

use kort_control::mismatch::{BLOCK_S, LEARNT, Mismatch, Path};
use kort_control::{ControllerConfig, LawKind, Reference};
use kort_thruster::effects::{self, Descriptor};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::Plant;
use kort_thruster::rig::Rig;

use super::{Loop, STAND};

pub const DT: f64 = 2e-3;

/// A thrust reference that wanders over levels and directions.
pub fn reference(time_s: f64) -> Reference {
    let levels = [0.4, 0.6, 0.3, 0.15, -0.2, -0.45, -0.6, -0.3, 0.2, 0.5];
    let k = (time_s / 1.3) as usize;
    Reference::Thrust(170.0 * levels[(k * 7 + k / 10) % levels.len()])
}

/// Levels and directions drawn, each for its own time: what the monitor was made on, so that the table is not of it.
pub fn drawn(full_n: f64, seed: u64, time_s: f64) -> Reference {
    let of = |k: u64| {
        let mut x = (seed ^ k.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    // Time is cut at every 3 s, and each piece once more somewhere.
    let piece = (time_s / 3.0) as u64;
    let late = u64::from(time_s - 3.0 * piece as f64 > 0.5 + 2.0 * of(3 * piece));
    Reference::Thrust(0.75 * full_n * (2.0 * of(3 * piece + 1 + late) - 1.0))
}

pub struct Watched {
    pub l: Loop,
    pub rig: Rig,
    pub time_s: f64,
    noise: u64,
    /// Of the drawn reference; without it the wandering one of the stand.
    seed: Option<u64>,
}

impl Watched {
    pub fn new() -> Self {
        Self::on(&stand(), None)
    }

    /// On a rig, with a seed of reference and noise.
    pub fn on(rig: &Rig, seed: Option<u64>) -> Self {
        let mut l = Loop::new(rig, &ControllerConfig::with_law(LawKind::Model2Inversion), DT);
        l.flow_meter = true;
        Self { l, rig: rig.clone(), time_s: 0.0, noise: 1 + 2 * seed.unwrap_or(0), seed }
    }

    pub fn reference(&self) -> Reference {
        match self.seed {
            Some(seed) => drawn(self.l.controller.nominal().thrust_max_n, seed, self.time_s),
            None => reference(self.time_s),
        }
    }

    fn normal(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.noise =
                self.noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.noise >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }

    /// One tick with noise on every sensor.
    pub fn tick(&mut self) -> Mismatch {
        let mut measured = self.l.measured();
        let (a, b, c) = (self.normal(), self.normal(), self.normal());
        let model = self.l.controller.nominal();
        let (thrust_n, current_a) = (model.thrust_max_n / 90.0, model.current_limit_a / 450.0);
        measured.thrust_n = measured.thrust_n.map(|x| x + thrust_n * a);
        measured.current_a = measured.current_a.map(|x| x + current_a * b);
        measured.flow_m_s = measured.flow_m_s.map(|x| x * (1.0 + 0.1 * c));
        let reference = self.reference();
        self.l.tick_with(&measured, reference);
        self.time_s += DT;
        self.l.controller.mismatch()
    }

    /// Time until the monitor says what is waited for, s.
    pub fn is(&mut self, within_s: f64, what: impl Fn(Mismatch) -> bool) -> Option<f64> {
        (0..(within_s / DT) as usize).find(|_| what(self.tick())).map(|k| k as f64 * DT)
    }

    /// Runs until an alarm or for a time.
    pub fn run(&mut self, seconds: f64) -> Option<Path> {
        self.is(seconds, |m| m.alarm.is_some());
        self.l.controller.mismatch().alarm
    }

    /// The plant goes on with these effects, or with other parameters.
    pub fn switch(&mut self, known: &[(&str, &[(&str, f64)])], factors: &[(Parameter, f64)]) {
        let model = *self.l.controller.nominal();
        let hook = |(id, sizes): &(&str, &[(&str, f64)])| {
            let descriptor = effects::find(id).unwrap();
            let specs = (descriptor.parameters)(&model.scale(&self.rig, 600.0));
            let size = |s: &effects::Spec| {
                let given = sizes.iter().find(|(name, _)| *name == s.name).map(|(_, x)| *x);
                given.unwrap_or(if s.shape { s.mean } else { 0.0 })
            };
            (descriptor, specs.iter().map(size).collect::<Vec<f64>>())
        };
        let hooked: Vec<_> = known.iter().map(hook).collect();
        let list: Vec<_> = hooked.iter().map(|(d, v)| (*d, v.as_slice())).collect();
        self.switch_to(&list, factors);
    }

    /// The plant goes on with effects at these values.
    pub fn switch_to(&mut self, effects: &[(&Descriptor, &[f64])], factors: &[(Parameter, f64)]) {
        let now = *self.l.plant.truth();
        self.l.plant = plant_of(&self.rig, effects, factors);
        let Self { l, time_s, .. } = self;
        l.plant.start(*time_s, now.shaft_speed_rad_s, now.axial_m_s, now.current_a, now.shaft_angle_rad);
    }
}

pub fn stand() -> Rig {
    Rig::from_toml(STAND).unwrap()
}

/// The stand's truth, with effects and parameters that the controller does not know.
pub fn plant(effects: &[(&Descriptor, &[f64])], factors: &[(Parameter, f64)]) -> Plant {
    plant_of(&stand(), effects, factors)
}

/// The same of any rig.
pub fn plant_of(rig: &Rig, effects: &[(&Descriptor, &[f64])], factors: &[(Parameter, f64)]) -> Plant {
    let mut p = Parameters::stated(rig);
    factors.iter().for_each(|(parameter, factor)| p.set(*parameter, p.get(*parameter) * factor));
    Plant::new(ModelName::Model2, rig, &p, effects, DT).with_encoder_quantised(true)
}

/// A clean run that has learnt what is usual.
pub fn learnt() -> Watched {
    learnt_on(&stand(), None)
}

/// The same on any rig.
pub fn learnt_on(rig: &Rig, seed: Option<u64>) -> Watched {
    let mut watched = Watched::on(rig, seed);
    assert_eq!(watched.run(2.2 * f64::from(LEARNT) * BLOCK_S), None);
    assert!(!watched.l.controller.mismatch().learning);
    watched
}

/// A rig of `config/thrusters/`.
pub fn rig(name: &str) -> Rig {
    let file = format!("{}/../../config/thrusters/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Rig::from_toml(&std::fs::read_to_string(file).unwrap()).unwrap()
}
