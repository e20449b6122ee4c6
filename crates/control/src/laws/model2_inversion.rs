//! Model 2 inverted, with the drive.
//!
//! Reference: Healey et al. 1995 for the model; docs/control.md D5 for the law: `Omr` from `T(Omr, v) = Td` in the
//! flow that the shaft will meet ([`super::aim`]), and a model of shaft and drive led there within the drive's
//! limits ([`super::lead`]): `tau = Q + friction + I Om'` behind the inverted lag of the drive, and
//! `kfb (Omm - Om)` with an integral on what the model does not know.
//! The cascade is input-to-state stable if the flow estimate's error is bounded.
//!
//! How far it looks ahead follows from the rig: a drive that is slow beside its water makes it a servo on the
//! steady map (with the observed ambient flow), one that is fast an inversion in the present flow.
//!
//! Assumes: blade coefficients, inertia, torque constant and the drive's lag known.
//! Needs measured: shaft speed; current, thrust or flow sharpen `v^`.
//!
//! Fails: as `model3_inversion` for errors of `v^` and blade coefficients; a wrong torque constant
//! or unknown friction is taken up by the servo's integral, slowly.

use super::aim::Aim;
use super::lead::{Lead, Led, Meets};
use super::speed_loop::{MatchedTarget, ServoOptions, SpeedLoop};
use super::{Demand, LawInput};
use crate::limits::{Limit, LimitSet};
use crate::model::ControlModel;

/// A running Model 2 inversion.
#[derive(Clone, Copy, Debug)]
pub struct Model2Inversion {
    servo: SpeedLoop,
    matched: MatchedTarget,
    aim: Aim,
    lead: Lead,
    last_thrust_n: Option<f64>,
}

impl Model2Inversion {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ServoOptions) -> Self {
        Self {
            servo: SpeedLoop::new(model, options),
            matched: MatchedTarget::behind_sensors(model),
            aim: Aim::default(),
            lead: Lead::new(model),
            last_thrust_n: None,
        }
    }

    /// Torque of the inverted model.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let (model, estimate, dt) = (input.model, input.estimate, input.dt_s);
        let speed = input.speed_rad_s();
        let last = self.last_thrust_n.replace(input.thrust_n).unwrap_or_else(|| {
            self.lead.reset(speed, input.measured.current_a.unwrap_or(0.0));
            self.matched.reset(speed);
            input.thrust_n
        });
        let arrives_s = 1.0 / self.lead.pace().shaft_per_s + model.delay_s;
        let target = self.aim.at(model, estimate, input.thrust_n, arrives_s);
        let mut limits = LimitSet::default();
        if target.capped {
            limits.set(Limit::ShaftSpeed);
        }
        let meets = Meets {
            flow_m_s: estimate.flow_m_s.value,
            swirl_m_s: estimate.swirl_m_s.value,
            load_n_m: estimate.load_torque_n_m.value * model.sense(estimate.shaft_speed_rad_s.value),
            supply_v: input.measured.supply_v,
        };
        let rate = target.by_thrust * (input.thrust_n - last) / dt;
        let Led { torque_n_m, speed_command_rad_s, speed_rad_s } =
            self.lead.step(model, target.speed_rad_s, rate, &meets, dt);
        let seen = self.matched.step(speed_rad_s, dt);
        let torque = self.servo.tick(torque_n_m, seen, speed, dt);
        Demand { torque_n_m: torque, speed_rad_s: speed_command_rad_s, limits }
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.servo.settle(applied_n_m, dt_s);
    }
}
