//! Runge-Kutta of order 4 over states of fixed size: no allocation, nothing to configure.

/// One classic Runge-Kutta step of size `dt_s` for `x' = rates(t, x)`.
///
/// The local error is of order 5, the global one of order 4, as long as `rates` is smooth; input
/// jumps belong on step boundaries.
#[inline(always)]
pub fn rk4<const N: usize>(
    x: [f64; N],
    time_s: f64,
    dt_s: f64,
    rates: impl Fn(f64, &[f64; N]) -> [f64; N],
) -> [f64; N] {
    let half = 0.5 * dt_s;
    let along = |k: &[f64; N], by: f64| -> [f64; N] { std::array::from_fn(|i| x[i] + by * k[i]) };
    let k1 = rates(time_s, &x);
    let k2 = rates(time_s + half, &along(&k1, half));
    let k3 = rates(time_s + half, &along(&k2, half));
    let k4 = rates(time_s + dt_s, &along(&k3, dt_s));
    std::array::from_fn(|i| x[i] + dt_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
}

#[cfg(test)]
mod tests {
    use super::rk4;

    #[test]
    fn error_falls_with_the_fourth_power_of_the_step() {
        // x'' = -x over one second.
        let error = |steps: u32| {
            let dt = 1.0 / f64::from(steps);
            let x = (0..steps).fold([1.0, 0.0], |x, _| rk4(x, 0.0, dt, |_, x| [x[1], -x[0]]));
            (x[0] - 1f64.cos()).hypot(x[1] + 1f64.sin())
        };
        let order = (error(10) / error(20)).log2();
        assert!((order - 4.0).abs() < 0.1, "{order}");
    }
}
