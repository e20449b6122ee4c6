//! Shaft and drive as the model has them, led to a wanted speed as fast as the drive's limits let it.
//!
//! The drive's lag is inverted: the command that brings the current where it is wanted one period later,
//! held within current, slew and supply. What this gives is feedforward that is there when the shaft
//! needs it, and the speed that a thruster like the model then has, for feedback to compare with
//! (model following with two degrees of freedom; anti-windup is built in, as the model meets the same limits).
//!
//! How fast follows from the drive ([`Pace`]): a shaft that closes in at no more than one and a half over the
//! drive's lag can always be braked in time by a current that is behind that lag.

use kort_thruster::rig::AmplifierKind;

use crate::model::ControlModel;

/// How fast a shaft closes in on its target, as a multiple of one over the drive's lag.
const PER_LAG: f64 = 2.0;
/// The same for a drive with a speed loop of its own, which answers without overshoot.
const PER_SPEED_LAG: f64 = 3.0;
/// Fastest, as a multiple of one over the control period.
const PER_PERIOD: f64 = 0.25;
/// Share of the current that feedforward leaves to feedback.
const KEPT: f64 = 0.03;

/// How fast the shaft of a rig can be led.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Rate at which the shaft closes in on its target, 1/s.
    pub shaft_per_s: f64,
}

impl Pace {
    /// From drive and control period.
    pub fn of(model: &ControlModel) -> Self {
        let per_lag = if model.amplifier == AmplifierKind::Speed { PER_SPEED_LAG } else { PER_LAG };
        let drive = per_lag / model.amplifier_lag_s.max(1e-6);
        Self { shaft_per_s: drive.min(PER_PERIOD / model.period_s) }
    }
}

/// The water that the shaft turns in.
#[derive(Clone, Copy, Debug)]
pub struct Meets {
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Swirl, m/s.
    pub swirl_m_s: f64,
    /// Load that the model does not explain, N m; it opposes the turning shaft where positive.
    pub load_n_m: f64,
    /// Supply, V, where known.
    pub supply_v: Option<f64>,
}

/// What is asked of the drive for a period.
#[derive(Clone, Copy, Debug, Default)]
pub struct Led {
    /// Torque asked of the drive, N m.
    pub torque_n_m: f64,
    /// Speed asked of a drive that closes its own loop, rad/s.
    pub speed_command_rad_s: f64,
    /// Speed that the shaft has after the period, rad/s.
    pub speed_rad_s: f64,
}

/// A shaft that is led.
#[derive(Clone, Copy, Debug)]
pub struct Lead {
    pace: Pace,
    speed_rad_s: f64,
    current_a: f64,
    command_a: f64,
}

impl Lead {
    /// At rest.
    pub fn new(model: &ControlModel) -> Self {
        Self { pace: Pace::of(model), speed_rad_s: 0.0, current_a: 0.0, command_a: 0.0 }
    }

    /// How fast it closes in.
    pub fn pace(&self) -> Pace {
        self.pace
    }

    /// Starts again from a shaft that turns under a current.
    pub fn reset(&mut self, speed_rad_s: f64, current_a: f64) {
        self.put(speed_rad_s, current_a);
        self.command_a = current_a;
    }

    /// Sets speed and current; the drive's slew goes on from the last command.
    pub fn put(&mut self, speed_rad_s: f64, current_a: f64) {
        (self.speed_rad_s, self.current_a) = (speed_rad_s, current_a);
    }

    /// One period towards a wanted speed that itself moves at a rate, rad/s^2.
    pub fn step(
        &mut self,
        model: &ControlModel,
        wanted_rad_s: f64,
        rate: f64,
        meets: &Meets,
        dt_s: f64,
    ) -> Led {
        // A model that ran away, as under a loop slower than its shaft, begins again from rest: no number has no bounds.
        if ![self.speed_rad_s, self.current_a, self.command_a].iter().all(|state| state.is_finite()) {
            self.reset(0.0, 0.0);
        }
        let (kt, inertia, limit) = (model.torque_constant_nm_a, model.inertia_kg_m2, model.current_limit_a);
        let speed = self.speed_rad_s;
        let load = model.load(speed, meets.flow_m_s, meets.swirl_m_s).torque_n_m
            + model.friction_n_m(speed)
            + meets.load_n_m * model.sense(speed);
        let wish = rate + self.pace.shaft_per_s.min(0.5 / dt_s) * (wanted_rad_s - speed);
        let most = (1.0 - KEPT) * limit;
        let keep = if model.amplifier_lag_s > 0.0 { (-dt_s / model.amplifier_lag_s).exp() } else { 0.0 };
        let wish_a = ((load + inertia * wish) / kt).clamp(-most, most);
        if model.amplifier == AmplifierKind::Speed {
            // The drive's own loop has no more current than this either.
            let next = speed + (kt * wish_a - load) / inertia * dt_s;
            let cap = model.speed_max_rad_s;
            let command = ((next - keep * speed) / (1.0 - keep)).clamp(-cap, cap);
            self.speed_rad_s = command + (speed - command) * keep;
            return Led {
                torque_n_m: kt * wish_a,
                speed_command_rad_s: command,
                speed_rad_s: self.speed_rad_s,
            };
        }
        let mut command = ((wish_a - keep * self.current_a) / (1.0 - keep)).clamp(-most, most);
        if let (Some(r), Some(supply)) = (model.winding_resistance_ohm, meets.supply_v.or(model.supply_v))
            && r > 0.0
        {
            let emf = kt * speed;
            command = command.clamp(((-supply - emf) / r).min(0.0), ((supply - emf) / r).max(0.0));
        }
        let reach = model.current_rate_a_s * dt_s;
        self.command_a = command.clamp(self.command_a - reach, self.command_a + reach);
        let current = self.command_a + (self.current_a - self.command_a) * keep;
        self.speed_rad_s += (0.5 * kt * (current + self.current_a) - load) / inertia * dt_s;
        self.current_a = current;
        Led {
            torque_n_m: kt * self.command_a,
            speed_command_rad_s: self.speed_rad_s,
            speed_rad_s: self.speed_rad_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use super::{Lead, Meets};
    use crate::model::ControlModel;

    #[test]
    fn a_model_that_ran_away_begins_again_from_rest() {
        let rig =
            Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let model = ControlModel::from_rig(&rig, 0.002).unwrap();
        let meets = Meets { flow_m_s: 0.0, swirl_m_s: 0.0, load_n_m: 0.0, supply_v: None };
        for lost in [f64::NAN, f64::INFINITY] {
            let mut lead = Lead::new(&model);
            lead.reset(lost, lost);
            let led = lead.step(&model, 10.0, 0.0, &meets, 0.002);
            assert!(led.torque_n_m > 0.0 && led.speed_rad_s.is_finite(), "{led:?}");
        }
    }
}
