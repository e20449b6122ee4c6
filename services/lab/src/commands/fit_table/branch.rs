//! One direction of a static table: square laws, motor constants, and the blade they imply.

use kort_thruster::blade::Blade;
use serde::Serialize;

/// Below this duty the points say more about friction and the drive's dead time than about the motor.
const LEAST_DUTY: f64 = 0.15;

/// What the points of one direction give; magnitudes.
#[derive(Clone, Debug, Serialize)]
pub struct Branch {
    /// Moving points.
    pub points: usize,
    /// `T/Om^2`, N s^2.
    pub thrust_n_s2: f64,
    /// `Q/Om^2`, N m s^2.
    pub torque_nm_s2: f64,
    /// Torque constant, N m/A.
    pub torque_constant_nm_a: f64,
    /// Winding resistance with the drive's, ohm.
    pub resistance_ohm: f64,
    /// Largest thrust, N.
    pub largest_thrust_n: f64,
    /// Largest motor current, A.
    pub largest_current_a: f64,
    /// R.m.s. of the thrust left over, percent of the largest.
    pub thrust_error_pct: f64,
    /// R.m.s. of the motor voltage left over, percent of the supply.
    pub voltage_error_pct: f64,
}

impl Branch {
    /// Fits magnitudes of duty, speed, thrust and supply current; `None` with fewer than four points.
    ///
    /// A lossless drive passes power on: `im = I/u`, and `u V = R im + kt Om` is linear in `R` and `kt`.
    pub fn fit(duty: &[f64], speed: &[f64], thrust: &[f64], current: &[f64], supply_v: f64) -> Option<Self> {
        let finite = |i: &usize| [duty, speed, thrust, current].iter().all(|x| x[*i].is_finite());
        let all: Vec<usize> = (0..speed.len()).filter(finite).collect();
        let driven: Vec<usize> = all.iter().copied().filter(|i| duty[*i] >= LEAST_DUTY).collect();
        if driven.len() < 4 || !supply_v.is_finite() {
            return None;
        }
        let square = |i: usize| speed[i] * speed[i];
        let slope = |y: &dyn Fn(usize) -> f64, rows: &[usize]| {
            rows.iter().map(|i| square(*i) * y(*i)).sum::<f64>()
                / rows.iter().map(|i| square(*i).powi(2)).sum::<f64>()
        };
        let thrust_n_s2 = slope(&|i| thrust[i], &all);
        let motor_a = |i: usize| current[i] / duty[i];
        let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for &i in &driven {
            let (a, b, y) = (motor_a(i), speed[i], duty[i] * supply_v);
            aa += a * a;
            ab += a * b;
            bb += b * b;
            ay += a * y;
            by += b * y;
        }
        let det = aa * bb - ab * ab;
        let resistance_ohm = (ay * bb - by * ab) / det;
        let torque_constant_nm_a = (by * aa - ay * ab) / det;
        let rms = |rows: &[usize], e: &dyn Fn(usize) -> f64| {
            (rows.iter().map(|i| e(*i).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
        };
        let largest_thrust_n = all.iter().map(|i| thrust[*i]).fold(0.0, f64::max);
        Some(Self {
            points: all.len(),
            thrust_n_s2,
            torque_nm_s2: slope(&|i| torque_constant_nm_a * motor_a(i), &driven),
            torque_constant_nm_a,
            resistance_ohm,
            largest_thrust_n,
            largest_current_a: driven.iter().map(|i| motor_a(*i)).fold(0.0, f64::max),
            thrust_error_pct: 100.0 * rms(&all, &|i| thrust[i] - thrust_n_s2 * square(i)) / largest_thrust_n,
            voltage_error_pct: 100.0
                * rms(&driven, &|i| {
                    duty[i] * supply_v - resistance_ohm * motor_a(i) - torque_constant_nm_a * speed[i]
                })
                / supply_v,
        })
    }
}

/// What is given beside the table.
pub struct Geometry {
    /// Radius of the duct, m.
    pub radius_m: f64,
    /// Pitch, rad.
    pub pitch_rad: f64,
    /// Density, kg/m^3.
    pub density_kg_m3: f64,
    /// Flux coefficient, 1.
    pub flux_coefficient: f64,
}

impl Geometry {
    fn unit(&self, lift_max: f64, drag_max: f64) -> Blade {
        Blade {
            radius_m: self.radius_m,
            pitch_rad: self.pitch_rad,
            lift_max,
            drag_max,
            density_kg_m3: self.density_kg_m3,
        }
    }

    /// Axial flow over shaft speed, m: (6) at rest.
    fn advance_m(&self, branch: &Branch) -> f64 {
        let flux = self.flux_coefficient * self.density_kg_m3 * self.unit(1.0, 1.0).area_m2();
        (branch.thrust_n_s2 / flux).sqrt()
    }

    /// The one steady inflow angle, rad.
    pub fn inflow_rad(&self, branch: &Branch) -> f64 {
        self.advance_m(branch).atan2(self.unit(1.0, 1.0).lever_m())
    }

    /// `CLmax` and `CDmax` with which Model 2 gives these square laws in bollard pull: at the one
    /// steady inflow both loads are linear in them.
    pub fn blade(&self, branch: &Branch) -> (f64, f64) {
        let load = |blade: Blade| blade.load(blade.inflow(1.0, self.advance_m(branch), 0.0));
        let (l, d) = (load(self.unit(1.0, 0.0)), load(self.unit(0.0, 1.0)));
        let det = l.thrust_n * d.torque_n_m - l.torque_n_m * d.thrust_n;
        let (t, q) = (branch.thrust_n_s2, branch.torque_nm_s2);
        ((t * d.torque_n_m - q * d.thrust_n) / det, (l.thrust_n * q - l.torque_n_m * t) / det)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_back_the_blade_and_motor_that_made_the_table() {
        let geometry =
            Geometry { radius_m: 0.038, pitch_rad: 0.39, density_kg_m3: 998.0, flux_coefficient: 2.0 };
        let (c0, c1, kt, r, supply) = (3.7e-4, 4.2e-6, 0.022, 0.27, 16.0);
        let speed: Vec<f64> = (1..40).map(|i| 9.0 * f64::from(i)).collect();
        let motor: Vec<f64> = speed.iter().map(|om| c1 * om * om / kt).collect();
        let duty: Vec<f64> = speed.iter().zip(&motor).map(|(om, im)| (r * im + kt * om) / supply).collect();
        let thrust: Vec<f64> = speed.iter().map(|om| c0 * om * om).collect();
        let current: Vec<f64> = motor.iter().zip(&duty).map(|(im, u)| im * u).collect();
        let branch = Branch::fit(&duty, &speed, &thrust, &current, supply).unwrap();
        assert!((branch.torque_constant_nm_a / kt - 1.0).abs() < 1e-6);
        assert!((branch.resistance_ohm / r - 1.0).abs() < 1e-6);
        let (lift, drag) = geometry.blade(&branch);
        let text = format!(
            "[propeller]\nradius_m = 0.038\nduct_length_m = 0.04\npitch_rad = 0.39\nlift_max = {lift}\ndrag_max = {drag}\n\
             [flow]\ndensity_kg_m3 = 998\nflux_coefficient = 2\nadded_mass_coefficient = 1\n\
             [motor]\ninertia_kg_m2 = 1e-4\ntorque_constant_nm_a = 0.022\n"
        );
        let rig = kort_thruster::rig::Rig::from_toml(&text).unwrap();
        let (t, q) = kort_thruster::parameters::Parameters::stated(&rig).bollard_coefficients();
        assert!((t / c0 - 1.0).abs() < 1e-6 && (q / c1 - 1.0).abs() < 1e-6, "{t} {q}");
    }
}
