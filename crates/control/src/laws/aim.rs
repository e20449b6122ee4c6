//! The shaft speed that gives a thrust in the flow that the shaft will meet.
//!
//! Thrust depends on speed and flow; speed follows the drive, flow follows thrust at a rate of its own. What
//! counts is the flow when the shaft arrives: with a slow flow (a 26 cm duct, 10/s) that is the flow now,
//! with a fast one (a 76 mm duct, 200/s) it is nearly that of the steady state. Between the two the
//! momentum balance decides, at the thrust asked for and over the time that the shaft takes
//! (singular perturbation: the faster of the two is taken as settled by as much as it is).
//!
//! `m v' = Td - dbeta rho a (v - va)|v|`, linearly implicit, so that any ratio of the two is safe.

use crate::model::ControlModel;
use crate::signals::Estimate;

/// Steps of the balance over the time that the shaft takes.
const STEPS: u32 = 2;

/// The aim of a law.
#[derive(Clone, Copy, Debug, Default)]
pub struct Aim {
    speed_rad_s: f64,
}

/// Where to aim.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Shaft speed, rad/s.
    pub speed_rad_s: f64,
    /// It would be more than the thruster is meant to turn.
    pub capped: bool,
    /// Rate of the shaft speed by that of thrust, rad/s per N/s, at the aim.
    pub by_thrust: f64,
}

impl Aim {
    /// From a thrust, N, over the time in which the shaft arrives, s.
    pub fn at(&mut self, model: &ControlModel, estimate: &Estimate, thrust_n: f64, arrives_s: f64) -> Target {
        let swirl = estimate.swirl_m_s.value;
        let flow = arriving(model, estimate.flow_m_s.value, estimate.ambient_m_s.value, thrust_n, arrives_s);
        // What the blades give beyond the model need not be asked of it.
        let of_model = thrust_n / (1.0 + estimate.thrust_surplus);
        let wanted = model.speed_for_thrust_rad_s(of_model, flow, swirl, self.speed_rad_s);
        let cap = 1.1 * model.speed_max_rad_s;
        self.speed_rad_s = wanted.clamp(-cap, cap);
        let slopes = model.slopes(model.blade.inflow(self.speed_rad_s, flow, swirl));
        let slope = slopes.thrust_by_tangential * model.blade.lever_m();
        // Near standstill thrust hardly depends on speed, and its rate says nothing of the shaft's.
        let least = 0.2 * model.map.thrust_n_s2 * model.speed_max_rad_s;
        Target {
            speed_rad_s: self.speed_rad_s,
            capped: self.speed_rad_s != wanted,
            by_thrust: 1.0 / slope.max(least),
        }
    }
}

/// Axial flow after a time under a constant thrust, m/s.
pub fn arriving(model: &ControlModel, flow_m_s: f64, ambient_m_s: f64, thrust_n: f64, after_s: f64) -> f64 {
    let flux = model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
    let h = after_s / f64::from(STEPS);
    let mut v = flow_m_s;
    for _ in 0..STEPS {
        let rate = model.flow_acceleration(thrust_n, v, ambient_m_s);
        // Slope of the outflow; from rest the flow the thrust will make sets it.
        let made = (thrust_n.abs() / flux).sqrt();
        let damping = flux * (v.abs() + (v - ambient_m_s).abs()).max(made) / model.added_mass_kg;
        v += h * rate / (1.0 + h * damping);
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::stand;

    #[test]
    fn a_flow_with_time_is_the_steady_one_and_without_it_is_the_present_one() {
        let model = stand();
        let speed = 50.0;
        let (thrust, steady) = (model.map.thrust_n(speed), model.map.flow_m * speed);
        assert_eq!(arriving(&model, 0.3, 0.0, thrust, 0.0), 0.3);
        assert!((arriving(&model, steady, 0.0, thrust, 0.5) / steady - 1.0).abs() < 1e-9);
        let mut v = 0.0;
        for _ in 0..20 {
            v = arriving(&model, v, 0.0, thrust, 10.0);
        }
        assert!((v / steady - 1.0).abs() < 1e-6, "{v} {steady}");
    }

    #[test]
    fn it_agrees_with_the_balance_in_small_steps() {
        let model = stand();
        let (mut v, after) = (0.2, 0.03);
        for _ in 0..3000 {
            v += model.flow_acceleration(100.0, v, 0.1) * after / 3000.0;
        }
        let ours = arriving(&model, 0.2, 0.1, 100.0, after);
        // Two linearly implicit steps: a tenth short at most.
        assert!((ours - v).abs() < 0.1 * (v - 0.2).abs(), "{ours} {v}");
    }

    #[test]
    fn the_aim_gives_the_thrust_in_the_flow_now_when_the_shaft_is_quick() {
        let model = stand();
        let mut estimate = Estimate::default();
        estimate.flow_m_s.value = 0.4;
        let target = Aim::default().at(&model, &estimate, 80.0, 0.0);
        assert!((model.load(target.speed_rad_s, 0.4, 0.0).thrust_n - 80.0).abs() < 1e-3 && !target.capped);
        // Blades that give a twentieth more are asked for that much less.
        estimate.thrust_surplus = 0.05;
        let target = Aim::default().at(&model, &estimate, 80.0, 0.0);
        assert!((1.05 * model.load(target.speed_rad_s, 0.4, 0.0).thrust_n - 80.0).abs() < 1e-3);
    }
}
