//! Reads a rig description.

use super::keys::{KEYS, check_keys, nearest, value_error};
use super::{
    Amplifier, AmplifierKind, Flow, Load, Motor, Propeller, Quantity, Rig, RigError, Sensors, known,
};

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
        let fitted = |key: &str| match t.text("sensors", key)?.as_deref() {
            None | Some("fitted") => Ok(true),
            Some("none") => Ok(false),
            Some(other) => Err(value_error(
                &format!("sensors.{key}"),
                other,
                "\"fitted\" or \"none\"",
                "\"none\" if nothing measures it",
            )),
        };
        Ok(Self {
            load: Load::read(&t)?,
            effects: known::read(&table)?,
            name: t.text("rig", "name")?.unwrap_or_else(|| "unnamed".into()),
            class: t.text("rig", "class")?.unwrap_or_default(),
            propeller,
            flow,
            motor,
            amplifier: Amplifier {
                kind,
                time_constant_s: t.quantity("amplifier", "time_constant_s")?.unwrap_or(Quantity::exact(0.0)),
                current_limit_a: t.number("amplifier", "current_limit_a")?.unwrap_or(f64::INFINITY),
                current_limit_tol: t.tolerance("amplifier", "current_limit_a")?,
                supply_v: t.number("amplifier", "supply_v")?,
            },
            sensors: Sensors {
                log_rate_hz: t.number("sensors", "log_rate_hz")?,
                control_rate_hz: t.number("sensors", "control_rate_hz")?,
                encoder_counts_per_rev: t.number("sensors", "encoder_counts_per_rev")?,
                speed_filter_time_constant_s: t.number("sensors", "speed_filter_time_constant_s")?,
                speed_filter_tol: t.tolerance("sensors", "speed_filter_time_constant_s")?,
                thrust_filter_hz: t.number("sensors", "thrust_filter_hz")?,
                thrust_full_scale_n: t.number("sensors", "thrust_full_scale_n")?,
                thrust_bits: t.number("sensors", "thrust_bits")?.map(|b| b as u32),
                torque_filter_hz: t.number("sensors", "torque_filter_hz")?,
                flow_rate_hz: t.number("sensors", "flow_rate_hz")?,
                torque_transducer,
                ambient_flow_recorded,
                thrust_sensor: fitted("thrust")?,
                flow_meter: fitted("flow")?,
            },
            water: t.text("run", "water")?.unwrap_or_else(|| "not stated".into()),
        })
    }
}

/// A description's tables.
pub(super) struct Reader<'a> {
    table: &'a toml::Table,
}

impl Reader<'_> {
    fn get(&self, table: &str, key: &str) -> Option<&toml::Value> {
        self.table.get(table)?.get(key)
    }

    /// Keys of a table, in order.
    pub(super) fn keys(&self, table: &str) -> impl Iterator<Item = &str> {
        self.table
            .get(table)
            .and_then(toml::Value::as_table)
            .into_iter()
            .flat_map(|t| t.keys().map(String::as_str))
    }

    pub(super) fn text(&self, table: &str, key: &str) -> Result<Option<String>, RigError> {
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

    pub(super) fn number(&self, table: &str, key: &str) -> Result<Option<f64>, RigError> {
        Ok(self.quantity(table, key)?.map(|q| q.value))
    }

    fn tolerance(&self, table: &str, key: &str) -> Result<Option<f64>, RigError> {
        Ok(self.quantity(table, key)?.and_then(|q| q.tol))
    }

    pub(super) fn quantity(&self, table: &str, key: &str) -> Result<Option<Quantity>, RigError> {
        let Some(found) = self.get(table, key) else { return Ok(None) };
        let name = format!("{table}.{key}");
        let quantity = quantity(&name, found)?;
        let entry = KEYS.iter().find(|k| k.0 == table && k.1 == key);
        if let Some((_, _, Some((low, high)), hint)) = entry
            && !(quantity.value >= *low && quantity.value <= *high)
        {
            return Err(value_error(&name, quantity.value, &format!("{low} to {high}"), hint));
        }
        Ok(Some(quantity))
    }

    pub(super) fn need(&self, table: &str, key: &str) -> Result<Quantity, RigError> {
        self.quantity(table, key)?.ok_or_else(|| RigError::Missing {
            key: format!("{table}.{key}"),
            hint: KEYS
                .iter()
                .find(|k| k.0 == table && k.1 == key)
                .map_or_else(String::new, |k| format!("add {key} = … under [{table}]; {}", k.3)),
        })
    }
}

/// A number, or a table of value and tolerance, that stands under this name.
pub(super) fn quantity(name: &str, found: &toml::Value) -> Result<Quantity, RigError> {
    let form = "a number, or { value = 0.542, tol = 0.15 }";
    let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
    Ok(match found {
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
                .ok_or_else(|| value_error(name, found, form, "`value` must be a number"))?;
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
            number(other).ok_or_else(|| value_error(name, other, form, "no quotes, a decimal point"))?,
        ),
    })
}
