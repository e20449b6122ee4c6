//! Reads a rig description.

use super::keys::{KEYS, check_keys, nearest, value_error};
use super::{
    Amplifier, AmplifierKind, Flow, Load, Motor, Propeller, Quantity, Rig, RigError, Sensors, known,
};

impl Rig {
    /// Reads a rig description.
    ///
    /// # Errors
    /// [`RigError`] names the key, the value found, what is allowed and what to do; of several the first.
    pub fn from_toml(text: &str) -> Result<Self, RigError> {
        // There is at least one where there is no rig.
        let nothing = || RigError::Syntax { message: String::new() };
        Self::from_toml_with_all(text).map_err(|wrong| wrong.into_iter().next().unwrap_or_else(nothing))
    }

    /// As [`Self::from_toml`], with everything that is wrong. A key that is misspelt is told as such, and not as missing too; a
    /// text that is no TOML is told up to where its parser ends.
    ///
    /// # Errors
    /// What is wrong, in the order in which it is read; at least one.
    pub fn from_toml_with_all(text: &str) -> Result<Self, Vec<RigError>> {
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| {
            vec![RigError::Syntax { message: e.to_string().trim_end().into() }]
        })?;
        let mut reader = Reader { table: &table, wrong: Vec::new(), meant: Vec::new() };
        check_keys(&table, &mut reader.wrong, &mut reader.meant);
        let rig = reader.rig();
        if reader.wrong.is_empty() { Ok(rig) } else { Err(reader.wrong) }
    }
}

/// A description's tables, and what is wrong with them. What cannot be read is not a number, or the usual: a rig of it is
/// never handed out.
pub(super) struct Reader<'a> {
    table: &'a toml::Table,
    pub(super) wrong: Vec<RigError>,
    /// What misspelt keys and tables were probably meant to be.
    meant: Vec<String>,
}

impl Reader<'_> {
    fn rig(&mut self) -> Rig {
        let (propeller, flow) = self.water();
        let kinds = [
            ("current", AmplifierKind::Current),
            ("voltage", AmplifierKind::Voltage),
            ("speed", AmplifierKind::Speed),
        ];
        let hint = "say what the drive's command input controls";
        let kind = self.choice("amplifier", "kind", &kinds, hint).unwrap_or(AmplifierKind::Current);
        let motor = self.motor(kind);
        let sensors = self.sensors();
        let current_limit = self.quantity("amplifier", "current_limit_a");
        Rig {
            load: Load::read(self),
            effects: known::read(self.table, &mut self.wrong),
            name: self.text("rig", "name").unwrap_or_else(|| "unnamed".into()),
            class: self.text("rig", "class").unwrap_or_default(),
            propeller,
            flow,
            motor,
            amplifier: Amplifier {
                kind,
                time_constant_s: self
                    .quantity("amplifier", "time_constant_s")
                    .unwrap_or(Quantity::exact(0.0)),
                current_limit_a: current_limit.map_or(f64::INFINITY, |limit| limit.value),
                current_limit_tol: current_limit.and_then(|limit| limit.tol),
                supply_v: self.number("amplifier", "supply_v"),
            },
            sensors,
            water: self.text("run", "water").unwrap_or_else(|| "not stated".into()),
        }
    }

    /// The propeller, which a dry shaft has none of, and the water around it.
    fn water(&mut self) -> (Option<Propeller>, Flow) {
        if self.text("propeller", "kind").as_deref() == Some("none") {
            let density = self.quantity("flow", "density_kg_m3");
            let flow = Flow {
                density_kg_m3: density.unwrap_or(Quantity::exact(998.0)),
                flux_coefficient: Quantity::exact(2.0),
                added_mass_coefficient: Quantity::exact(1.0),
            };
            return (None, flow);
        }
        let propeller = Propeller {
            radius_m: self.need("propeller", "radius_m"),
            duct_length_m: self.need("propeller", "duct_length_m"),
            pitch_rad: self.need("propeller", "pitch_rad"),
            lift_max: self.need("propeller", "lift_max"),
            drag_max: self.need("propeller", "drag_max"),
        };
        let flow = Flow {
            density_kg_m3: self.need("flow", "density_kg_m3"),
            flux_coefficient: self.need("flow", "flux_coefficient"),
            added_mass_coefficient: self.need("flow", "added_mass_coefficient"),
        };
        (Some(propeller), flow)
    }

    fn motor(&mut self, kind: AmplifierKind) -> Motor {
        let motor = Motor {
            inertia_kg_m2: self.need("motor", "inertia_kg_m2"),
            torque_constant_nm_a: self.need("motor", "torque_constant_nm_a"),
            winding_resistance_ohm: self.quantity("motor", "winding_resistance_ohm"),
            viscous_friction_nm_s: self.quantity("motor", "viscous_friction_nm_s"),
        };
        if kind == AmplifierKind::Voltage {
            let hint =
                "a voltage drive needs the winding's resistance, for example winding_resistance_ohm = 2.2";
            self.miss("motor", "winding_resistance_ohm", hint.into());
        }
        motor
    }

    fn sensors(&mut self) -> Sensors {
        let torque = [("none", false), ("propeller-side transducer", true)];
        let torque_hint = "leave the key out if there is no torque transducer";
        let ambient = [("recorded", true), ("not recorded", false)];
        let ambient_hint = "\"recorded\" means the recording has a column ambient_m_s";
        let fitted = [("fitted", true), ("none", false)];
        let fitted_hint = "\"none\" if nothing measures it";
        let speed_filter = self.quantity("sensors", "speed_filter_time_constant_s");
        Sensors {
            log_rate_hz: self.number("sensors", "log_rate_hz"),
            control_rate_hz: self.number("sensors", "control_rate_hz"),
            // Before a gear of uneven ratio no whole number of them makes a turn of the shaft.
            encoder_counts_per_rev: self.number("sensors", "encoder_counts_per_rev"),
            speed_filter_time_constant_s: speed_filter.map(|filter| filter.value),
            speed_filter_tol: speed_filter.and_then(|filter| filter.tol),
            thrust_filter_hz: self.number("sensors", "thrust_filter_hz"),
            thrust_full_scale_n: self.number("sensors", "thrust_full_scale_n"),
            thrust_bits: self.count("sensors", "thrust_bits").map(|b| b as u32),
            torque_filter_hz: self.number("sensors", "torque_filter_hz"),
            flow_rate_hz: self.number("sensors", "flow_rate_hz"),
            torque_transducer: self.choice("sensors", "torque", &torque, torque_hint).unwrap_or(false),
            ambient_flow_recorded: self
                .choice("sensors", "ambient_flow", &ambient, ambient_hint)
                .unwrap_or(false),
            thrust_sensor: self.choice("sensors", "thrust", &fitted, fitted_hint).unwrap_or(true),
            flow_meter: self.choice("sensors", "flow", &fitted, fitted_hint).unwrap_or(true),
        }
    }

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

    fn text(&mut self, table: &str, key: &str) -> Option<String> {
        let found = self.get(table, key)?;
        if let toml::Value::String(text) = found {
            return Some(text.clone());
        }
        let name = format!("{table}.{key}");
        let error = value_error(&name, found, "a text in quotes", "put it in double quotes");
        self.wrong.push(error);
        None
    }

    /// What the text of a key, which is one of these, stands for.
    pub(super) fn choice<T: Copy>(
        &mut self,
        table: &str,
        key: &str,
        choices: &[(&str, T)],
        hint: &str,
    ) -> Option<T> {
        let text = self.text(table, key)?;
        let chosen = choices.iter().find(|(name, _)| *name == text);
        if chosen.is_none() {
            let names: Vec<String> = choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
            let allowed = match names.split_last() {
                Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
                _ => names.concat(),
            };
            self.wrong.push(value_error(&format!("{table}.{key}"), text, &allowed, hint));
        }
        chosen.map(|(_, value)| *value)
    }

    fn number(&mut self, table: &str, key: &str) -> Option<f64> {
        self.quantity(table, key).map(|q| q.value)
    }

    /// A number that counts something.
    fn count(&mut self, table: &str, key: &str) -> Option<f64> {
        let found = self.number(table, key)?;
        if found.fract() != 0.0 {
            let name = format!("{table}.{key}");
            self.wrong.push(value_error(
                &name,
                found,
                "a whole number",
                "what is counted is whole: 4096, 12",
            ));
            return None;
        }
        Some(found)
    }

    /// What stands there and is allowed.
    pub(super) fn quantity(&mut self, table: &str, key: &str) -> Option<Quantity> {
        let found = self.table.get(table)?.get(key)?;
        let name = format!("{table}.{key}");
        let quantity = quantity(&name, found, &mut self.wrong)?;
        let entry = KEYS.iter().find(|k| k.0 == table && k.1 == key);
        if let Some((_, _, Some((low, high)), hint)) = entry
            && !(quantity.value >= *low && quantity.value <= *high)
        {
            self.wrong.push(value_error(&name, quantity.value, &format!("{low} to {high}"), hint));
            return None;
        }
        Some(quantity)
    }

    /// What must stand there.
    pub(super) fn need(&mut self, table: &str, key: &str) -> Quantity {
        let hint = KEYS
            .iter()
            .find(|k| k.0 == table && k.1 == key)
            .map_or_else(String::new, |k| format!("add {key} = … under [{table}]; {}", k.3));
        self.miss(table, key, hint);
        self.quantity(table, key).unwrap_or(Quantity::exact(f64::NAN))
    }

    /// Says that a key is missing, if it is: one that stands there misspelt, or whose table does, is told already.
    fn miss(&mut self, table: &str, key: &str, hint: String) {
        let name = format!("{table}.{key}");
        let no_table = self.table.get(table).is_some_and(|value| !value.is_table());
        let told = no_table || self.meant.iter().any(|meant| *meant == table || *meant == name);
        if self.get(table, key).is_none() && !told {
            self.wrong.push(RigError::Missing { key: name, hint });
        }
    }
}

/// A number, or a table of value and tolerance, that stands under this name.
pub(super) fn quantity(name: &str, found: &toml::Value, wrong: &mut Vec<RigError>) -> Option<Quantity> {
    let form = "a number, or { value = 0.542, tol = 0.15 }";
    let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
    let toml::Value::Table(t) = found else {
        let value = number(found);
        if value.is_none() {
            wrong.push(value_error(name, found, form, "no quotes, a decimal point"));
        }
        return value.map(Quantity::exact);
    };
    let before = wrong.len();
    for odd in t.keys().filter(|k| *k != "value" && *k != "tol") {
        wrong.push(RigError::UnknownKey {
            key: format!("{name}.{odd}"),
            hint: nearest(odd, ["value", "tol"].into_iter()),
        });
    }
    let value = t.get("value").and_then(number);
    if value.is_none() && (t.contains_key("value") || wrong.len() == before) {
        wrong.push(value_error(name, found, form, "`value` must be a number"));
    }
    let tol = t.get("tol").map(|v| (v, number(v).filter(|t| (0.0..=2.0).contains(t))));
    if let Some((found, None)) = tol {
        let hint = "tol is relative, two sigma: 0.15 for 15 %";
        wrong.push(value_error(&format!("{name}.tol"), found, "0 to 2", hint));
    }
    let tol = tol.and_then(|(_, tol)| tol).filter(|tol| *tol > 0.0);
    value.filter(|_| wrong.len() == before).map(|value| Quantity { value, tol })
}
