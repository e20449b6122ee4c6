//! Passing over time in which nobody looks: an hour is not simulated tick by tick for the sake of a few minutes.
//!
//! What is slow (a winding's heat, warming grease, a tank's return flow) runs on under what the recording says went
//! on meanwhile; everything else starts anew from the recorded state and has forgotten that soon.

use super::{ANGLE, FLOW, Local, Plant, SPEED};
use crate::plant::Balance;
use crate::real::Real;

/// Step of the slow states, s: the shortest of their time constants is twice as long.
const STEP_S: f64 = 0.25;
/// After this long, s, what is slow has settled too: five of the longest time constants.
const SETTLED_S: f64 = 15_000.0;
/// Most states of a slow effect.
const MOST: usize = 4;

/// Time passed over. What the recording does not hold stays as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leap {
    /// Control tick at which the simulation goes on, by its place among those that are simulated.
    pub tick: usize,
    /// Shaft speed, axial flow, current and shaft angle there: rad/s, m/s, A, rad.
    pub state: [Option<f64>; 4],
    /// Mean size of the shaft speed meanwhile, rad/s.
    pub speed_rad_s: Option<f64>,
    /// Mean axial flow meanwhile, m/s.
    pub flow_m_s: Option<f64>,
    /// Root mean square of the current meanwhile, A.
    pub current_a: Option<f64>,
}

impl<T: Real> Plant<T> {
    /// Goes on at another instant, s.
    pub fn leap(&mut self, to_s: f64, leap: &Leap) {
        let or = |seen: Option<f64>, now: T| seen.map_or(now, T::from);
        let meanwhile = Local {
            shaft_speed_rad_s: or(leap.speed_rad_s, self.at.shaft_speed_rad_s),
            axial_m_s: or(leap.flow_m_s, self.at.axial_m_s),
            current_a: or(leap.current_a, self.at.current_a),
            ..self.at
        };
        let passed_s = (to_s - self.time_s).clamp(0.0, SETTLED_S);
        let steps = (passed_s / STEP_S).ceil().max(1.0);
        let step_s = passed_s / steps;
        for hooked in self.effects.iter().filter(|h| h.effect.slow() && !h.own.is_empty()) {
            let own = &mut self.x[hooked.own.clone()];
            for _ in 0..steps as usize {
                let mut rates = [T::ZERO; MOST];
                hooked.effect.balance(&meanwhile, own, &mut Balance::default(), &mut rates[..own.len()]);
                for (state, rate) in own.iter_mut().zip(rates) {
                    *state += rate * step_s;
                }
            }
        }
        let [speed, flow, current, angle] = leap.state;
        let now = [self.x[SPEED], self.x[FLOW], self.current_a, self.x[ANGLE]].map(T::re);
        self.start(
            to_s,
            speed.unwrap_or(now[0]),
            flow.unwrap_or(now[1]),
            current.unwrap_or(now[2]),
            angle.unwrap_or(now[3]),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::Leap;
    use crate::effects::thermal_drift_kt;
    use crate::models::ModelName;
    use crate::parameters::Parameters;
    use crate::plant::{Plant, Tick};
    use crate::rig::Rig;

    /// A motor that a load holds at 10 A, whose magnets warm within a minute; torque per ampere shows in its speed.
    fn speed_after(simulated_s: f64, passed_s: f64) -> f64 {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
                   viscous_friction_nm_s = 0.1\n";
        let rig = Rig::from_toml(rig).unwrap();
        let values = [0.003, 60.0];
        let effects: [(&_, &[f64]); 1] = [(&thermal_drift_kt::DESCRIPTOR, &values)];
        let mut plant: Plant =
            Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &effects, 0.002);
        let run = |plant: &mut Plant, from_s: f64, seconds: f64| {
            for i in 0..(seconds / 0.002) as usize {
                plant.step(&Tick { time_s: from_s + 0.002 * i as f64, command: 10.0, ..Tick::default() });
            }
        };
        run(&mut plant, 0.0, simulated_s);
        if passed_s > 0.0 {
            let to_s = simulated_s + passed_s;
            plant.leap(
                to_s,
                &Leap { current_a: Some(10.0), state: [Some(90.0), None, None, None], ..Leap::default() },
            );
            run(&mut plant, to_s, 2.0);
        }
        plant.truth().shaft_speed_rad_s
    }

    #[test]
    fn what_is_slow_runs_on_and_what_is_fast_forgets() {
        let (cold, simulated, leapt) =
            (speed_after(2.0, 0.0), speed_after(62.0, 0.0), speed_after(2.0, 58.0));
        assert!(cold - simulated > 10.0, "it warms: {cold} {simulated}");
        assert!((simulated - leapt).abs() < 0.1, "{simulated} {leapt}");
    }
}
