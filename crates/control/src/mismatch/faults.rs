//! What a fault of each path does to what the monitor sees: rehearsed on the model itself, before anything runs.
//!
//! A thruster with the fault is driven over levels and directions, and watched against the model without it. The difference
//! that the fault makes to every sign is its direction; its size is of no matter.

use super::channels::{CHANNELS, Channels, DRIVE, RESTLESS, SIGNS, THRUST, TORQUE, WATER, WAYS, sign};
use super::{Path, Seen};
use crate::model::ControlModel;
use crate::signals::Measurement;

/// A sensor, or the command, of the thruster that is rehearsed.
#[derive(Clone, Copy, Debug)]
struct Channel {
    gain: f64,
    zero: f64,
    lag_s: f64,
    shown: f64,
}

impl Channel {
    const TRUE: Self = Self { gain: 1.0, zero: 0.0, lag_s: 0.0, shown: 0.0 };

    fn step(&mut self, x: f64, dt_s: f64) -> f64 {
        self.shown += (x - self.shown) * (1.0 - (-dt_s / self.lag_s.max(1e-9)).exp());
        self.gain * self.shown + self.zero
    }
}

/// A thruster that is rehearsed.
#[derive(Clone, Copy, Debug)]
struct Thruster {
    model: ControlModel,
    command: Channel,
    speed: Channel,
    current: Channel,
    thrust: Channel,
    flow: Channel,
    /// What lift gives of thrust and torque, behind which lag it comes.
    lift: [Channel; 2],
    ambient_m_s: f64,
}

/// Size of the faults that are rehearsed, a share.
const BY: f64 = 0.03;
/// The same of those that come late, s.
const LAG_S: f64 = 0.01;

/// A fault: its path, which way it can be, and what it changes.
type Fault = (Path, Sides, fn(&mut Thruster));

/// Which way a fault can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sides {
    /// More or less than stated.
    Both,
    /// Only as it is rehearsed: blades and sensors come later than they should, and not ahead of what they follow.
    One,
}
use Sides::{Both, One};

/// Faults of the thruster and its sensors, as common as the catalogue of effects says: the commonest first.
const MADE: [Fault; 24] = [
    (Path::Shaft, Both, |t| t.model.coulomb_friction_n_m += BY * t.full_n_m()),
    (Path::Shaft, Both, |t| t.model.viscous_friction_nm_s += BY * t.full_n_m() / t.model.speed_max_rad_s),
    (Path::Sensor, Both, |t| t.thrust.gain += BY),
    (Path::Sensor, Both, |t| t.thrust.zero += BY * t.model.thrust_max_n),
    (Path::Sensor, Both, |t| t.current.zero += BY * t.model.current_limit_a),
    (Path::Sensor, Both, |t| t.command.zero += BY * t.model.current_limit_a),
    (Path::Drive, Both, |t| t.command.lag_s += LAG_S),
    (Path::Shaft, Both, |t| t.model.inertia_kg_m2 *= 1.0 + BY),
    (Path::Sensor, One, |t| t.thrust.lag_s += LAG_S),
    (Path::Sensor, One, |t| t.speed.lag_s += LAG_S),
    (Path::Drive, Both, |t| t.command.gain += BY),
    (Path::Sensor, Both, |t| t.flow.gain += BY),
    (Path::Sensor, Both, |t| t.flow.zero += BY * t.full_m_s()),
    (Path::Sensor, One, |t| t.flow.lag_s += LAG_S),
    (Path::Flow, Both, |t| t.model.added_mass_kg *= 1.0 + BY),
    (Path::Flow, Both, |t| t.ambient_m_s += BY * t.full_m_s()),
    (Path::Blade, Both, |t| t.model.blade.lift_max *= 1.0 - BY),
    (Path::Blade, Both, |t| t.model.blade.drag_max *= 1.0 + BY),
    // Swirl, air and bubbles take of both.
    (Path::Blade, Both, |t| {
        t.model.blade.lift_max *= 1.0 - BY;
        t.model.blade.drag_max *= 1.0 - BY;
    }),
    (Path::Flow, Both, |t| t.model.flux_coefficient *= 1.0 + BY),
    (Path::Drive, Both, |t| t.model.torque_constant_nm_a *= 1.0 - BY),
    (Path::Sensor, Both, |t| t.current.gain += BY),
    // Of another water blades and duct have as much less or more.
    (Path::Blade, Both, |t| {
        t.model.blade.density_kg_m3 *= 1.0 - BY;
        t.model.added_mass_kg *= 1.0 - BY;
    }),
    (Path::Blade, One, |t| t.lift.iter_mut().for_each(|part| part.lag_s += LAG_S)),
];
/// What is more restless than it was, in one channel alone.
const RESTLESSNESS: [(Path, usize); CHANNELS] =
    [(Path::Drive, DRIVE), (Path::Shaft, TORQUE), (Path::Sensor, THRUST), (Path::Sensor, WATER)];

/// Faults that are told apart.
pub(super) const FAULTS: usize = MADE.len() + CHANNELS;

/// Levels of thrust, shares of the largest, one after the other.
const LEVELS: [f64; 10] = [0.3, 0.7, 0.15, -0.2, -0.7, -0.35, 0.1, 0.5, -0.5, -0.1];
/// How hard the speed is pulled to its target, 1/s.
const PULL_PER_S: f64 = 10.0;
/// Steps on each: the shortest time of the model, which is that of shaft and water, decides how long they are.
const STEPS: usize = 300;

impl Thruster {
    fn new(model: &ControlModel) -> Self {
        let right = Channel::TRUE;
        Self {
            model: *model,
            command: right,
            speed: Channel { lag_s: model.speed_filter_s, ..right },
            current: right,
            thrust: Channel { lag_s: model.thrust_filter_s, ..right },
            flow: right,
            lift: [right; 2],
            ambient_m_s: model.ambient_mean_m_s,
        }
    }

    fn full_n_m(&self) -> f64 {
        self.model.torque_constant_nm_a * self.model.current_limit_a
    }

    fn full_m_s(&self) -> f64 {
        self.model.map.flow_m * self.model.speed_max_rad_s
    }

    /// What the model without the fault sees of it.
    fn watched(mut self, model: &ControlModel) -> [f64; SIGNS] {
        self.model.refresh();
        let mut dragged = self.model;
        dragged.blade.lift_max = 0.0;
        dragged.refresh();
        let dt_s = model.step_max_s;
        let full_a = model.current_limit_a;
        let lag_s = model.amplifier_lag_s;
        let keep = if lag_s > 0.0 { (-dt_s / lag_s).exp() } else { 0.0 };
        let (mut speed_rad_s, mut flow_m_s, mut current_a) = (0.0, 0.0, 0.0);
        let mut channels = Channels::default();
        for level in LEVELS {
            let target_rad_s = level.signum() * level.abs().sqrt() * model.speed_max_rad_s;
            for _ in 0..STEPS {
                let wanted_n_m = model.map.torque_n_m(target_rad_s)
                    + model.inertia_kg_m2 * PULL_PER_S * (target_rad_s - speed_rad_s);
                let asked_a = (wanted_n_m / model.torque_constant_nm_a).clamp(-full_a, full_a);
                let given_a = self.command.step(asked_a, dt_s);
                current_a = given_a + (current_a - given_a) * keep;
                let load = self.model.load(speed_rad_s, flow_m_s, 0.0);
                let drag = dragged.load(speed_rad_s, flow_m_s, 0.0);
                let [thrust, torque] = &mut self.lift;
                let thrust_n = drag.thrust_n + thrust.step(load.thrust_n - drag.thrust_n, dt_s);
                let load_n_m = drag.torque_n_m + torque.step(load.torque_n_m - drag.torque_n_m, dt_s);
                let net_n_m = self.model.torque_constant_nm_a * current_a
                    - self.model.friction_n_m(speed_rad_s)
                    - load_n_m;
                flow_m_s += dt_s * self.model.flow_acceleration(thrust_n, flow_m_s, self.ambient_m_s);
                speed_rad_s += dt_s * net_n_m / self.model.inertia_kg_m2;
                let shown_a = self.current.step(current_a, dt_s);
                let measured = Measurement {
                    shaft_speed_rad_s: Some(self.speed.step(speed_rad_s, dt_s)),
                    current_a: Some(shown_a),
                    thrust_n: Some(self.thrust.step(thrust_n, dt_s)),
                    flow_m_s: Some(self.flow.step(flow_m_s, dt_s)),
                    ..Measurement::default()
                };
                let drive_a = Some((asked_a, shown_a));
                channels.tick(&Seen { model, measured: &measured, drive_a, driving: true, dt_s });
            }
        }
        channels.block().map(|sign| sign.map_or(0.0, |sign| sign.value))
    }
}

/// Each fault's path, sides and direction.
pub(super) fn rehearsed(model: &ControlModel) -> [(Path, Sides, [f64; SIGNS]); FAULTS] {
    let right = Thruster::new(model).watched(model);
    std::array::from_fn(|k| {
        let mut direction = [0.0; SIGNS];
        if let Some((path, sides, change)) = MADE.get(k) {
            let mut thruster = Thruster::new(model);
            change(&mut thruster);
            let with = thruster.watched(model);
            // Restlessness is against noise, and a rehearsal has none.
            for i in (0..SIGNS).filter(|i| i % WAYS != RESTLESS) {
                direction[i] = Some(with[i] - right[i]).filter(|x| x.is_finite()).unwrap_or(0.0);
            }
            return (*path, *sides, direction);
        }
        let (path, channel) = RESTLESSNESS[k - MADE.len()];
        direction[sign(channel, RESTLESS)] = 1.0;
        (path, One, direction)
    })
}
