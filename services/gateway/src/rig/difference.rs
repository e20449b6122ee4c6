//! What differs between two rig descriptions, value by value; comments, order and notation are no difference.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Number, Value, json};
use toml::Table;
use utoipa::ToSchema;

/// A value that differs.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Change {
    /// Its key with its table; a value of a known effect stands under `effects.` and the effect's name.
    #[schema(example = "effects.coulomb_friction.coulomb_torque_n_m")]
    pub key: String,
    /// What stood there: a number, a text, or a number with its tolerance; null if nothing did.
    #[schema(value_type = Value)]
    pub before: Option<Value>,
    /// What stands there now; null if nothing does.
    #[schema(value_type = Value, example = json!({"value": 0.31, "tol": 0.1}))]
    pub after: Option<Value>,
}

/// Every value that differs, in the order of the keys. A text that is no TOML counts as empty.
pub fn between(before: &str, after: &str) -> Vec<Change> {
    let (mut before, mut after) = (values(before), values(after));
    before.retain(|key, value| {
        let same = after.get(key) == Some(value);
        if same {
            after.remove(key);
        }
        !same
    });
    let mut changes: Vec<Change> = before
        .into_iter()
        .map(|(key, value)| {
            let after = after.remove(&key);
            Change { key, before: Some(value), after }
        })
        .collect();
    changes.extend(after.into_iter().map(|(key, value)| Change { key, before: None, after: Some(value) }));
    changes.sort_by(|a, b| a.key.cmp(&b.key));
    changes
}

/// Does any value differ?
pub fn differ(before: &str, after: &str) -> bool {
    !between(before, after).is_empty()
}

/// The keys that differ, in words for the event log.
pub fn words(changes: &[Change]) -> String {
    const NAMED: usize = 4;
    let keys: Vec<&str> = changes.iter().take(NAMED).map(|change| change.key.as_str()).collect();
    match (changes.len(), changes.len().saturating_sub(NAMED)) {
        (0, _) => "no value differs".into(),
        (_, 0) => format!("{} differ", keys.join(", ")),
        (_, more) => format!("{} and {more} more differ", keys.join(", ")),
    }
}

fn values(text: &str) -> BTreeMap<String, Value> {
    let mut found = BTreeMap::new();
    if let Ok(table) = text.parse::<Table>() {
        take(&mut found, "", &table);
    }
    found
}

fn take(found: &mut BTreeMap<String, Value>, under: &str, table: &Table) {
    for (key, value) in table {
        let key = if under.is_empty() { key.clone() } else { format!("{under}.{key}") };
        match value {
            toml::Value::Table(inner) if !is_quantity(inner) => take(found, &key, inner),
            toml::Value::Array(list) if key == "effects" => effects(found, list),
            value => drop(found.insert(key, plain(value))),
        }
    }
}

/// Each effect under its name; one that stands there twice has its number too.
fn effects(found: &mut BTreeMap<String, Value>, list: &[toml::Value]) {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for effect in list.iter().filter_map(toml::Value::as_table) {
        let name = effect.get("effect").and_then(toml::Value::as_str).unwrap_or("unnamed");
        let times = seen.entry(name).or_default();
        *times += 1;
        let under = if *times == 1 { format!("effects.{name}") } else { format!("effects.{name}#{times}") };
        // The name itself says that the effect is there, whatever its values.
        found.insert(under.clone(), json!(true));
        let mut rest = effect.clone();
        rest.remove("effect");
        take(found, &under, &rest);
    }
}

fn is_quantity(table: &Table) -> bool {
    table.contains_key("value") && table.keys().all(|key| key == "value" || key == "tol")
}

/// As JSON; 1 and 1.0 are one number, and so is one without tolerance in either notation.
fn plain(value: &toml::Value) -> Value {
    match value {
        toml::Value::Integer(n) => number(*n as f64),
        toml::Value::Float(x) => number(*x),
        toml::Value::Table(table) if table.len() == 1 && is_quantity(table) => plain(&table["value"]),
        toml::Value::Table(table) => {
            Value::Object(table.iter().map(|(key, value)| (key.clone(), plain(value))).collect())
        }
        toml::Value::Array(list) => Value::Array(list.iter().map(plain).collect()),
        toml::Value::String(text) => json!(text),
        toml::Value::Boolean(yes) => json!(yes),
        toml::Value::Datetime(time) => json!(time.to_string()),
    }
}

fn number(x: f64) -> Value {
    Number::from_f64(x).map_or(Value::Null, Value::Number)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: &str =
        "# a stand\n[motor]\ninertia_kg_m2 = 1\ntorque_constant_nm_a = { value = 1.2, tol = 0.1 }\n";

    #[test]
    fn notation_and_comments_are_no_difference() {
        let same = "[motor]\ntorque_constant_nm_a.value = 1.2\ntorque_constant_nm_a.tol = 0.1\ninertia_kg_m2 = { value = 1.0 }\n";
        assert_eq!(between(RIG, same), []);
        assert_eq!(words(&[]), "no value differs");
    }

    #[test]
    fn what_is_new_gone_or_other_is_named() {
        let other = "[motor]\ninertia_kg_m2 = 2\nviscous_friction_nm_s = 0.1\n\
            [[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = 0.3\n";
        let found = between(RIG, other);
        let keys: Vec<&str> = found.iter().map(|change| change.key.as_str()).collect();
        assert_eq!(
            keys,
            [
                "effects.coulomb_friction",
                "effects.coulomb_friction.coulomb_torque_n_m",
                "motor.inertia_kg_m2",
                "motor.torque_constant_nm_a",
                "motor.viscous_friction_nm_s"
            ]
        );
        assert_eq!((&found[2].before, &found[2].after), (&Some(json!(1.0)), &Some(json!(2.0))));
        assert_eq!((&found[3].before, &found[3].after), (&Some(json!({"value": 1.2, "tol": 0.1})), &None));
        assert!(words(&found).ends_with("and 1 more differ"), "{}", words(&found));
    }
}
