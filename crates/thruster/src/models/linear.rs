//! A model for small motions about a state: poles and gains.

use nalgebra::DMatrix;

use super::steady::jacobian;
use crate::blade::BladeLoad;

/// `dx' = A dx + b du`; `dT = c_T dx + d_T du` and the same for blade torque. `u` is what acts:
/// torque, current, voltage or shaft speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear<const N: usize> {
    /// `A`, 1/s and mixed units, states in the model's order.
    pub a: [[f64; N]; N],
    /// `b`
    pub b: [f64; N],
    /// Thrust over the states, N per unit.
    pub thrust: [f64; N],
    /// Thrust over the input directly, N per unit.
    pub thrust_direct: f64,
    /// Blade torque over the states, N m per unit.
    pub torque: [f64; N],
    /// Blade torque over the input directly, N m per unit.
    pub torque_direct: f64,
}

/// A pole, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pole {
    /// Real part, 1/s; negative is stable.
    pub re: f64,
    /// Imaginary part, rad/s.
    pub im: f64,
}

impl<const N: usize> Linear<N> {
    pub(super) fn about(
        x: [f64; N],
        rates: impl Fn(&[f64; N], f64) -> [f64; N],
        load: impl Fn(&[f64; N], f64) -> BladeLoad,
    ) -> Self {
        let still = jacobian(&x, &|x: &[f64; N]| rates(x, 0.0));
        let h = 1e-5;
        let (up, down) = (rates(&x, h), rates(&x, -h));
        let (high, low) = (load(&x, h), load(&x, -h));
        let mut thrust = [0.0; N];
        let mut torque = [0.0; N];
        for j in 0..N {
            let step = 1e-6 * (1e-3 + x[j].abs());
            let at = |by: f64| {
                let mut y = x;
                y[j] += by;
                load(&y, 0.0)
            };
            let (high, low) = (at(step), at(-step));
            thrust[j] = (high.thrust_n - low.thrust_n) / (2.0 * step);
            torque[j] = (high.torque_n_m - low.torque_n_m) / (2.0 * step);
        }
        Self {
            a: std::array::from_fn(|i| std::array::from_fn(|j| still[(i, j)])),
            b: std::array::from_fn(|i| (up[i] - down[i]) / (2.0 * h)),
            thrust,
            thrust_direct: (high.thrust_n - low.thrust_n) / (2.0 * h),
            torque,
            torque_direct: (high.torque_n_m - low.torque_n_m) / (2.0 * h),
        }
    }

    /// Poles, slowest first.
    pub fn poles(&self) -> Vec<Pole> {
        if N == 0 {
            return Vec::new();
        }
        let mut poles: Vec<Pole> =
            self.matrix().complex_eigenvalues().iter().map(|z| Pole { re: z.re, im: z.im }).collect();
        poles.sort_by(|a, b| b.re.total_cmp(&a.re).then(b.im.total_cmp(&a.im)));
        poles
    }

    /// Steady change of thrust for a unit of input, N per unit; `None` with a pole at zero.
    pub fn thrust_gain(&self) -> Option<f64> {
        self.gain(&self.thrust, self.thrust_direct)
    }

    /// Steady change of blade torque for a unit of input, N m per unit; `None` with a pole at zero.
    pub fn torque_gain(&self) -> Option<f64> {
        self.gain(&self.torque, self.torque_direct)
    }

    fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(N, N, |i, j| self.a[i][j])
    }

    fn gain(&self, c: &[f64; N], direct: f64) -> Option<f64> {
        if N == 0 {
            return Some(direct);
        }
        let b = nalgebra::DVector::from_column_slice(&self.b);
        let x = self.matrix().lu().solve(&b)?;
        Some(direct - c.iter().zip(x.iter()).map(|(c, x)| c * x).sum::<f64>())
    }
}
