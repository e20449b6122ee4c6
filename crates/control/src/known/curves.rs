//! What known effects make of friction and of the blades' coefficients, as tables of fixed size: one look-up
//! a use, no allocation, and the same for any effect that acts there.

use kort_thruster::blade::Inflow;
use kort_thruster::plant::Foil;

/// Points of a friction table.
const SPEEDS: usize = 33;
/// Points of a table over the inflow's angle.
const ANGLES: usize = 121;

/// Friction beyond the stated viscous one over shaft speed, ahead and astern; positive opposes turning ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionCurve {
    top_rad_s: f64,
    ahead_n_m: [f64; SPEEDS],
    astern_n_m: [f64; SPEEDS],
}

impl FrictionCurve {
    /// From what opposes the shaft as it turns at a speed, rad/s; asked just beyond zero on both sides. `None`
    /// where nothing does.
    pub fn of(top_rad_s: f64, torque_n_m: impl Fn(f64) -> f64) -> Option<Self> {
        let speed = |k: usize| top_rad_s * ((k as f64 / (SPEEDS - 1) as f64).powi(2)).max(1e-9);
        let side = |sign: f64| std::array::from_fn(|k| torque_n_m(sign * speed(k)));
        let curve = Self { top_rad_s, ahead_n_m: side(1.0), astern_n_m: side(-1.0) };
        let some = curve.ahead_n_m.iter().chain(&curve.astern_n_m).any(|t| *t != 0.0);
        some.then_some(curve)
    }

    /// Friction at a speed, N m. `turning`, -1 to 1, is the smoothed sign of the speed: what jumps at standstill
    /// goes over with it.
    pub fn at_n_m(&self, speed_rad_s: f64, turning: f64) -> f64 {
        let table = if speed_rad_s < 0.0 { &self.astern_n_m } else { &self.ahead_n_m };
        // The points lie closer near standstill, where friction bends.
        let place = (speed_rad_s.abs() / self.top_rad_s).sqrt() * (SPEEDS - 1) as f64;
        let k = (place as usize).min(SPEEDS - 2);
        let (low, high) =
            (((k as f64) / (SPEEDS - 1) as f64).powi(2), ((k + 1) as f64 / (SPEEDS - 1) as f64).powi(2));
        let part = ((speed_rad_s.abs() / self.top_rad_s - low) / (high - low)).clamp(0.0, 1.0);
        let friction = table[k] + (table[k + 1] - table[k]) * part;
        let rest = 0.5 * (self.ahead_n_m[0] + self.astern_n_m[0]);
        rest + (friction - rest) * turning.abs()
    }
}

/// What is added to lift and drag coefficients over the inflow's angle, -pi to pi.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoilCurve {
    lift: [f64; ANGLES],
    drag: [f64; ANGLES],
}

impl FoilCurve {
    /// From additions to lift and drag at an angle, rad; `None` where they vanish everywhere.
    pub fn of(additions: impl Fn(f64) -> (f64, f64)) -> Option<Self> {
        let at = |k: usize| additions(std::f64::consts::TAU * (k as f64 / (ANGLES - 1) as f64 - 0.5));
        let curve = Self { lift: std::array::from_fn(|k| at(k).0), drag: std::array::from_fn(|k| at(k).1) };
        curve.lift.iter().chain(&curve.drag).any(|x| x.abs() > 1e-6).then_some(curve)
    }

    /// Puts the additions to a section in an inflow.
    pub fn add(&self, foil: &mut Foil, inflow: Inflow) {
        let place = (inflow.angle_rad() / std::f64::consts::TAU + 0.5) * (ANGLES - 1) as f64;
        let k = (place.max(0.0) as usize).min(ANGLES - 2);
        let part = (place - k as f64).clamp(0.0, 1.0);
        let mix = |table: &[f64; ANGLES]| table[k] + (table[k + 1] - table[k]) * part;
        foil.lift += mix(&self.lift);
        foil.drag += mix(&self.drag);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_that_of_its_function_and_goes_over_at_rest() {
        let law = |w: f64| {
            0.3 * w.signum() * (1.0 + 0.5 * (-(w / 2.0_f64).powi(2)).exp()) + 0.001 * w * w.abs() + 0.05
        };
        let curve = FrictionCurve::of(100.0, law).unwrap();
        for w in [-90.0, -20.0, -3.0, 0.7, 5.0, 40.0, 99.0] {
            assert!(
                (curve.at_n_m(w, f64::signum(w)) - law(w)).abs() < 0.02,
                "{w} {}",
                curve.at_n_m(w, w.signum())
            );
        }
        assert!((curve.at_n_m(0.0, 0.0) - 0.05).abs() < 1e-9);
        assert_eq!(FrictionCurve::of(100.0, |_| 0.0), None);
    }
}
