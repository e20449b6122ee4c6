//! What EKF and UKF share: states, prior, noise, gates, and the belief that a measurement updates.

use kort_thruster::rig::AmplifierKind;
use nalgebra::{SMatrix, SVector};

use super::{ObserverInput, ObserverOptions, Water};
use crate::model::{ControlModel, Slopes};
use crate::signals::{Estimate, Estimated};

/// Number of states.
pub(super) const N: usize = 8;
pub(super) const SPEED: usize = 0;
pub(super) const FLOW: usize = 1;
pub(super) const SWIRL: usize = 2;
pub(super) const AMBIENT: usize = 3;
pub(super) const LOAD: usize = 4;
pub(super) const FILTERED: usize = 5;
pub(super) const BLADE: usize = 6;
pub(super) const FELT: usize = 7;

pub(super) type Vector = SVector<f64, N>;
pub(super) type Matrix = SMatrix<f64, N, N>;

/// Prior, process and measurement noise of a filter on this thruster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    pub prior: Vector,
    /// Process noise, variance a second.
    pub process: Vector,
    pub speed_var: f64,
    pub thrust_var: f64,
    pub flow_var: f64,
    pub(super) ambient_time_s: f64,
    pub(super) load_time_s: f64,
    pub(super) blade_time_s: f64,
    /// A gate is shut no longer than this, s.
    shut_s: f64,
}

/// The longest that a gate is shut, s.
const SHUT_S: f64 = 0.2;

impl Noise {
    pub(super) fn new(model: &ControlModel, options: &ObserverOptions) -> Self {
        let torque = model.torque_constant_nm_a * model.current_limit_a;
        let flow_max = model.map.flow_m * model.speed_max_rad_s;
        let has_swirl = if model.swirl.is_some() { 1.0 } else { 0.0 };
        let ambient = options.ambient_std_m_s.clamp(1e-3, 3.0);
        let load = options.load_std.clamp(1e-5, 1.0) * torque;
        let blade = options.blade_load_std.clamp(1e-5, 1.0) * torque;
        let blade_time_s = options.blade_load_time_s.clamp(0.1, 1e6);
        let (ambient_time_s, load_time_s) =
            (options.ambient_time_s.clamp(0.1, 1e6), options.load_time_s.clamp(0.1, 1e6));
        let speed = 0.02 * model.speed_max_rad_s;
        let prior = Vector::from([
            speed * speed,
            (0.2 * flow_max).powi(2),
            has_swirl * (0.1 * flow_max).powi(2),
            ambient * ambient,
            load * load,
            speed * speed,
            blade * blade,
            model.thrust_max_n * model.thrust_max_n,
        ]);
        // Torque noise of one percent over the drive's time scale, flow of a few percent in a second.
        let torque_time = model.amplifier_lag_s + model.period_s;
        let mut process = Vector::from([
            (0.01 * torque / model.inertia_kg_m2).powi(2) * torque_time,
            (0.05 * flow_max).powi(2),
            has_swirl * (0.05 * flow_max).powi(2),
            2.0 * ambient * ambient / ambient_time_s,
            2.0 * load * load / load_time_s,
            0.0,
            2.0 * blade * blade / blade_time_s,
            0.0,
        ]);
        if model.amplifier == AmplifierKind::Speed {
            // What turns the shaft is the drive's own affair: its speed is followed, its torque says nothing.
            process[SPEED] = model.speed_max_rad_s.powi(2);
        }
        // The quantum shrinks through the speed filter; a held flow reading repeats itself.
        let shrink = model.period_s / (model.period_s + 2.0 * model.speed_filter_s);
        // A sensor that is late shows an error as it was: what it became since is noise, for as long as the lag.
        let since = 2.0 * process[SPEED] * model.late.speed_s.powi(2) / model.period_s;
        let speed_var =
            model.speed_quantum_rad_s.powi(2) / 6.0 * shrink + (5e-4 * model.speed_max_rad_s).powi(2) + since;
        let thrust_std =
            (options.thrust_std.clamp(1e-5, 10.0) * model.thrust_max_n).max(model.thrust_quantum_n);
        // As does, nearly, one whose sensor is late.
        let held_s = model.flow_rate_hz.map_or(0.0, |f| 1.0 / f) + 2.0 * model.late.flow_s;
        let repeats = (held_s / model.period_s).max(1.0);
        Self {
            prior,
            process,
            speed_var,
            thrust_var: thrust_std * thrust_std,
            flow_var: options.flow_std_m_s.clamp(1e-4, 100.0).powi(2) * repeats,
            ambient_time_s,
            load_time_s,
            blade_time_s,
            // By then all torque has brought the shaft from rest to top speed, and what is believed of it is worth nothing.
            shut_s: SHUT_S.min(model.inertia_kg_m2 * model.speed_max_rad_s / torque),
        }
    }

    /// The state one period later, with the motor's torque held.
    pub(super) fn advance(&self, model: &ControlModel, x: &Vector, motor_n_m: f64, dt: f64) -> Vector {
        let water = water_of(x).step(model, motor_n_m, dt);
        let keep = filter_keep(model, dt);
        let mean_speed = 0.5 * (x[SPEED] + water.speed_rad_s);
        Vector::from([
            water.speed_rad_s,
            water.flow_m_s,
            water.swirl_m_s,
            model.ambient_mean_m_s
                + (water.ambient_m_s - model.ambient_mean_m_s) * (1.0 - (dt / self.ambient_time_s).min(1.0)),
            water.load_n_m * (1.0 - (dt / self.load_time_s).min(1.0)),
            keep * x[FILTERED] + (1.0 - keep) * mean_speed,
            water.blade_load_n_m * (1.0 - (dt / self.blade_time_s).min(1.0)),
            x[FELT],
        ])
    }
}

/// What the force sensor's filter keeps of itself over a period.
pub(super) fn felt_keep(model: &ControlModel, dt: f64) -> f64 {
    if model.thrust_filter_s > 0.0 { (-dt / model.thrust_filter_s).exp() } else { 0.0 }
}

/// What the speed filter keeps of itself over a period.
pub(super) fn filter_keep(model: &ControlModel, dt: f64) -> f64 {
    (-dt / (model.speed_filter_s + 0.5 * model.period_s)).exp()
}

pub(super) fn water_of(x: &Vector) -> Water {
    Water {
        speed_rad_s: x[SPEED],
        flow_m_s: x[FLOW],
        swirl_m_s: x[SWIRL],
        ambient_m_s: x[AMBIENT],
        load_n_m: x[LOAD],
        blade_load_n_m: x[BLADE],
    }
}

pub(super) fn put_back(x: &mut Vector, water: &Water) {
    x[SPEED] = water.speed_rad_s;
    x[FLOW] = water.flow_m_s;
    x[SWIRL] = water.swirl_m_s;
    x[AMBIENT] = water.ambient_m_s;
    x[LOAD] = water.load_n_m;
    x[BLADE] = water.blade_load_n_m;
}

/// Gates innovations and says when a shut gate must open.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gate {
    shut_s: f64,
}

/// What a gate says of an innovation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Use,
    Reject,
    Reset,
}

impl Gate {
    pub(super) fn judge(&mut self, innovation: f64, variance: f64, longest_s: f64, dt: f64) -> Verdict {
        if innovation * innovation <= 25.0 * variance {
            self.shut_s = 0.0;
            return Verdict::Use;
        }
        self.shut_s += dt;
        if self.shut_s > longest_s {
            self.shut_s = 0.0;
            Verdict::Reset
        } else {
            Verdict::Reject
        }
    }
}

/// Mean, covariance and gates: what EKF and UKF share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Belief {
    pub x: Vector,
    pub p: Matrix,
    gates: [Gate; 3],
    pub gated: u64,
    pub noise: Noise,
    started: bool,
}

impl Belief {
    pub(super) fn new(model: &ControlModel, options: &ObserverOptions) -> Self {
        let noise = Noise::new(model, options);
        Self {
            x: Vector::zeros(),
            p: Matrix::from_diagonal(&noise.prior),
            gates: [Gate::default(); 3],
            gated: 0,
            noise,
            started: false,
        }
    }

    /// The first measured speed is where a filter starts: a shaft may be turning already.
    pub(super) fn start(&mut self, input: &ObserverInput) {
        if !self.started
            && let Some(speed) = input.measured.shaft_speed_rad_s
        {
            self.started = true;
            self.x[SWIRL] = 0.0;
            (self.x[SPEED], self.x[FILTERED]) = (speed, speed);
            self.x[FLOW] = input.model.map.flow_m_s(speed);
            self.x[AMBIENT] = input.model.ambient_mean_m_s;
            self.x[FELT] = self.blade_thrust_n(input.model);
        }
    }

    /// Goes on from another observer's belief, at the prior's doubt.
    pub(super) fn start_in(&mut self, model: &ControlModel, water: &Water) {
        put_back(&mut self.x, water);
        self.x[FILTERED] = water.speed_rad_s;
        self.x[FELT] = self.blade_thrust_n(model);
        self.started = true;
    }

    /// Thrust of the blades as the model has it, N.
    fn blade_thrust_n(&self, model: &ControlModel) -> f64 {
        model.load(self.x[SPEED], self.x[FLOW], self.x[SWIRL]).thrust_n
    }

    /// Forgets what it believed: the next measured speed starts it again, at the prior's doubt.
    fn restart(&mut self) {
        self.p = Matrix::from_diagonal(&self.noise.prior);
        (self.x[AMBIENT], self.x[LOAD], self.x[BLADE]) = (0.0, 0.0, 0.0);
        self.started = false;
    }

    /// Scalar update with sensitivities `ph = P h` and innovation variance `s`. With the optimal gain
    /// `ph / s` the Joseph form `(I - K h')P(I - K h')' + K r K'` comes down to `P - ph ph' / s`.
    pub(super) fn update(&mut self, channel: usize, innovation: f64, ph: Vector, s: f64, dt: f64) {
        match self.gates[channel].judge(innovation, s, self.noise.shut_s, dt) {
            Verdict::Use => {}
            Verdict::Reject => {
                self.gated += 1;
                return;
            }
            Verdict::Reset => {
                self.gated += 1;
                self.restart();
                return;
            }
        }
        let k = ph / s;
        self.x += k * innovation;
        for j in 0..N {
            for i in 0..N {
                self.p[(i, j)] -= k[i] * ph[j];
            }
        }
    }

    pub(super) fn linear(&mut self, channel: usize, state: usize, value: f64, variance: f64, dt: f64) {
        let ph = self.p.column(state).into_owned();
        let s = ph[state] + variance;
        self.update(channel, value - self.x[state], ph, s, dt);
    }

    /// The force sensor's filter over a period, at the state as it then is: one without leaves thrust and its doubt as they are.
    pub(super) fn feel(&mut self, model: &ControlModel, dt: f64) {
        let keep = felt_keep(model, dt);
        let s = model.slopes(model.blade.inflow(self.x[SPEED], self.x[FLOW], self.x[SWIRL]));
        let (ph, variance) = self.thrust_doubt(model, &s);
        self.x[FELT] = keep * self.x[FELT] + (1.0 - keep) * s.thrust_n;
        let own = self.p[(FELT, FELT)];
        for i in 0..N {
            let with = keep * self.p[(i, FELT)] + (1.0 - keep) * ph[i];
            (self.p[(i, FELT)], self.p[(FELT, i)]) = (with, with);
        }
        self.p[(FELT, FELT)] =
            keep * keep * own + 2.0 * keep * (1.0 - keep) * ph[FELT] + (1.0 - keep).powi(2) * variance;
    }

    /// `P h` and `h' P h` of thrust, `h` its slopes by speed, flow and swirl.
    pub(super) fn thrust_doubt(&self, model: &ControlModel, s: &Slopes) -> (Vector, f64) {
        let h = [
            (SPEED, model.blade.lever_m() * s.thrust_by_tangential),
            (FLOW, s.thrust_by_axial),
            (SWIRL, -s.thrust_by_tangential),
        ];
        let mut ph = Vector::zeros();
        for (k, slope) in h {
            for i in 0..N {
                ph[i] += slope * self.p[(i, k)];
            }
        }
        (ph, h.iter().map(|(k, slope)| slope * ph[*k]).sum())
    }

    /// Symmetry, positive diagonals, states in their box.
    pub(super) fn tidy(&mut self, model: &ControlModel) {
        for i in 0..N {
            for j in 0..i {
                let mean = 0.5 * (self.p[(i, j)] + self.p[(j, i)]);
                (self.p[(i, j)], self.p[(j, i)]) = (mean, mean);
            }
        }
        for i in 0..N {
            let floor = 1e-12 * self.noise.prior[i];
            let ceiling = 4.0 * self.noise.prior[i].max(1e-300);
            if !(self.p[(i, i)] >= floor && self.p[(i, i)].is_finite()) {
                self.p = Matrix::from_diagonal(&self.noise.prior);
                break;
            }
            if self.p[(i, i)] > ceiling {
                let scale = (ceiling / self.p[(i, i)]).sqrt();
                for j in 0..N {
                    self.p[(i, j)] *= scale;
                    self.p[(j, i)] *= scale;
                }
            }
        }
        if !self.x.iter().all(|x| x.is_finite()) {
            self.x = Vector::zeros();
        }
        let boxed = water_of(&self.x).boxed(model);
        put_back(&mut self.x, &boxed);
        let speed = 2.0 * model.speed_max_rad_s;
        self.x[FILTERED] = self.x[FILTERED].clamp(-speed, speed);
        let thrust = 4.0 * model.thrust_max_n;
        self.x[FELT] = self.x[FELT].clamp(-thrust, thrust);
    }

    /// A measured ambient flow is not estimated.
    pub(super) fn pin_ambient(&mut self, input: &ObserverInput) {
        if let Some(ambient) = input.measured.ambient_m_s {
            self.x[AMBIENT] = ambient;
            let keep = 1e-6 * self.noise.prior[AMBIENT];
            self.p.row_mut(AMBIENT).fill(0.0);
            self.p.column_mut(AMBIENT).fill(0.0);
            self.p[(AMBIENT, AMBIENT)] = keep;
        }
    }

    /// Both parts of the unexplained load together.
    fn load(&self, model: &ControlModel) -> Estimated {
        let (a, b) = (model.sense(self.x[SPEED]), model.square(self.x[SPEED]));
        let (p, cross) = (&self.p, self.p[(LOAD, BLADE)]);
        let variance = a * a * p[(LOAD, LOAD)] + 2.0 * a * b * cross + b * b * p[(BLADE, BLADE)];
        Estimated { value: a * self.x[LOAD] + b * self.x[BLADE], std_error: variance.max(0.0).sqrt() }
    }

    pub(super) fn estimate(&self, model: &ControlModel) -> Estimate {
        let of = |i: usize| Estimated { value: self.x[i], std_error: self.p[(i, i)].max(0.0).sqrt() };
        let s = model.slopes(model.blade.inflow(self.x[SPEED], self.x[FLOW], self.x[SWIRL]));
        let (_, variance) = self.thrust_doubt(model, &s);
        let (thrust_var, water) = (variance.max(0.0), water_of(&self.x));
        Estimate {
            shaft_speed_rad_s: of(SPEED),
            flow_m_s: of(FLOW),
            ambient_m_s: of(AMBIENT),
            thrust_n: Estimated {
                value: s.thrust_n + water.thrust_beyond_n(model),
                std_error: thrust_var.sqrt(),
            },
            load_torque_n_m: self.load(model),
            swirl_m_s: of(SWIRL),
            blade_torque_n_m: s.torque_n_m,
            thrust_surplus: water.thrust_surplus(model),
            gated: self.gated,
        }
    }
}
