//! The rig description: what is stated of a thruster, its drive, its sensors, what else hangs on its shaft,
//! and the physics that it is known to have.
//!
//! Reading TOML text is pure; opening the file is the caller's part. An unknown key is an error
//! that names the nearest known one, a value out of range one that names the range.

mod keys;
mod known;
mod load;
mod read;
mod write;

pub use known::KnownEffect;
pub use load::Load;
pub use write::{FoundEffect, TOL, short, written};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::blade::Blade;

/// A stated value and how sure its author is: `tol` is the relative uncertainty, two sigma.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// The stated value, in the unit of its key.
    pub value: f64,
    /// Relative uncertainty (two sigma); `None` means stated as exact.
    pub tol: Option<f64>,
}

impl Quantity {
    /// A value stated as exact.
    pub const fn exact(value: f64) -> Self {
        Self { value, tol: None }
    }

    /// One standard deviation of the statement, in the unit of the value; zero if exact.
    pub fn sigma(&self) -> f64 {
        0.5 * self.tol.unwrap_or(0.0) * self.value.abs()
    }
}

/// Why a rig description cannot be used.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum RigError {
    /// Not TOML.
    #[error("{message}\nhint: write tables and values as config/thrusters/whitcomb-yoerger-1999.toml does")]
    Syntax {
        /// The parser's words, with line and column.
        message: String,
    },
    /// A key that kort does not know.
    #[error("`{key}` is not a key of a rig description\nhint: {hint}")]
    UnknownKey {
        /// The offending key with its table.
        key: String,
        /// Nearest known key, or the list.
        hint: String,
    },
    /// A key that must be there.
    #[error("`{key}` is missing\nhint: {hint}")]
    Missing {
        /// The missing key with its table.
        key: String,
        /// What to write.
        hint: String,
    },
    /// A value of the wrong kind or outside its range.
    #[error("`{key}` = {found} is outside what is allowed: {allowed}\nhint: {hint}")]
    Value {
        /// The key with its table.
        key: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
        /// What to do.
        hint: String,
    },
}

/// How the drive is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AmplifierKind {
    /// Closed current loop: the command is motor current.
    Current,
    /// The command is motor voltage (or duty times the supply).
    Voltage,
    /// The drive closes a speed loop of its own.
    Speed,
}

/// A whole rig.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rig {
    /// Name of the rig.
    pub name: String,
    /// Class, free words.
    pub class: String,
    /// `None` for a dry shaft (`propeller.kind = "none"`).
    pub propeller: Option<Propeller>,
    /// The water.
    pub flow: Flow,
    /// The motor.
    pub motor: Motor,
    /// The drive.
    pub amplifier: Amplifier,
    /// The measuring chain.
    pub sensors: Sensors,
    /// What else hangs on the shaft.
    pub load: Load,
    /// Physics that this rig is known to have; part of its model everywhere.
    pub effects: Vec<KnownEffect>,
    /// Where it ran, free words.
    pub water: String,
}

/// Propeller and duct.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Propeller {
    /// Radius of the duct, m.
    pub radius_m: Quantity,
    /// Length of the duct, m.
    pub duct_length_m: Quantity,
    /// Pitch angle at 0.7 radius, rad.
    pub pitch_rad: Quantity,
    /// `CLmax`.
    pub lift_max: Quantity,
    /// `CDmax`.
    pub drag_max: Quantity,
}

/// The water and the momentum balance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Flow {
    /// Density, kg/m^3.
    pub density_kg_m3: Quantity,
    /// Flux coefficient `dbeta`.
    pub flux_coefficient: Quantity,
    /// Added-mass coefficient `gamma`.
    pub added_mass_coefficient: Quantity,
}

/// Motor and shaft.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Motor {
    /// Inertia of motor, shaft and propeller, kg m^2.
    pub inertia_kg_m2: Quantity,
    /// Torque constant, N m/A.
    pub torque_constant_nm_a: Quantity,
    /// Winding resistance, ohm; needed by a voltage drive.
    pub winding_resistance_ohm: Option<Quantity>,
    /// Viscous friction, N m s; absent means not stated (taken as zero).
    pub viscous_friction_nm_s: Option<Quantity>,
}

/// The drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Amplifier {
    /// How it is commanded.
    pub kind: AmplifierKind,
    /// First-order lag, s; zero for an ideal drive.
    pub time_constant_s: Quantity,
    /// Largest current, A; infinite when not stated.
    pub current_limit_a: f64,
    /// How far off it may be, relative, two sigma.
    pub current_limit_tol: Option<f64>,
    /// Nominal supply, V.
    pub supply_v: Option<f64>,
}

impl Amplifier {
    /// The command of which others are shares: the current limit, A; the supply, V; of a speed drive the speed, rad/s, at
    /// which the supply just turns a motor of this torque constant, its winding neglected.
    ///
    /// # Errors
    /// The key of the rig that would state it.
    pub fn largest_command(&self, torque_constant_nm_a: f64) -> Result<f64, &'static str> {
        let supply = self.supply_v.ok_or("amplifier.supply_v");
        match self.kind {
            AmplifierKind::Current if self.current_limit_a.is_finite() => Ok(self.current_limit_a),
            AmplifierKind::Current => Err("amplifier.current_limit_a"),
            AmplifierKind::Voltage => supply,
            AmplifierKind::Speed => supply.map(|v| v / torque_constant_nm_a),
        }
    }
}

/// The measuring chain. What is not stated is ideal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sensors {
    /// Rate of the log, Hz.
    pub log_rate_hz: Option<f64>,
    /// Rate at which commands change and speed is differenced, Hz.
    pub control_rate_hz: Option<f64>,
    /// Counts of the shaft encoder per turn.
    pub encoder_counts_per_rev: Option<f64>,
    /// First-order filter on the differenced speed, s.
    pub speed_filter_time_constant_s: Option<f64>,
    /// How far off it may be, relative, two sigma.
    pub speed_filter_tol: Option<f64>,
    /// First-order filter of the force sensor, Hz.
    pub thrust_filter_hz: Option<f64>,
    /// Full scale of the force sensor (plus and minus), N.
    pub thrust_full_scale_n: Option<f64>,
    /// Bits of its converter.
    pub thrust_bits: Option<u32>,
    /// First-order filter of the torque transducer, Hz.
    pub torque_filter_hz: Option<f64>,
    /// Rate of the flow meter, Hz (sample and hold).
    pub flow_rate_hz: Option<f64>,
    /// There is a torque transducer between motor and propeller.
    pub torque_transducer: bool,
    /// The ambient flow is a column of the recording.
    pub ambient_flow_recorded: bool,
    /// There is a force sensor (`sensors.thrust = "none"` says that there is not).
    pub thrust_sensor: bool,
    /// There is a flow meter (`sensors.flow = "none"` says that there is not).
    pub flow_meter: bool,
}

impl Sensors {
    /// Sensors that add nothing.
    pub const IDEAL: Self = Self {
        log_rate_hz: None,
        control_rate_hz: None,
        encoder_counts_per_rev: None,
        speed_filter_time_constant_s: None,
        speed_filter_tol: None,
        thrust_filter_hz: None,
        thrust_full_scale_n: None,
        thrust_bits: None,
        torque_filter_hz: None,
        flow_rate_hz: None,
        torque_transducer: false,
        ambient_flow_recorded: false,
        thrust_sensor: true,
        flow_meter: true,
    };
}

impl Rig {
    /// The blade row at the stated values; `None` for a dry shaft.
    pub fn blade(&self) -> Option<Blade> {
        self.propeller.map(|p| Blade {
            radius_m: p.radius_m.value,
            pitch_rad: p.pitch_rad.value,
            lift_max: p.lift_max.value,
            drag_max: p.drag_max.value,
            density_kg_m3: self.flow.density_kg_m3.value,
        })
    }

    /// Mass of the accelerated water at the stated values, `rho a l gamma`, kg; zero for a dry shaft.
    pub fn added_mass_kg(&self) -> f64 {
        self.propeller.map_or(0.0, |p| {
            self.flow.density_kg_m3.value
                * std::f64::consts::PI
                * p.radius_m.value.powi(2)
                * p.duct_length_m.value
                * self.flow.added_mass_coefficient.value
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: &str = r#"
[rig]
name = "stand"
[propeller]
radius_m = 0.13
duct_length_m = 0.1271
pitch_rad = 0.39
lift_max = { value = 0.542, tol = 0.15 }
drag_max = 1.25
[flow]
density_kg_m3 = 998
flux_coefficient = 1.86
added_mass_coefficient = 2.0
[motor]
inertia_kg_m2 = 0.01
torque_constant_nm_a = 1.25
"#;

    #[test]
    fn reads_numbers_and_quantities() {
        let rig = Rig::from_toml(PAPER).unwrap();
        assert!((rig.propeller.unwrap().lift_max.sigma() - 0.04065).abs() < 1e-12);
        assert!((rig.added_mass_kg() - 13.47).abs() < 0.01);
    }

    #[test]
    fn unknown_key_names_the_nearest() {
        let err = Rig::from_toml(&PAPER.replace("drag_max", "drag_maxi")).unwrap_err().to_string();
        assert!(err.contains("propeller.drag_maxi") && err.contains("did you mean `drag_max`?"), "{err}");
    }

    #[test]
    fn out_of_range_names_the_range_and_the_unit() {
        let err =
            Rig::from_toml(&PAPER.replace("radius_m = 0.13", "radius_m = 130")).unwrap_err().to_string();
        assert!(
            err.contains("propeller.radius_m") && err.contains("0.005 to 10") && err.contains("hint: metres"),
            "{err}"
        );
    }

    /// What is wrong with the paper's rig, with these changes: the key of each, in order.
    fn wrong_keys(changes: &[(&str, &str)], more: &str) -> Vec<String> {
        let changed = changes.iter().fold(PAPER.to_owned(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        });
        let text = format!("{changed}{more}");
        let wrong = Rig::from_toml_with_all(&text).unwrap_err();
        assert_eq!(Rig::from_toml(&text).unwrap_err(), wrong[0]);
        wrong
            .iter()
            .map(|error| match error {
                RigError::Syntax { message } => message.clone(),
                RigError::UnknownKey { key, hint }
                | RigError::Missing { key, hint }
                | RigError::Value { key, hint, .. } => {
                    assert!(!hint.is_empty(), "{error}");
                    key.clone()
                }
            })
            .collect()
    }

    #[test]
    fn all_that_is_wrong_is_said_at_once() {
        let changes = [
            ("radius_m = 0.13", "radius_m = 130"),
            ("[flow]", "[flow]\nsalinity = 35"),
            ("[motor]", "[motor]\nwinding_resistance_ohm = { value = 0, tol = 5, unit = \"ohm\" }"),
            ("torque_constant_nm_a", "torque_konstant_nm_a"),
        ];
        let more = "[amplifier]\nkind = \"curent\"\n[sensors]\ntorque = 5\nthrust = \"gone\"\n\
            [load]\nkind = \"pendulum\"\nmass_kg = 0\nlead_m_rev = 1\n\
            [[effects]]\neffect = \"colomb_friction\"\n\
            [[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = -1\nodd = 2\n";
        let mut found = wrong_keys(&changes, more);
        found.sort();
        let mut wanted = [
            "propeller.radius_m",
            "flow.salinity",
            "motor.winding_resistance_ohm.unit",
            "motor.winding_resistance_ohm.tol",
            "amplifier.kind",
            // Told once: it is not missing besides.
            "motor.torque_konstant_nm_a",
            "sensors.torque",
            "sensors.thrust",
            "load.mass_kg",
            "load.length_m",
            "load.lead_m_rev",
            "effects[0].effect",
            "effects[1].coulomb_torque_n_m",
            "effects[1].odd",
        ];
        wanted.sort_unstable();
        assert_eq!(found, wanted);
    }

    #[test]
    fn all_that_is_missing_is_said_at_once() {
        let all = Rig::from_toml_with_all("[rig]\nname = \"empty\"\n").unwrap_err();
        let missing = all.iter().filter(|error| matches!(error, RigError::Missing { .. })).count();
        assert_eq!((all.len(), missing), (10, 10), "{all:?}");
        // A table under another name is one mistake, not one for each of its keys.
        assert_eq!(wrong_keys(&[("[motor]", "[moter]")], ""), ["moter"]);
    }

    #[test]
    fn dry_shaft_needs_no_propeller() {
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n",
        )
        .unwrap();
        assert!(rig.propeller.is_none() && rig.blade().is_none());
    }
}
