//! Extended Kalman filter of shaft, flow, swirl, ambient flow and unexplained load.
//!
//! Reference: docs/control.md D8; Kalman filter with scalar updates (Bucy & Joseph 1968), the covariance kept
//! symmetric and within its prior.
//! State `[Om, vp, us, va, Qf, Om_f, Qb, T_f]`; `Om_f` and `T_f` are speed and thrust behind their sensors' filters,
//! which is what is measured; the load that the model does not explain opposes the shaft with `Qf` at any speed, as friction does, and with
//! `Qb (Om/Om_max)^2`, as an error of the blades' torque does. Shaft and water follow Model 2 (with swirl where the model has it) by midpoint steps
//! of at most what the thruster's fastest pole allows; `va` and `Qd` are first-order Gauss-Markov, so that
//! an unobservable one goes back to its prior standard deviation and says so. Each measurement
//! is a scalar update behind a five-sigma gate; a gate shut for as long as the shaft takes to top speed, a fifth of a second at most, opens with
//! the filter started again from the measured speed, or a stale one would never come back.
//!
//! `va` and `Qd` are not separable from shaft speed alone: their standard errors then stay near the
//! prior and their correlation near one. Thrust, flow, or speed variation parts them.
//!
//! Assumes: blade coefficients, inertia and torque constant known.
//! Needs measured: shaft speed and current; thrust, flow and ambient where there are any.
//! Fails: model error that is not load or inflow is put there; ventilation is outside the model.

use kort_thruster::rig::AmplifierKind;

use super::belief::{
    AMBIENT, BLADE, Belief, FELT, FILTERED, FLOW, LOAD, Matrix, N, Noise, SPEED, SWIRL, Vector, filter_keep,
    water_of,
};
use super::{ObserverInput, ObserverOptions, Water};
use crate::model::ControlModel;
use crate::signals::Estimate;

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

    pub(super) fn start_in(&mut self, model: &ControlModel, water: &Water) {
        self.belief.start_in(model, water);
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
        self.belief.feel(model, dt);
        if let Some(thrust) = input.measured.thrust_n.filter(|_| self.options.use_thrust) {
            self.belief.linear(1, FELT, thrust, thrust_var, dt);
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
    a[(SPEED, LOAD)] = -model.sense(w.speed_rad_s) / inertia;
    a[(SPEED, BLADE)] = -model.square(w.speed_rad_s) / inertia;
    a[(FLOW, SPEED)] = lever * s.thrust_by_tangential / mass;
    // What thrust comes with unexplained torque of the blades.
    a[(FLOW, BLADE)] = model.thrust_per_torque_1_m * model.square(w.speed_rad_s) / mass;
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
    if model.amplifier == AmplifierKind::Speed {
        a.row_mut(SPEED).fill(0.0);
    }
    a[(AMBIENT, AMBIENT)] = -1.0 / noise.ambient_time_s;
    a[(LOAD, LOAD)] = -1.0 / noise.load_time_s;
    a[(BLADE, BLADE)] = -1.0 / noise.blade_time_s;
    // What settles within a tick has settled: the series below would make it grow.
    for i in [SPEED, FLOW] {
        let within = -a[(i, i)] * dt;
        if within > 1.0 {
            for j in 0..N {
                a[(i, j)] /= within;
            }
        }
    }
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
        let mut model = stand();
        model.thrust_per_torque_1_m = 5.0;
        let noise = Noise::new(&model, &ObserverOptions::default());
        let x = Vector::from([45.0, 0.7, 0.0, 0.2, 0.1, 44.0, 0.3, 150.0]);
        let dt = 1e-3;
        let f = transition(&model, &x, &noise, dt);
        for j in [SPEED, FLOW, AMBIENT, LOAD, FILTERED, BLADE, FELT] {
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
