//! Control laws: thrust reference in, motor torque out.
//!
//! A law never limits itself to the drive: it asks, the controller limits, and the law is then
//! told what was applied ([`Law::settle`]) so that its integrators follow.

pub mod aim;
mod combined_anti_spin;
pub mod lead;
mod look_ahead;
mod model1_inversion;
mod model2_inversion;
mod model3_inversion;
mod power_control;
mod rotational_flow_inversion;
mod speed_loop;
mod static_map;
mod thrust_pi;
mod torque_control;
mod trimmed_model2_inversion;
mod velocity_servo;

use serde::{Deserialize, Serialize};

use crate::limits::LimitSet;
use crate::model::ControlModel;
use crate::signals::{Estimate, Measurement};

pub use combined_anti_spin::AntiSpinOptions;
pub use look_ahead::LookAheadOptions;
pub use rotational_flow_inversion::RotationalFlowOptions;
pub use speed_loop::{ServoOptions, SpeedLoop};
pub use thrust_pi::ThrustPiOptions;
pub use trimmed_model2_inversion::TrimOptions;

/// Which control law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LawKind {
    /// Open-loop torque from the static map.
    StaticMap,
    /// Speed servo with feedforward, (21) of the paper.
    #[default]
    VelocityServo,
    /// Yoerger's one-state model, inverted.
    Model1Inversion,
    /// Shaft and flow model, inverted to torque.
    Model2Inversion,
    /// Flow model, inverted to speed for the servo.
    Model3Inversion,
    /// Model 2 with rotational flow, inverted to torque.
    RotationalFlowInversion,
    /// Torque control after Smogeli.
    TorqueControl,
    /// Power control after Smogeli.
    PowerControl,
    /// Torque and power combined, with anti-spin, after Smogeli.
    CombinedAntiSpin,
    /// PI on the force sensor.
    ThrustPi,
    /// Model 2 inversion trimmed by the force sensor.
    TrimmedModel2Inversion,
    /// Predictive control under current and slew limits.
    LookAhead,
}

impl LawKind {
    /// Every law.
    pub const ALL: [Self; 12] = [
        Self::StaticMap,
        Self::VelocityServo,
        Self::Model1Inversion,
        Self::Model2Inversion,
        Self::Model3Inversion,
        Self::RotationalFlowInversion,
        Self::TorqueControl,
        Self::PowerControl,
        Self::CombinedAntiSpin,
        Self::ThrustPi,
        Self::TrimmedModel2Inversion,
        Self::LookAhead,
    ];

    /// Stable name, as in configuration files and the service.
    pub const fn name(self) -> &'static str {
        match self {
            Self::StaticMap => "static_map",
            Self::VelocityServo => "velocity_servo",
            Self::Model1Inversion => "model1_inversion",
            Self::Model2Inversion => "model2_inversion",
            Self::Model3Inversion => "model3_inversion",
            Self::RotationalFlowInversion => "rotational_flow_inversion",
            Self::TorqueControl => "torque_control",
            Self::PowerControl => "power_control",
            Self::CombinedAntiSpin => "combined_anti_spin",
            Self::ThrustPi => "thrust_pi",
            Self::TrimmedModel2Inversion => "trimmed_model2_inversion",
            Self::LookAhead => "look_ahead",
        }
    }

    /// The law of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|k| k.name() == name)
    }

    /// The law's place in [`Self::ALL`]: a fixed-layout message's number for it.
    pub const fn index(self) -> u8 {
        self as u8
    }

    /// The law at a place in [`Self::ALL`].
    pub fn from_index(index: u8) -> Option<Self> {
        Self::ALL.get(usize::from(index)).copied()
    }

    /// Whether the law can do nothing without the force sensor.
    pub const fn needs_thrust(self) -> bool {
        matches!(self, Self::ThrustPi)
    }

    /// Whether the law leans on the observer's axial flow.
    pub const fn uses_flow(self) -> bool {
        matches!(
            self,
            Self::Model2Inversion
                | Self::Model3Inversion
                | Self::RotationalFlowInversion
                | Self::TrimmedModel2Inversion
                | Self::LookAhead
        )
    }
}

/// Options of every law; a law reads its own part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LawOptions {
    /// The speed loop inside most laws.
    pub servo: ServoOptions,
    /// PI on the force sensor.
    pub thrust_pi: ThrustPiOptions,
    /// Slow trim on the force sensor.
    pub trim: TrimOptions,
    /// Torque, power and anti-spin.
    pub anti_spin: AntiSpinOptions,
    /// Rotational flow of the wake.
    pub rotational_flow: RotationalFlowOptions,
    /// Prediction.
    pub look_ahead: LookAheadOptions,
}

/// What a law sees at one tick.
#[derive(Clone, Copy, Debug)]
pub struct LawInput<'a> {
    /// The thruster, adapted where an estimator runs.
    pub model: &'a ControlModel,
    /// Measurements, already sane.
    pub measured: &'a Measurement,
    /// The observer's estimate.
    pub estimate: &'a Estimate,
    /// Thrust reference after its limits, N.
    pub thrust_n: f64,
    /// Time since the last tick, s.
    pub dt_s: f64,
}

impl LawInput<'_> {
    /// Measured shaft speed, or the observer's while it is not measured, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.measured.shaft_speed_rad_s.unwrap_or(self.estimate.shaft_speed_rad_s.value)
    }
}

/// What a law asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Motor torque at the shaft, N m.
    pub torque_n_m: f64,
    /// Shaft speed the law aims at, rad/s: what a speed drive is told.
    pub speed_rad_s: f64,
    /// Limits the law itself put in force.
    pub limits: LimitSet,
}

/// A running law.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum Law {
    /// See [`LawKind::StaticMap`].
    StaticMap(static_map::StaticMapLaw),
    /// See [`LawKind::VelocityServo`].
    VelocityServo(velocity_servo::VelocityServo),
    /// See [`LawKind::Model1Inversion`].
    Model1Inversion(model1_inversion::Model1Inversion),
    /// See [`LawKind::Model2Inversion`].
    Model2Inversion(model2_inversion::Model2Inversion),
    /// See [`LawKind::Model3Inversion`].
    Model3Inversion(model3_inversion::Model3Inversion),
    /// See [`LawKind::RotationalFlowInversion`].
    RotationalFlowInversion(rotational_flow_inversion::RotationalFlowInversion),
    /// See [`LawKind::TorqueControl`].
    TorqueControl(torque_control::TorqueControl),
    /// See [`LawKind::PowerControl`].
    PowerControl(power_control::PowerControl),
    /// See [`LawKind::CombinedAntiSpin`].
    CombinedAntiSpin(combined_anti_spin::CombinedAntiSpin),
    /// See [`LawKind::ThrustPi`].
    ThrustPi(thrust_pi::ThrustPi),
    /// See [`LawKind::TrimmedModel2Inversion`].
    TrimmedModel2Inversion(trimmed_model2_inversion::TrimmedModel2Inversion),
    /// See [`LawKind::LookAhead`].
    LookAhead(look_ahead::LookAhead),
}

macro_rules! each {
    ($law:expr, $inner:ident => $body:expr) => {
        match $law {
            Law::StaticMap($inner) => $body,
            Law::VelocityServo($inner) => $body,
            Law::Model1Inversion($inner) => $body,
            Law::Model2Inversion($inner) => $body,
            Law::Model3Inversion($inner) => $body,
            Law::RotationalFlowInversion($inner) => $body,
            Law::TorqueControl($inner) => $body,
            Law::PowerControl($inner) => $body,
            Law::CombinedAntiSpin($inner) => $body,
            Law::ThrustPi($inner) => $body,
            Law::TrimmedModel2Inversion($inner) => $body,
            Law::LookAhead($inner) => $body,
        }
    };
}

impl Law {
    /// A law at rest, its gains designed from the model.
    pub fn new(kind: LawKind, model: &ControlModel, options: &LawOptions) -> Self {
        match kind {
            LawKind::StaticMap => Self::StaticMap(static_map::StaticMapLaw),
            LawKind::VelocityServo => {
                Self::VelocityServo(velocity_servo::VelocityServo::new(model, &options.servo))
            }
            LawKind::Model1Inversion => Self::Model1Inversion(model1_inversion::Model1Inversion::new(model)),
            LawKind::Model2Inversion => {
                Self::Model2Inversion(model2_inversion::Model2Inversion::new(model, &options.servo))
            }
            LawKind::Model3Inversion => {
                Self::Model3Inversion(model3_inversion::Model3Inversion::new(model, &options.servo))
            }
            LawKind::RotationalFlowInversion => Self::RotationalFlowInversion(
                rotational_flow_inversion::RotationalFlowInversion::new(model, &options.servo),
            ),
            LawKind::TorqueControl => Self::TorqueControl(torque_control::TorqueControl),
            LawKind::PowerControl => Self::PowerControl(power_control::PowerControl),
            LawKind::CombinedAntiSpin => {
                Self::CombinedAntiSpin(combined_anti_spin::CombinedAntiSpin::new(model, &options.anti_spin))
            }
            LawKind::ThrustPi => Self::ThrustPi(thrust_pi::ThrustPi::new(model, &options.thrust_pi)),
            LawKind::TrimmedModel2Inversion => Self::TrimmedModel2Inversion(
                trimmed_model2_inversion::TrimmedModel2Inversion::new(model, &options.servo, &options.trim),
            ),
            LawKind::LookAhead => {
                Self::LookAhead(look_ahead::LookAhead::new(model, &options.servo, &options.look_ahead))
            }
        }
    }

    /// The torque asked for at this tick.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        each!(self, law => law.tick(input))
    }

    /// What the controller applied of the last demand, N m.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        each!(self, law => law.settle(applied_n_m, dt_s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_go_both_ways() {
        for (i, kind) in LawKind::ALL.into_iter().enumerate() {
            assert_eq!(LawKind::from_name(kind.name()), Some(kind));
            assert_eq!(LawKind::from_index(i as u8), Some(kind));
            assert_eq!(
                serde::Deserialize::deserialize(
                    serde::de::value::StrDeserializer::<serde::de::value::Error>::new(kind.name())
                ),
                Ok(kind)
            );
        }
    }
}
