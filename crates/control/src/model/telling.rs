//! What an error of the blades' torque tells of their thrust, where no sensor measures thrust.
//!
//! Lift, drag, pitch and outflow are stated with tolerances, and so is the torque constant that the torque is known by.
//! Each moves thrust and torque in a way of its own; of a torque that is off, the likeliest share in thrust
//! is the regression over all of them, `b = sum(Tk Qk sk^2) / sum(Qk^2 sk^2)`, `Tk` and `Qk` the relative change by
//! a relative change of `k`, `sk` its tolerance (linear Gaussian estimate). A blade that errs in pitch or outflow gives
//! thrust with its torque (`b` about a half on a T200); where only the torque constant is in doubt it is 0.

use kort_thruster::rig::{Quantity, Rig};

use super::ControlModel;

/// Relative change that sensitivities are taken over.
const STEP: f64 = 1e-3;

impl ControlModel {
    /// Thrust over unexplained torque of the blades, N/(N m); 0 where a force sensor tells the thrust itself.
    pub(super) fn thrust_told_by_torque(&self, rig: &Rig) -> f64 {
        if rig.sensors.thrust_sensor {
            return 0.0;
        }
        let Some(propeller) = &rig.propeller else { return 0.0 };
        let doubt = |q: &Quantity| q.tol.unwrap_or(0.0);
        let changed = |change: fn(&mut Self)| {
            let mut other = *self;
            change(&mut other);
            other.refresh();
            let map = other.map;
            [
                (map.thrust_n_s2 / self.map.thrust_n_s2 - 1.0) / STEP,
                (map.torque_n_m_s2 / self.map.torque_n_m_s2 - 1.0) / STEP,
            ]
        };
        let sources = [
            (changed(|m| m.blade.lift_max *= 1.0 + STEP), doubt(&propeller.lift_max)),
            (changed(|m| m.blade.drag_max *= 1.0 + STEP), doubt(&propeller.drag_max)),
            (changed(|m| m.blade.pitch_rad *= 1.0 + STEP), doubt(&propeller.pitch_rad)),
            (changed(|m| m.flux_coefficient *= 1.0 + STEP), doubt(&rig.flow.flux_coefficient)),
            ([0.0, 1.0], doubt(&rig.motor.torque_constant_nm_a)),
        ];
        let sum = |of: fn([f64; 2]) -> f64| sources.iter().map(|(by, s)| of(*by) * s * s).sum::<f64>();
        let (both, torque) = (sum(|[t, q]| t * q), sum(|[_, q]| q * q));
        if torque > 0.0 { both / torque * self.map.thrust_n_s2 / self.map.torque_n_m_s2 } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLIND: &str = include_str!("../../../../config/thrusters/t200-vehicle.toml");

    fn share(text: &str) -> f64 {
        let model = ControlModel::from_rig(&Rig::from_toml(text).unwrap(), 1e-3).unwrap();
        model.thrust_per_torque_1_m * model.map.torque_n_m_s2 / model.map.thrust_n_s2
    }

    #[test]
    fn blades_in_doubt_give_thrust_with_their_torque_and_a_torque_constant_in_doubt_does_not() {
        let stated = share(BLIND);
        assert!((0.35..0.65).contains(&stated), "{stated}");
        let motor = BLIND.replace("{ value = 0.02461, tol = 0.2 }", "{ value = 0.02461, tol = 2.0 }");
        assert_ne!(motor, BLIND);
        assert!(share(&motor) < 0.2 * stated, "{}", share(&motor));
    }

    #[test]
    fn a_force_sensor_tells_thrust_itself() {
        assert_eq!(share(&BLIND.replace("thrust = \"none\"", "")), 0.0);
    }

    /// Why no law without a force sensor wins back lift that a T200 loses: its torque hardly knows.
    #[test]
    fn lost_lift_takes_thrust_and_hardly_any_torque() {
        let model = ControlModel::from_rig(&Rig::from_toml(BLIND).unwrap(), 1e-3).unwrap();
        let mut struck = model;
        struck.blade.lift_max *= 0.7;
        struck.refresh();
        let (thrust, torque) = (
            struck.map.thrust_n_s2 / model.map.thrust_n_s2 - 1.0,
            struck.map.torque_n_m_s2 / model.map.torque_n_m_s2 - 1.0,
        );
        println!("lift -30 %: thrust {:.1} %, torque {:.1} %", 100.0 * thrust, 100.0 * torque);
        assert!(thrust < -0.15 && torque > -0.03, "{thrust} {torque}");
    }
}
