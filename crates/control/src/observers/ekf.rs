//! Extended Kalman filter of shaft, flow, swirl, ambient flow and unexplained load.
//!
//! Reference: docs/control.md D8; Kalman filter with scalar updates (Bucy & Joseph 1968), the covariance kept
//! symmetric and within its prior.
//! State `[Om, vp, us, va, Qd, Om_f]`; `Om_f` is the speed behind the rig's filter, which is what is
//! measured. Shaft and water follow Model 2 (with swirl where the model has it) by midpoint steps
//! of at most what the thruster's fastest pole allows; `va` and `Qd` are first-order Gauss-Markov, so that
//! an unobservable one goes back to its prior standard deviation and says so. Each measurement
//! is a scalar update behind a five-sigma gate; a gate shut for a fifth of a second opens with
//! the filter started again from the measured speed, or a stale one would never come back.
//!
//! `va` and `Qd` are not separable from shaft speed alone: their standard errors then stay near the
//! prior and their correlation near one. Thrust, flow, or speed variation parts them.
//!
//! Assumes: blade coefficients, inertia and torque constant known.
//! Needs measured: shaft speed and current; thrust, flow and ambient where there are any.
//! Fails: model error that is not load or inflow is put there; ventilation is outside the model.

use nalgebra::{SMatrix, SVector};

use super::{ObserverInput, ObserverOptions, Water};
use crate::model::{ControlModel, Slopes};
use crate::signals::{Estimate, Estimated};

/// Number of states.
pub(super) const N: usize = 6;
pub(super) const SPEED: usize = 0;
pub(super) const FLOW: usize = 1;
pub(super) const SWIRL: usize = 2;
pub(super) const AMBIENT: usize = 3;
pub(super) const LOAD: usize = 4;
pub(super) const FILTERED: usize = 5;

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
    ambient_time_s: f64,
    load_time_s: f64,
}

impl Noise {
    pub(super) fn new(model: &ControlModel, options: &ObserverOptions) -> Self {
        let torque = model.torque_constant_nm_a * model.current_limit_a;
        let flow_max = model.map.flow_m * model.speed_max_rad_s;
        let has_swirl = if model.swirl.is_some() { 1.0 } else { 0.0 };
        let ambient = options.ambient_std_m_s.clamp(1e-3, 3.0);
        let load = options.load_std.clamp(1e-5, 1.0) * torque;
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
        ]);
        // Torque noise of one percent over the drive's time scale, flow of a few percent in a second.
        let torque_time = model.amplifier_lag_s + model.period_s;
        let process = Vector::from([
            (0.01 * torque / model.inertia_kg_m2).powi(2) * torque_time,
            (0.05 * flow_max).powi(2),
            has_swirl * (0.05 * flow_max).powi(2),
            2.0 * ambient * ambient / ambient_time_s,
            2.0 * load * load / load_time_s,
            0.0,
        ]);
        // The quantum shrinks through the speed filter; a held flow reading repeats itself.
        let shrink = model.period_s / (model.period_s + 2.0 * model.speed_filter_s);
        let speed_var =
            model.speed_quantum_rad_s.powi(2) / 6.0 * shrink + (5e-4 * model.speed_max_rad_s).powi(2);
        let thrust_std =
            (options.thrust_std.clamp(1e-5, 10.0) * model.thrust_max_n).max(model.thrust_quantum_n);
        let repeats = model.flow_rate_hz.map_or(1.0, |f| (1.0 / (f * model.period_s)).max(1.0));
        Self {
            prior,
            process,
            speed_var,
            thrust_var: thrust_std * thrust_std,
            flow_var: options.flow_std_m_s.clamp(1e-4, 100.0).powi(2) * repeats,
            ambient_time_s,
            load_time_s,
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
            water.ambient_m_s * (1.0 - (dt / self.ambient_time_s).min(1.0)),
            water.load_n_m * (1.0 - (dt / self.load_time_s).min(1.0)),
            keep * x[FILTERED] + (1.0 - keep) * mean_speed,
        ])
    }
}

/// What the speed filter keeps of itself over a period.
fn filter_keep(model: &ControlModel, dt: f64) -> f64 {
    (-dt / (model.speed_filter_s + 0.5 * model.period_s)).exp()
}

pub(super) fn water_of(x: &Vector) -> Water {
    Water {
        speed_rad_s: x[SPEED],
        flow_m_s: x[FLOW],
        swirl_m_s: x[SWIRL],
        ambient_m_s: x[AMBIENT],
        load_n_m: x[LOAD],
    }
}

pub(super) fn put_back(x: &mut Vector, water: &Water) {
    x[SPEED] = water.speed_rad_s;
    x[FLOW] = water.flow_m_s;
    x[SWIRL] = water.swirl_m_s;
    x[AMBIENT] = water.ambient_m_s;
    x[LOAD] = water.load_n_m;
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
    pub(super) fn judge(&mut self, innovation: f64, variance: f64, dt: f64) -> Verdict {
        if innovation * innovation <= 25.0 * variance {
            self.shut_s = 0.0;
            return Verdict::Use;
        }
        self.shut_s += dt;
        if self.shut_s > 0.2 {
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
            self.x[FLOW] = input.model.map.flow_m * speed;
        }
    }

    /// Goes on from another observer's belief, at the prior's doubt.
    pub(super) fn start_in(&mut self, water: &Water) {
        put_back(&mut self.x, water);
        self.x[FILTERED] = water.speed_rad_s;
        self.started = true;
    }

    /// Forgets what it believed: the next measured speed starts it again, at the prior's doubt.
    fn restart(&mut self) {
        self.p = Matrix::from_diagonal(&self.noise.prior);
        (self.x[AMBIENT], self.x[LOAD]) = (0.0, 0.0);
        self.started = false;
    }

    /// Scalar update with sensitivities `ph = P h` and innovation variance `s`. With the optimal gain
    /// `ph / s` the Joseph form `(I - K h')P(I - K h')' + K r K'` comes down to `P - ph ph' / s`.
    pub(super) fn update(&mut self, channel: usize, innovation: f64, ph: Vector, s: f64, dt: f64) {
        match self.gates[channel].judge(innovation, s, dt) {
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

    /// `P h` and `h' P h` of thrust, `h` its slopes by speed, flow and swirl.
    fn thrust_doubt(&self, model: &ControlModel, s: &Slopes) -> (Vector, f64) {
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

    pub(super) fn estimate(&self, model: &ControlModel) -> Estimate {
        let of = |i: usize| Estimated { value: self.x[i], std_error: self.p[(i, i)].max(0.0).sqrt() };
        let s = model.slopes(model.blade.inflow(self.x[SPEED], self.x[FLOW], self.x[SWIRL]));
        let (_, variance) = self.thrust_doubt(model, &s);
        let thrust_var = variance.max(0.0);
        Estimate {
            shaft_speed_rad_s: of(SPEED),
            flow_m_s: of(FLOW),
            ambient_m_s: of(AMBIENT),
            thrust_n: Estimated { value: s.thrust_n, std_error: thrust_var.sqrt() },
            load_torque_n_m: of(LOAD),
            swirl_m_s: of(SWIRL),
            gated: self.gated,
        }
    }
}

/// How a next state follows from a state, to first order: the rows of `f` hold few entries, and
/// what is zero is left out. Gives `f p f'` of a symmetric `p`.
fn carried(f: &Matrix, p: &Matrix) -> Matrix {
    let once = by_transpose(p, f).transpose();
    by_transpose(&once, f)
}

/// `a b'`.
#[inline(always)]
fn by_transpose(a: &Matrix, b: &Matrix) -> Matrix {
    let mut out = Matrix::zeros();
    for i in 0..N {
        for k in 0..N {
            let factor = b[(i, k)];
            if factor != 0.0 {
                for j in 0..N {
                    out[(j, i)] += factor * a[(j, k)];
                }
            }
        }
    }
    out
}

/// A running EKF.
#[derive(Clone, Copy, Debug)]
pub struct Ekf {
    belief: Belief,
    options: ObserverOptions,
}

impl Ekf {
    /// At rest, with the prior covariance.
    pub fn new(model: &ControlModel, options: &ObserverOptions) -> Self {
        Self { belief: Belief::new(model, options), options: *options }
    }

    pub(super) fn start_in(&mut self, water: &Water) {
        self.belief.start_in(water);
    }

    /// Predict with the motor's torque, correct with what is measured.
    pub fn tick(&mut self, input: &ObserverInput) -> Estimate {
        let (model, dt) = (input.model, input.dt_s);
        self.belief.start(input);
        self.predict(model, model.torque_constant_nm_a * input.current_a, dt);
        self.belief.pin_ambient(input);
        let (speed_var, thrust_var, flow_var) =
            (self.belief.noise.speed_var, self.belief.noise.thrust_var, self.belief.noise.flow_var);
        if let Some(speed) = input.measured.shaft_speed_rad_s {
            self.belief.linear(0, FILTERED, speed, speed_var, dt);
        }
        if let Some(thrust) = input.measured.thrust_n.filter(|_| self.options.use_thrust) {
            let x = &self.belief.x;
            let s = model.slopes(model.blade.inflow(x[SPEED], x[FLOW], x[SWIRL]));
            let (ph, variance) = self.belief.thrust_doubt(model, &s);
            self.belief.update(1, thrust - s.thrust_n, ph, variance + thrust_var, dt);
        }
        if let Some(flow) = input.measured.flow_m_s.filter(|_| self.options.use_flow) {
            self.belief.linear(2, FLOW, flow, flow_var, dt);
        }
        self.belief.tidy(model);
        self.belief.estimate(model)
    }

    fn predict(&mut self, model: &ControlModel, motor_n_m: f64, dt: f64) {
        let b = &mut self.belief;
        let f = transition(model, &b.x, &b.noise, dt);
        b.x = b.noise.advance(model, &b.x, motor_n_m, dt);
        b.p = carried(&f, &b.p);
        for i in 0..N {
            b.p[(i, i)] += b.noise.process[i] * dt;
        }
    }
}

/// `I + A dt + (A dt)^2 / 2` for shaft and water, exact for the filter.
fn transition(model: &ControlModel, x: &Vector, noise: &Noise, dt: f64) -> Matrix {
    let w = water_of(x);
    let s = model.slopes(model.blade.inflow(w.speed_rad_s, w.flow_m_s, w.swirl_m_s));
    let (lever, inertia, mass) = (model.blade.lever_m(), model.inertia_kg_m2, model.added_mass_kg);
    let flux = model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
    let mut a = Matrix::zeros();
    a[(SPEED, SPEED)] = -(lever * s.torque_by_tangential + model.viscous_friction_nm_s) / inertia;
    a[(SPEED, FLOW)] = -s.torque_by_axial / inertia;
    a[(SPEED, SWIRL)] = s.torque_by_tangential / inertia;
    a[(SPEED, LOAD)] = -1.0 / inertia;
    a[(FLOW, SPEED)] = lever * s.thrust_by_tangential / mass;
    let v = w.flow_m_s;
    a[(FLOW, FLOW)] = (s.thrust_by_axial - flux * (v.abs() + (v - w.ambient_m_s) * v.signum())) / mass;
    a[(FLOW, SWIRL)] = -s.thrust_by_tangential / mass;
    a[(FLOW, AMBIENT)] = flux * v.abs() / mass;
    if let Some(swirl) = model.swirl {
        let inertia = model.swirl_mass_kg(swirl);
        let drag = swirl.drag * model.blade.density_kg_m3 * model.blade.area_m2();
        a[(SWIRL, SPEED)] = s.torque_by_tangential / inertia;
        a[(SWIRL, FLOW)] = (s.torque_by_axial / lever - drag * w.swirl_m_s * v.signum()) / inertia;
        a[(SWIRL, SWIRL)] = (-s.torque_by_tangential / lever - drag * v.abs()) / inertia;
    }
    a[(AMBIENT, AMBIENT)] = -1.0 / noise.ambient_time_s;
    a[(LOAD, LOAD)] = -1.0 / noise.load_time_s;
    // As implicit as the step itself.
    let swirl_step = 1.0 / (1.0 - dt * a[(SWIRL, SWIRL)]);
    for j in 0..N {
        a[(SWIRL, j)] *= swirl_step;
    }
    let step = a * dt;
    let mut f = Matrix::identity() + step + by_transpose(&step, &step.transpose()) * 0.5;
    let keep = filter_keep(model, dt);
    for j in 0..N {
        f[(FILTERED, j)] = 0.5 * (1.0 - keep) * f[(SPEED, j)];
        f[(j, FILTERED)] = 0.0;
    }
    f[(FILTERED, SPEED)] += 0.5 * (1.0 - keep);
    f[(FILTERED, FILTERED)] = keep;
    f
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::stand;

    #[test]
    fn a_sparse_product_is_the_dense_one() {
        let f =
            Matrix::from_fn(|i, j| if (i * j) % 3 == 1 { 0.0 } else { (i as f64 - 2.5) * (j as f64 + 0.7) });
        let a = Matrix::from_fn(|i, j| ((i * 7 + j * 3) % 5) as f64 - 2.0);
        let p = a * a.transpose();
        assert!((carried(&f, &p) - f * p * f.transpose()).abs().max() < 1e-9);
        assert!((by_transpose(&a, &f) - a * f.transpose()).abs().max() < 1e-12);
    }

    #[test]
    fn transition_agrees_with_differences() {
        let model = stand();
        let noise = Noise::new(&model, &ObserverOptions::default());
        let x = Vector::from([45.0, 0.7, 0.0, 0.2, 0.1, 44.0]);
        let dt = 1e-3;
        let f = transition(&model, &x, &noise, dt);
        for j in [SPEED, FLOW, AMBIENT, LOAD, FILTERED] {
            let h = 1e-5;
            let (mut up, mut down) = (x, x);
            up[j] += h;
            down[j] -= h;
            let slope =
                (noise.advance(&model, &up, 7.0, dt) - noise.advance(&model, &down, 7.0, dt)) / (2.0 * h);
            for i in 0..N {
                assert!(
                    (slope[i] - f[(i, j)]).abs() < 2e-3 * (1.0 + slope[i].abs()),
                    "{i} {j} {} {}",
                    slope[i],
                    f[(i, j)]
                );
            }
        }
    }
}
