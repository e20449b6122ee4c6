//! What else hangs on the shaft: the load of a dry rig, or one beside the propeller.

use serde::Serialize;

use super::keys::is_known;
use super::read::Reader;
use super::{Quantity, RigError};
use crate::parameters::Parameter;

/// What else hangs on the shaft (`[load]`, its `kind` first).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Load {
    /// Nothing.
    #[default]
    None,
    /// A weight on an arm: torque `-m g l sin q`, where the shaft angle `q = 0` hangs down; it adds `m l^2` to
    /// the inertia, which the motor's does not hold.
    Pendulum {
        /// Mass `m`, kg.
        mass_kg: Quantity,
        /// Shaft to centre of mass `l`, m.
        length_m: Quantity,
    },
    /// A second inertia behind a belt, a long shaft or a coupling; speed and angle are measured at the motor.
    TwoMass {
        /// Inertia of the load's side, kg m^2; the motor's does not hold it.
        inertia_kg_m2: Quantity,
        /// Torque over twist, N m/rad.
        stiffness_nm_rad: Quantity,
        /// Torque over rate of twist, N m s.
        damping_nm_s: Quantity,
    },
    /// A fan or a brake of its kind: torque `-k Om|Om|`.
    Fan {
        /// Coefficient `k`, N m s^2.
        fan_coefficient_nm_s2: Quantity,
    },
    /// A linear axis on a screw or a belt that moves `s` metres a turn: position is `s q/(2 pi)`, the mass adds
    /// `m (s/(2 pi))^2` to the inertia, and on an incline its weight turns the shaft back with
    /// `m g sin(incline) s/(2 pi)`.
    Slide {
        /// Mass that moves `m`, kg.
        mass_kg: Quantity,
        /// Lead `s`, m a turn.
        lead_m_rev: Quantity,
        /// Incline, rad, positive where turning ahead lifts.
        incline_rad: Quantity,
    },
}

impl Load {
    /// What is stated of a parameter of the load.
    pub(crate) fn quantity(&self, parameter: Parameter) -> Option<Quantity> {
        match (self, parameter) {
            (Self::Pendulum { mass_kg, .. } | Self::Slide { mass_kg, .. }, Parameter::LoadMassKg) => {
                Some(*mass_kg)
            }
            (Self::Pendulum { length_m, .. }, Parameter::LoadLengthM) => Some(*length_m),
            (Self::TwoMass { inertia_kg_m2, .. }, Parameter::LoadInertiaKgM2) => Some(*inertia_kg_m2),
            (Self::TwoMass { stiffness_nm_rad, .. }, Parameter::LoadStiffnessNmRad) => {
                Some(*stiffness_nm_rad)
            }
            (Self::TwoMass { damping_nm_s, .. }, Parameter::LoadDampingNmS) => Some(*damping_nm_s),
            (Self::Fan { fan_coefficient_nm_s2 }, Parameter::FanCoefficientNmS2) => {
                Some(*fan_coefficient_nm_s2)
            }
            _ => None,
        }
    }

    /// The section `[load]`; none without one.
    pub(super) fn read(t: &mut Reader) -> Self {
        let kinds = ["none", "pendulum", "two_mass", "fan", "slide"].map(|kind| (kind, kind));
        let hint = "say what else hangs on the shaft, or leave [load] out";
        let before = t.wrong.len();
        let kind = t.choice("load", "kind", &kinds, hint).unwrap_or("none");
        // Which keys belong to a kind that nobody knows is not known either.
        if t.wrong.len() > before {
            return Self::None;
        }
        let mut need = |key| t.need("load", key);
        let (load, keys): (Self, &[&str]) = match kind {
            "pendulum" => (
                Self::Pendulum { mass_kg: need("mass_kg"), length_m: need("length_m") },
                &["mass_kg", "length_m"],
            ),
            "two_mass" => (
                Self::TwoMass {
                    inertia_kg_m2: need("inertia_kg_m2"),
                    stiffness_nm_rad: need("stiffness_nm_rad"),
                    damping_nm_s: need("damping_nm_s"),
                },
                &["inertia_kg_m2", "stiffness_nm_rad", "damping_nm_s"],
            ),
            "fan" => (
                Self::Fan { fan_coefficient_nm_s2: need("fan_coefficient_nm_s2") },
                &["fan_coefficient_nm_s2"],
            ),
            "slide" => (
                Self::Slide {
                    mass_kg: need("mass_kg"),
                    lead_m_rev: need("lead_m_rev"),
                    incline_rad: t.quantity("load", "incline_rad").unwrap_or(Quantity::exact(0.0)),
                },
                &["mass_kg", "lead_m_rev", "incline_rad"],
            ),
            _ => (Self::None, &[]),
        };
        // A quantity of another kind of load is a mistake, not something to pass over; one of no kind is told already.
        let of_another = |key: &&str| *key != "kind" && !keys.contains(key) && is_known("load", key);
        let odd: Vec<String> = t.keys("load").filter(of_another).map(str::to_owned).collect();
        t.wrong.extend(odd.into_iter().map(|odd| RigError::UnknownKey {
            key: format!("load.{odd}"),
            hint: match keys {
                [] => "this kind of load has no quantities; say kind = \"pendulum\", …".into(),
                some => format!("this kind of load has {}", some.join(", ")),
            },
        }));
        load
    }
}
