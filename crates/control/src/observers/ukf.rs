//! Unscented Kalman filter with the state of the EKF.
//!
//! Reference: Julier & Uhlmann 1997; docs/control.md D8 recommends it near standstill, where `|Om|` and
//! `|vp|` have kinks that a slope does not see. `2n + 1` points with `kappa = 1`; all weights are positive,
//! so the covariance stays one. What is measured is linear in the state and takes the scalar update of
//! the EKF; the force sensor's filter takes a second set of points.
//!
//! Assumes: blade coefficients, inertia and torque constant known, as `ekf`.
//! Needs measured: shaft speed and current; thrust, flow and ambient where there are any.
//! Fails: as `ekf`, model error goes into load or inflow; at several times the cost of `ekf`, for little
//! away from standstill.

use super::belief::{Belief, FELT, FILTERED, FLOW, Matrix, N, SPEED, SWIRL, Vector, felt_keep};
use super::{ObserverInput, ObserverOptions, Water};
use crate::model::ControlModel;
use crate::signals::Estimate;

const SPREAD: f64 = N as f64 + 1.0;
const CENTRE: f64 = 1.0 / SPREAD;
const OTHERS: f64 = 0.5 / SPREAD;

/// A running UKF.
#[derive(Clone, Copy, Debug)]
pub struct Ukf {
    belief: Belief,
    options: ObserverOptions,
}

impl Ukf {
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
        let noise = self.belief.noise;
        if let Some(speed) = input.measured.shaft_speed_rad_s {
            self.belief.linear(0, FILTERED, speed, noise.speed_var, dt);
        }
        self.feel(model, dt);
        if let Some(thrust) = input.measured.thrust_n.filter(|_| self.options.use_thrust) {
            self.belief.linear(1, FELT, thrust, noise.thrust_var, dt);
        }
        if let Some(flow) = input.measured.flow_m_s.filter(|_| self.options.use_flow) {
            self.belief.linear(2, FLOW, flow, noise.flow_var, dt);
        }
        self.belief.tidy(model);
        self.belief.estimate(model)
    }

    fn predict(&mut self, model: &ControlModel, motor_n_m: f64, dt: f64) {
        let b = &mut self.belief;
        let root = root(&b.p);
        let mut points = [Vector::zeros(); 2 * N + 1];
        for (i, point) in points.iter_mut().enumerate() {
            *point = b.noise.advance(model, &sigma(&b.x, &root, i), motor_n_m, dt);
        }
        let mean = weighted(&points);
        let mut p = Matrix::from_diagonal(&(b.noise.process * dt));
        for (i, point) in points.iter().enumerate() {
            let d = point - mean;
            p += d * d.transpose() * weight(i);
        }
        (b.x, b.p) = (mean, p);
    }

    /// The force sensor's filter over a period, as [`Belief::feel`].
    fn feel(&mut self, model: &ControlModel, dt: f64) {
        let (b, keep) = (&mut self.belief, felt_keep(model, dt));
        let root = root(&b.p);
        let mut values = [0.0; 2 * N + 1];
        let mut mean = 0.0;
        for (i, value) in values.iter_mut().enumerate() {
            let x = sigma(&b.x, &root, i);
            let thrust_n = model.load(x[SPEED], x[FLOW], x[SWIRL]).thrust_n;
            *value = keep * x[FELT] + (1.0 - keep) * thrust_n;
            mean += weight(i) * *value;
        }
        let mut cross = Vector::zeros();
        let mut variance = 0.0;
        for (i, value) in values.iter().enumerate() {
            let d = value - mean;
            variance += weight(i) * d * d;
            cross += (sigma(&b.x, &root, i) - b.x) * (weight(i) * d);
        }
        b.x[FELT] = mean;
        for i in 0..N {
            (b.p[(i, FELT)], b.p[(FELT, i)]) = (cross[i], cross[i]);
        }
        b.p[(FELT, FELT)] = variance;
    }
}

fn weight(i: usize) -> f64 {
    if i == 0 { CENTRE } else { OTHERS }
}

fn sigma(x: &Vector, root: &Matrix, i: usize) -> Vector {
    match i {
        0 => *x,
        i if i <= N => x + root.column(i - 1),
        i => x - root.column(i - 1 - N),
    }
}

fn weighted(points: &[Vector; 2 * N + 1]) -> Vector {
    points.iter().enumerate().fold(Vector::zeros(), |sum, (i, p)| sum + p * weight(i))
}

/// Lower Cholesky factor of `SPREAD * P`; a pivot that is not positive gives a column of zeros, so
/// that a state without doubt (no swirl) has no spread.
fn root(p: &Matrix) -> Matrix {
    let mut l = Matrix::zeros();
    for j in 0..N {
        let mut pivot = SPREAD * p[(j, j)];
        for k in 0..j {
            pivot -= l[(j, k)] * l[(j, k)];
        }
        if pivot <= 1e-14 * SPREAD * p[(j, j)].abs() || pivot <= 0.0 {
            continue;
        }
        let d = pivot.sqrt();
        l[(j, j)] = d;
        for i in j + 1..N {
            let mut sum = SPREAD * p[(i, j)];
            for k in 0..j {
                sum -= l[(i, k)] * l[(j, k)];
            }
            l[(i, j)] = sum / d;
        }
    }
    l
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_squares_to_the_covariance() {
        let a = Matrix::from_fn(|i, j| ((i * 7 + j * 3) % 5) as f64 - 2.0);
        let p = a * a.transpose() + Matrix::identity();
        let l = root(&p);
        assert!((l * l.transpose() - p * SPREAD).abs().max() < 1e-9);
    }
}
