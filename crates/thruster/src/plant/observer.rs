//! A slow observer that keeps the simulated shaft with the recorded one.
//!
//! A free run of what integrates or is unstable (an angle, a pendulum) drifts away from the recording for
//! reasons that are no physics; a pull of about 1 Hz takes that away and leaves what is faster to be seen.
//! What the sensors show is always the prediction, made before the pull; by how much the angle was pulled till then is told
//! with it, for whoever takes rates of it.

use super::{ANGLE, Plant, SPEED, Tick};
use crate::real::Real;

impl<T: Real> Plant<T> {
    /// Pulls the shaft toward [`Tick::observed_angle_rad`], or [`Tick::observed_speed_rad_s`] where no angle
    /// is, or else [`Tick::observed_size_rad_s`], with this bandwidth, rad/s; 0 is off.
    pub fn with_observer(mut self, bandwidth_rad_s: f64) -> Self {
        self.observer_rad_s = bandwidth_rad_s.max(0.0);
        self
    }

    /// At the end of a tick: `Om += w^2 dt e, q += 1.4 w dt e` by the angle's error, `Om += w dt e` by the
    /// speed's alone. The error is of what the sensors show: a late encoder, or one on the motor's side of a spring, does not
    /// say where the shaft is. The encoder does not see the angle's pull as motion.
    #[inline(always)]
    pub(super) fn pull(&mut self, tick: &Tick) {
        let reach = self.observer_rad_s * self.tick_s;
        if reach == 0.0 {
            return;
        }
        let shown = self.sensed();
        if let Some(angle) = tick.observed_angle_rad {
            let behind = T::from(angle) - shown.shaft_angle_rad;
            let by = behind * (1.4 * reach).min(1.0);
            self.x[SPEED] += behind * (reach * self.observer_rad_s);
            self.x[ANGLE] += by;
            self.pulled_rad += by;
            self.counted.shift(by);
        } else if let Some(speed) = tick.observed_speed_rad_s {
            let behind = T::from(speed) - shown.shaft_speed_rad_s;
            self.x[SPEED] += behind * reach.min(1.0);
        } else if let Some(size) = tick.observed_size_rad_s {
            // How fast it turns is known; which way, the model tells.
            let by = (T::from(size) - shown.shaft_speed_rad_s.abs()) * reach.min(1.0);
            self.x[SPEED] += if self.x[SPEED].re() < 0.0 { -by } else { by };
        } else {
            return;
        }
        // The rates at hand are not those of the state that was pulled.
        self.moving = false;
    }
}

#[cfg(test)]
mod tests {
    use crate::models::ModelName;
    use crate::parameters::Parameters;
    use crate::plant::{Plant, Tick};
    use crate::rig::Rig;

    /// Where a shaft ends that turns freely and is observed for two seconds.
    fn ends_at(start_rad_s: f64, tick: &Tick) -> f64 {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let rig = Rig::from_toml(rig).unwrap();
        let mut plant: Plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], 0.002)
            .with_observer(std::f64::consts::TAU);
        plant.start(0.0, start_rad_s, 0.0, 0.0, 0.0);
        (0..1000).for_each(|k| plant.step(&Tick { time_s: 0.002 * f64::from(k), ..*tick }));
        plant.truth().shaft_speed_rad_s
    }

    #[test]
    fn a_speed_without_its_sign_pulls_the_way_the_shaft_turns() {
        let signed = Tick { observed_speed_rad_s: Some(8.0), ..Tick::default() };
        assert!((ends_at(-5.0, &signed) - 8.0).abs() < 0.01);
        let size = Tick { observed_size_rad_s: Some(8.0), ..Tick::default() };
        assert!((ends_at(5.0, &size) - 8.0).abs() < 0.01);
        assert!((ends_at(-5.0, &size) + 8.0).abs() < 0.01);
    }

    /// Under a torque that it does not know, the shaft runs ahead of the recorded one: its speed and the rate of its angle
    /// must tell the same of it.
    #[test]
    fn the_pull_is_no_motion_in_the_rate_of_the_angle() {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let rig = Rig::from_toml(rig).unwrap();
        let w = std::f64::consts::TAU;
        let mut plant: Plant =
            Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], 0.002).with_observer(w);
        let mut before = plant.sensed();
        for k in 0..5000 {
            before = plant.sensed();
            // It stands, and 0.1 N m drive it.
            let tick =
                Tick { time_s: 0.002 * f64::from(k), observed_angle_rad: Some(0.0), ..Tick::default() };
            plant.step(&Tick { command: 0.1, ..tick });
        }
        let now = plant.sensed();
        let moved = (now.shaft_angle_rad - now.pulled_rad) - (before.shaft_angle_rad - before.pulled_rad);
        let speed = now.shaft_speed_rad_s;
        assert!((speed - 1.4 * 10.0 / w).abs() < 0.05 * speed, "{speed}");
        assert!((moved / 0.002 - speed).abs() < 0.01 * speed, "{} {speed}", moved / 0.002);
    }
}
