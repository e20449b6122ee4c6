//! The rig description: what is stated of a thruster, its drive and its sensors.
//!
//! Reading TOML text is pure; opening the file is the caller's part. An unknown key is an error
//! that names the nearest known one, a value out of range one that names the range.

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
    /// Nominal supply, V.
    pub supply_v: Option<f64>,
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
}

impl Sensors {
    /// Sensors that add nothing.
    pub const IDEAL: Self = Self {
        log_rate_hz: None,
        control_rate_hz: None,
        encoder_counts_per_rev: None,
        speed_filter_time_constant_s: None,
        thrust_filter_hz: None,
        thrust_full_scale_n: None,
        thrust_bits: None,
        torque_filter_hz: None,
        flow_rate_hz: None,
        torque_transducer: false,
        ambient_flow_recorded: false,
    };
}

impl Rig {
    /// Reads a rig description.
    ///
    /// # Errors
    /// [`RigError`] names the key, the value found, what is allowed and what to do.
    pub fn from_toml(text: &str) -> Result<Self, RigError> {
        let table: toml::Table = text
            .parse()
            .map_err(|e: toml::de::Error| RigError::Syntax { message: e.to_string().trim_end().into() })?;
        check_keys(&table)?;
        let t = Reader { table: &table };
        let dry = t.text("propeller", "kind")?.as_deref() == Some("none");
        let propeller = if dry {
            None
        } else {
            Some(Propeller {
                radius_m: t.need("propeller", "radius_m")?,
                duct_length_m: t.need("propeller", "duct_length_m")?,
                pitch_rad: t.need("propeller", "pitch_rad")?,
                lift_max: t.need("propeller", "lift_max")?,
                drag_max: t.need("propeller", "drag_max")?,
            })
        };
        let flow = if dry {
            Flow {
                density_kg_m3: t.quantity("flow", "density_kg_m3")?.unwrap_or(Quantity::exact(998.0)),
                flux_coefficient: Quantity::exact(2.0),
                added_mass_coefficient: Quantity::exact(1.0),
            }
        } else {
            Flow {
                density_kg_m3: t.need("flow", "density_kg_m3")?,
                flux_coefficient: t.need("flow", "flux_coefficient")?,
                added_mass_coefficient: t.need("flow", "added_mass_coefficient")?,
            }
        };
        let kind = match t.text("amplifier", "kind")?.as_deref() {
            None | Some("current") => AmplifierKind::Current,
            Some("voltage") => AmplifierKind::Voltage,
            Some("speed") => AmplifierKind::Speed,
            Some(other) => {
                return Err(value_error(
                    "amplifier.kind",
                    other,
                    "\"current\", \"voltage\" or \"speed\"",
                    "say what the drive's command input controls",
                ));
            }
        };
        let motor = Motor {
            inertia_kg_m2: t.need("motor", "inertia_kg_m2")?,
            torque_constant_nm_a: t.need("motor", "torque_constant_nm_a")?,
            winding_resistance_ohm: t.quantity("motor", "winding_resistance_ohm")?,
            viscous_friction_nm_s: t.quantity("motor", "viscous_friction_nm_s")?,
        };
        if kind == AmplifierKind::Voltage && motor.winding_resistance_ohm.is_none() {
            return Err(RigError::Missing {
                key: "motor.winding_resistance_ohm".into(),
                hint:
                    "a voltage drive needs the winding's resistance, for example winding_resistance_ohm = 2.2"
                        .into(),
            });
        }
        let torque_transducer = match t.text("sensors", "torque")?.as_deref() {
            None | Some("none") => false,
            Some("propeller-side transducer") => true,
            Some(other) => {
                return Err(value_error(
                    "sensors.torque",
                    other,
                    "\"none\" or \"propeller-side transducer\"",
                    "leave the key out if there is no torque transducer",
                ));
            }
        };
        let ambient_flow_recorded = match t.text("sensors", "ambient_flow")?.as_deref() {
            None | Some("not recorded") => false,
            Some("recorded") => true,
            Some(other) => {
                return Err(value_error(
                    "sensors.ambient_flow",
                    other,
                    "\"recorded\" or \"not recorded\"",
                    "\"recorded\" means the recording has a column ambient_m_s",
                ));
            }
        };
        Ok(Self {
            name: t.text("rig", "name")?.unwrap_or_else(|| "unnamed".into()),
            class: t.text("rig", "class")?.unwrap_or_default(),
            propeller,
            flow,
            motor,
            amplifier: Amplifier {
                kind,
                time_constant_s: t.quantity("amplifier", "time_constant_s")?.unwrap_or(Quantity::exact(0.0)),
                current_limit_a: t.number("amplifier", "current_limit_a")?.unwrap_or(f64::INFINITY),
                supply_v: t.number("amplifier", "supply_v")?,
            },
            sensors: Sensors {
                log_rate_hz: t.number("sensors", "log_rate_hz")?,
                control_rate_hz: t.number("sensors", "control_rate_hz")?,
                encoder_counts_per_rev: t.number("sensors", "encoder_counts_per_rev")?,
                speed_filter_time_constant_s: t.number("sensors", "speed_filter_time_constant_s")?,
                thrust_filter_hz: t.number("sensors", "thrust_filter_hz")?,
                thrust_full_scale_n: t.number("sensors", "thrust_full_scale_n")?,
                thrust_bits: t.number("sensors", "thrust_bits")?.map(|b| b as u32),
                torque_filter_hz: t.number("sensors", "torque_filter_hz")?,
                flow_rate_hz: t.number("sensors", "flow_rate_hz")?,
                torque_transducer,
                ambient_flow_recorded,
            },
            water: t.text("run", "water")?.unwrap_or_else(|| "not stated".into()),
        })
    }

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

/// Every key, with the range a number must lie in (both ends allowed) and a hint on units.
type Key = (&'static str, &'static str, Option<(f64, f64)>, &'static str);

const KEYS: &[Key] = &[
    ("rig", "name", None, ""),
    ("rig", "class", None, ""),
    ("propeller", "kind", None, ""),
    ("propeller", "radius_m", Some((0.005, 10.0)), "metres: 0.13 for a 26 cm duct"),
    (
        "propeller",
        "duct_length_m",
        Some((0.001, 20.0)),
        "metres: 0.127 for a 12.7 cm duct; for an open propeller about one radius",
    ),
    ("propeller", "pitch_rad", Some((0.02, 1.4)), "radians: 0.39 for 22.5 degrees"),
    ("propeller", "lift_max", Some((0.01, 10.0)), "dimensionless, usually 0.3 to 2"),
    ("propeller", "drag_max", Some((0.0, 20.0)), "dimensionless, usually 0.3 to 2"),
    ("flow", "density_kg_m3", Some((1.0, 2000.0)), "998 in fresh water, 1025 in the sea"),
    ("flow", "flux_coefficient", Some((0.01, 20.0)), "dimensionless, 2 in theory"),
    ("flow", "added_mass_coefficient", Some((0.01, 50.0)), "dimensionless, usually 1 to 3"),
    ("motor", "inertia_kg_m2", Some((1e-9, 1e5)), "kg m^2, motor, shaft and propeller together"),
    ("motor", "torque_constant_nm_a", Some((1e-6, 1e4)), "N m/A"),
    ("motor", "winding_resistance_ohm", Some((1e-5, 1e4)), "ohm, the whole current path"),
    ("motor", "viscous_friction_nm_s", Some((0.0, 1e4)), "N m per rad/s"),
    ("amplifier", "kind", None, ""),
    ("amplifier", "time_constant_s", Some((0.0, 10.0)), "seconds: 0.002 for 2 ms"),
    ("amplifier", "current_limit_a", Some((1e-3, 1e6)), "ampere"),
    ("amplifier", "supply_v", Some((0.1, 1e5)), "volt"),
    ("sensors", "log_rate_hz", Some((0.01, 1e5)), "Hz"),
    ("sensors", "control_rate_hz", Some((0.1, 1e5)), "Hz"),
    ("sensors", "encoder_counts_per_rev", Some((1.0, 1e8)), "counts per turn"),
    ("sensors", "speed_filter_time_constant_s", Some((0.0, 100.0)), "seconds: 0.010 for 10 ms"),
    ("sensors", "thrust_filter_hz", Some((0.01, 1e6)), "Hz"),
    ("sensors", "thrust_full_scale_n", Some((1e-3, 1e8)), "newton, one side"),
    ("sensors", "thrust_bits", Some((2.0, 32.0)), "bits of the converter"),
    ("sensors", "torque_filter_hz", Some((0.01, 1e6)), "Hz"),
    ("sensors", "flow_rate_hz", Some((0.01, 1e5)), "Hz"),
    ("sensors", "torque", None, ""),
    ("sensors", "ambient_flow", None, ""),
    ("run", "water", None, ""),
];

fn value_error(key: &str, found: impl std::fmt::Display, allowed: &str, hint: &str) -> RigError {
    RigError::Value { key: key.into(), found: found.to_string(), allowed: allowed.into(), hint: hint.into() }
}

fn check_keys(table: &toml::Table) -> Result<(), RigError> {
    let tables: Vec<&str> = ["rig", "propeller", "flow", "motor", "amplifier", "sensors", "run"].into();
    for (name, value) in table {
        if !tables.contains(&name.as_str()) {
            return Err(RigError::UnknownKey {
                key: name.clone(),
                hint: nearest(name, tables.iter().copied()),
            });
        }
        let Some(inner) = value.as_table() else {
            return Err(value_error(name, value, "a table", &format!("write [{name}] on a line of its own")));
        };
        for key in inner.keys() {
            let known = KEYS.iter().filter(|k| k.0 == name).map(|k| k.1);
            if !known.clone().any(|k| k == key) {
                return Err(RigError::UnknownKey { key: format!("{name}.{key}"), hint: nearest(key, known) });
            }
        }
    }
    Ok(())
}

fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    let best =
        known.clone().max_by(|a, b| strsim::jaro_winkler(a, word).total_cmp(&strsim::jaro_winkler(b, word)));
    match best {
        Some(b) if strsim::jaro_winkler(b, word) > 0.75 => format!("did you mean `{b}`?"),
        _ => format!("known here: {}", known.collect::<Vec<_>>().join(", ")),
    }
}

struct Reader<'a> {
    table: &'a toml::Table,
}

impl Reader<'_> {
    fn get(&self, table: &str, key: &str) -> Option<&toml::Value> {
        self.table.get(table)?.get(key)
    }

    fn text(&self, table: &str, key: &str) -> Result<Option<String>, RigError> {
        match self.get(table, key) {
            None => Ok(None),
            Some(toml::Value::String(s)) => Ok(Some(s.clone())),
            Some(other) => Err(value_error(
                &format!("{table}.{key}"),
                other,
                "a text in quotes",
                "put it in double quotes",
            )),
        }
    }

    fn number(&self, table: &str, key: &str) -> Result<Option<f64>, RigError> {
        Ok(self.quantity(table, key)?.map(|q| q.value))
    }

    fn quantity(&self, table: &str, key: &str) -> Result<Option<Quantity>, RigError> {
        let Some(found) = self.get(table, key) else { return Ok(None) };
        let name = format!("{table}.{key}");
        let form = "a number, or { value = 0.542, tol = 0.15 }";
        let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
        let quantity = match found {
            toml::Value::Table(t) => {
                if let Some(odd) = t.keys().find(|k| *k != "value" && *k != "tol") {
                    return Err(RigError::UnknownKey {
                        key: format!("{name}.{odd}"),
                        hint: nearest(odd, ["value", "tol"].into_iter()),
                    });
                }
                let value = t
                    .get("value")
                    .and_then(number)
                    .ok_or_else(|| value_error(&name, found, form, "`value` must be a number"))?;
                let tol = match t.get("tol") {
                    None => None,
                    Some(v) => Some(number(v).filter(|t| (0.0..=2.0).contains(t)).ok_or_else(|| {
                        value_error(
                            &format!("{name}.tol"),
                            v,
                            "0 to 2",
                            "tol is relative, two sigma: 0.15 for 15 %",
                        )
                    })?),
                };
                Quantity { value, tol: tol.filter(|t| *t > 0.0) }
            }
            other => Quantity::exact(
                number(other).ok_or_else(|| value_error(&name, other, form, "no quotes, a decimal point"))?,
            ),
        };
        let entry = KEYS.iter().find(|k| k.0 == table && k.1 == key);
        if let Some((_, _, Some((low, high)), hint)) = entry
            && !(quantity.value >= *low && quantity.value <= *high)
        {
            return Err(value_error(&name, quantity.value, &format!("{low} to {high}"), hint));
        }
        Ok(Some(quantity))
    }

    fn need(&self, table: &str, key: &str) -> Result<Quantity, RigError> {
        self.quantity(table, key)?.ok_or_else(|| RigError::Missing {
            key: format!("{table}.{key}"),
            hint: KEYS
                .iter()
                .find(|k| k.0 == table && k.1 == key)
                .map_or_else(String::new, |k| format!("add {key} = … under [{table}]; {}", k.3)),
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

    #[test]
    fn dry_shaft_needs_no_propeller() {
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n",
        )
        .unwrap();
        assert!(rig.propeller.is_none() && rig.blade().is_none());
    }
}
