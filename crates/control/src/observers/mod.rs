//! Observers: measurements in, an estimate of shaft, water and load out.

mod belief;
mod ekf;
mod load_torque;
mod luenberger;
mod open_loop;
mod ukf;

use kort_thruster::rig::AmplifierKind;
use serde::{Deserialize, Serialize};

use crate::model::ControlModel;
use crate::signals::{Estimate, Estimated, Measurement};

pub use load_torque::LoadTorque;

/// Which observer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObserverKind {
    /// Flow integrated from the measured speed.
    OpenLoop,
    /// Luenberger after Fossen and Blanke.
    Luenberger,
    /// Extended Kalman filter.
    #[default]
    Ekf,
    /// Unscented Kalman filter.
    Ukf,
}

impl ObserverKind {
    /// Every observer.
    pub const ALL: [Self; 4] = [Self::OpenLoop, Self::Luenberger, Self::Ekf, Self::Ukf];

    /// Stable name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OpenLoop => "open_loop",
            Self::Luenberger => "luenberger",
            Self::Ekf => "ekf",
            Self::Ukf => "ukf",
        }
    }

    /// The observer of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|k| k.name() == name)
    }
}

/// Options of the observers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObserverOptions {
    /// Use the force sensor where it measures.
    pub use_thrust: bool,
    /// Use the flow meter where it measures.
    pub use_flow: bool,
    /// Standard deviation of the ambient flow before anything is measured, m/s.
    pub ambient_std_m_s: f64,
    /// Time over which the ambient flow forgets itself, s.
    pub ambient_time_s: f64,
    /// Standard deviation of the unexplained load, share of the largest motor torque.
    pub load_std: f64,
    /// Time over which the unexplained load forgets itself, s.
    pub load_time_s: f64,
    /// Standard deviation of the error of the blades' torque at top speed, share of the largest motor torque.
    pub blade_load_std: f64,
    /// Time over which that error forgets itself, s: blades change slowly.
    pub blade_load_time_s: f64,
    /// Standard deviation of the force sensor and the thrust model together, share of the largest thrust.
    pub thrust_std: f64,
    /// Standard deviation of one reading of the flow meter, m/s: turbulence and where it sits.
    pub flow_std_m_s: f64,
}

impl ObserverOptions {
    /// What a configuration leaves out.
    pub const DEFAULT: Self = Self {
        use_thrust: true,
        use_flow: true,
        ambient_std_m_s: 0.5,
        ambient_time_s: 5.0,
        load_std: 0.03,
        load_time_s: 10.0,
        blade_load_std: 0.1,
        blade_load_time_s: 300.0,
        thrust_std: 0.02,
        flow_std_m_s: 0.2,
    };
}

impl Default for ObserverOptions {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What an observer sees at one tick.
#[derive(Clone, Copy, Debug)]
pub struct ObserverInput<'a> {
    /// The thruster, adapted where an estimator runs.
    pub model: &'a ControlModel,
    /// Measurements, already sane.
    pub measured: &'a Measurement,
    /// Motor current over the last period, A: measured, or modelled from the last command.
    pub current_a: f64,
    /// Time since the last tick, s.
    pub dt_s: f64,
}

/// A running observer.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum Observer {
    /// See [`ObserverKind::OpenLoop`].
    OpenLoop(open_loop::OpenLoop),
    /// See [`ObserverKind::Luenberger`].
    Luenberger(luenberger::Luenberger),
    /// See [`ObserverKind::Ekf`].
    Ekf(ekf::Ekf),
    /// See [`ObserverKind::Ukf`].
    Ukf(ukf::Ukf),
}

impl Observer {
    /// An observer at rest in still water.
    pub fn new(kind: ObserverKind, model: &ControlModel, options: &ObserverOptions) -> Self {
        match kind {
            ObserverKind::OpenLoop => Self::OpenLoop(open_loop::OpenLoop::default()),
            ObserverKind::Luenberger => Self::Luenberger(luenberger::Luenberger::new(model, options)),
            ObserverKind::Ekf => Self::Ekf(ekf::Ekf::new(model, options)),
            ObserverKind::Ukf => Self::Ukf(ukf::Ukf::new(model, options)),
        }
    }

    /// An observer that goes on from what another one believed: a change under way is no step.
    pub fn after(
        kind: ObserverKind,
        model: &ControlModel,
        options: &ObserverOptions,
        last: &Estimate,
    ) -> Self {
        let mut observer = Self::new(kind, model, options);
        let water = Water {
            speed_rad_s: last.shaft_speed_rad_s.value,
            flow_m_s: last.flow_m_s.value,
            swirl_m_s: if model.swirl.is_some() { last.swirl_m_s.value } else { 0.0 },
            ambient_m_s: last.ambient_m_s.value,
            load_n_m: last.load_torque_n_m.value * model.sense(last.shaft_speed_rad_s.value),
            // What part of it grows with speed the next observer finds by itself.
            blade_load_n_m: 0.0,
        }
        .boxed(model);
        match &mut observer {
            Self::OpenLoop(o) => o.start_in(water),
            Self::Luenberger(o) => o.start_in(water),
            Self::Ekf(o) => o.start_in(model, &water),
            Self::Ukf(o) => o.start_in(model, &water),
        }
        observer
    }

    /// One step.
    pub fn tick(&mut self, input: &ObserverInput) -> Estimate {
        match self {
            Self::OpenLoop(o) => o.tick(input),
            Self::Luenberger(o) => o.tick(input),
            Self::Ekf(o) => o.tick(input),
            Self::Ukf(o) => o.tick(input),
        }
    }
}

/// Largest share by which blades are believed to give more or less thrust than stated.
const SURPLUS_MAX: f64 = 0.3;

/// Shaft, water and what drives them: the physical part of every observer's state. What load the model does not
/// explain opposes the turning shaft, as friction and an error of the blades' torque do, so that a reversal
/// finds it known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Water {
    speed_rad_s: f64,
    flow_m_s: f64,
    swirl_m_s: f64,
    ambient_m_s: f64,
    /// Unexplained load that opposes the turning shaft at any speed, as friction does.
    load_n_m: f64,
    /// Unexplained load at top speed that grows with speed squared, as an error of the blades' torque does.
    blade_load_n_m: f64,
}

/// Rates of shaft, flow and swirl, and how fast the swirl is washed out, 1/s: a light swirl is
/// stiffer than the rest and takes a step that is implicit in it.
type Rates = [f64; 4];

impl Water {
    #[inline]
    fn rates(&self, model: &ControlModel, motor_n_m: f64) -> Rates {
        let load = model.load(self.speed_rad_s, self.flow_m_s, self.swirl_m_s);
        [
            (motor_n_m
                - load.torque_n_m
                - model.friction_n_m(self.speed_rad_s)
                - self.unexplained_n_m(model))
                / model.inertia_kg_m2,
            model.flow_acceleration(
                load.thrust_n + self.thrust_beyond_n(model),
                self.flow_m_s,
                self.ambient_m_s,
            ),
            model.swirl_acceleration(load.torque_n_m, self.flow_m_s, self.swirl_m_s),
            model.swirl_decay_per_s(self.flow_m_s),
        ]
    }

    /// Load that the model does not explain, N m; positive opposes ahead.
    #[inline]
    fn unexplained_n_m(&self, model: &ControlModel) -> f64 {
        self.load_n_m * model.sense(self.speed_rad_s) + self.blade_load_n_m * model.square(self.speed_rad_s)
    }

    /// Thrust that probably comes with the blades' unexplained torque, N.
    #[inline]
    fn thrust_beyond_n(&self, model: &ControlModel) -> f64 {
        model.thrust_per_torque_1_m * self.blade_load_n_m * model.square(self.speed_rad_s)
    }

    /// The same as a share of what the model gives in still water, held to what blades can err by.
    fn thrust_surplus(&self, model: &ControlModel) -> f64 {
        let top = model.map.thrust_n(model.speed_max_rad_s);
        (model.thrust_per_torque_1_m * self.blade_load_n_m / top).clamp(-SURPLUS_MAX, SURPLUS_MAX)
    }

    #[inline]
    fn moved(&self, rates: Rates, dt_s: f64) -> Self {
        Self {
            speed_rad_s: self.speed_rad_s + rates[0] * dt_s,
            flow_m_s: self.flow_m_s + rates[1] * dt_s,
            swirl_m_s: self.swirl_m_s + rates[2] * dt_s / (1.0 + rates[3] * dt_s),
            ..*self
        }
    }

    /// One period with the motor's torque held; a drive with a speed loop of its own holds the speed.
    fn step(&self, model: &ControlModel, motor_n_m: f64, dt_s: f64) -> Self {
        if model.amplifier == AmplifierKind::Speed {
            return self.step_at_speed(model, dt_s);
        }
        self.midpoint(model, dt_s, |now| now.rates(model, motor_n_m))
    }

    /// One period with the shaft held at its speed.
    fn step_at_speed(&self, model: &ControlModel, dt_s: f64) -> Self {
        self.midpoint(model, dt_s, |now| {
            let [_, flow, swirl, decay] = now.rates(model, 0.0);
            [0.0, flow, swirl, decay]
        })
    }

    /// Midpoint steps short enough for the thruster; never more than sixteen.
    #[inline]
    fn midpoint(&self, model: &ControlModel, dt_s: f64, rates: impl Fn(&Self) -> Rates) -> Self {
        let parts = (dt_s / model.step_max_s).ceil().clamp(1.0, 16.0);
        let h = dt_s / parts;
        let mut now = *self;
        for _ in 0..parts as u32 {
            let middle = now.moved(rates(&now), 0.5 * h);
            now = now.moved(rates(&middle), h);
        }
        now.boxed(model)
    }

    /// Held inside what the thruster can reach, so that no input leads to an overflow.
    #[inline]
    fn boxed(mut self, model: &ControlModel) -> Self {
        let speed = 2.0 * model.speed_max_rad_s;
        let flow = 3.0 * model.map.flow_m * model.speed_max_rad_s + 4.0;
        let load = 0.5 * model.torque_constant_nm_a * model.current_limit_a;
        let sum = self.speed_rad_s
            + self.flow_m_s
            + self.swirl_m_s
            + self.ambient_m_s
            + self.load_n_m
            + self.blade_load_n_m;
        if !sum.is_finite() {
            return Self::default();
        }
        self.speed_rad_s = self.speed_rad_s.clamp(-speed, speed);
        self.flow_m_s = self.flow_m_s.clamp(-flow, flow);
        self.swirl_m_s = self.swirl_m_s.clamp(-flow, flow);
        self.ambient_m_s = self.ambient_m_s.clamp(-4.0, 4.0);
        self.load_n_m = self.load_n_m.clamp(-load, load);
        self.blade_load_n_m = self.blade_load_n_m.clamp(-load, load);
        self
    }

    /// An estimate without a measure of its doubt.
    fn estimate(&self, model: &ControlModel) -> Estimate {
        let unsure = |value| Estimated { value, std_error: f64::INFINITY };
        let load = model.load(self.speed_rad_s, self.flow_m_s, self.swirl_m_s);
        Estimate {
            shaft_speed_rad_s: unsure(self.speed_rad_s),
            flow_m_s: unsure(self.flow_m_s),
            ambient_m_s: unsure(self.ambient_m_s),
            thrust_n: unsure(load.thrust_n + self.thrust_beyond_n(model)),
            load_torque_n_m: unsure(self.unexplained_n_m(model)),
            swirl_m_s: unsure(self.swirl_m_s),
            blade_torque_n_m: load.torque_n_m,
            thrust_surplus: self.thrust_surplus(model),
            gated: 0,
        }
    }
}
