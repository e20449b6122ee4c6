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

pub struct Watched {
    pub l: Loop,
    pub time_s: f64,
    noise: u64,
}

impl Watched {
    pub fn new() -> Self {
        let mut l = Loop::new(&stand(), &ControllerConfig::with_law(LawKind::Model2Inversion), DT);
        l.flow_meter = true;
        Self { l, time_s: 0.0, noise: 1 }
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
        measured.thrust_n = measured.thrust_n.map(|x| x + 2.0 * a);
        measured.current_a = measured.current_a.map(|x| x + 0.02 * b);
        measured.flow_m_s = measured.flow_m_s.map(|x| x * (1.0 + 0.1 * c));
        self.l.tick_with(&measured, reference(self.time_s));
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
            let specs = (descriptor.parameters)(&model.scale(&stand(), 600.0));
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
        self.l.plant = plant(effects, factors);
        let Self { l, time_s, .. } = self;
        l.plant.start(*time_s, now.shaft_speed_rad_s, now.axial_m_s, now.current_a, now.shaft_angle_rad);
    }
}

pub fn stand() -> Rig {
    Rig::from_toml(STAND).unwrap()
}

/// The stand's truth, with effects and parameters that the controller does not know.
pub fn plant(effects: &[(&Descriptor, &[f64])], factors: &[(Parameter, f64)]) -> Plant {
    let rig = stand();
    let mut p = Parameters::stated(&rig);
    factors.iter().for_each(|(parameter, factor)| p.set(*parameter, p.get(*parameter) * factor));
    Plant::new(ModelName::Model2, &rig, &p, effects, DT).with_encoder_quantised(true)
}

/// A clean run that has learnt what is usual.
pub fn learnt() -> Watched {
    let mut watched = Watched::new();
    assert_eq!(watched.run(2.2 * f64::from(LEARNT) * BLOCK_S), None);
    assert!(!watched.l.controller.mismatch().learning);
    watched
}
