//! Writes what was found into a rig description's text; order, all else, and its comments stay as they are, but for the one
//! behind a value that was replaced: it told where that one came from, and now tells who found the new one.

use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value};

use super::keys::value_error;
use super::{Quantity, Rig, RigError};

/// Least and largest tolerance written: what a rig may state.
pub const TOL: (f64, f64) = (1e-4, 2.0);

/// An effect to be written, with its values by name.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundEffect<'a> {
    /// Its identifier in the catalogue.
    pub effect: &'a str,
    /// Values by parameter name; strengths that are zero need not stand here.
    pub parameters: Vec<(&'a str, Quantity)>,
}

impl Rig {
    /// The text of a rig description with these effects among its `[[effects]]`: one that stands there already
    /// gets the new values, others are added at the end. Six digits are kept. `by` stands behind each value,
    /// for example "found by kort diagnose".
    ///
    /// # Errors
    /// [`RigError`] if the text is no rig description, or what would be written is none.
    pub fn with_effects_toml(text: &str, found: &[FoundEffect], by: &str) -> Result<String, RigError> {
        Self::from_toml(text)?;
        let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| RigError::Syntax {
            message: e.to_string().trim_end().into(),
        })?;
        if found.is_empty() {
            return Ok(text.into());
        }
        let list = document.entry("effects").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
        // `effects = [{ … }]` says the same in one line.
        if let Some(array) = list.as_array() {
            let tables = array.iter().filter_map(Value::as_inline_table);
            let tables: ArrayOfTables = tables.map(|t| t.clone().into_table()).collect();
            *list = Item::ArrayOfTables(tables);
        }
        let list = list.as_array_of_tables_mut().ok_or_else(|| {
            value_error("effects", "another value", "a list: [[effects]] before each", "write [[effects]]")
        })?;
        for effect in found {
            let stands =
                list.iter().position(|t| t.get("effect").and_then(Item::as_str) == Some(effect.effect));
            match stands.and_then(|k| list.get_mut(k)) {
                Some(table) => fill(table, effect, by),
                None => {
                    let mut table = Table::new();
                    fill(&mut table, effect, by);
                    list.push(table);
                }
            }
        }
        let written = document.to_string();
        Self::from_toml(&written)?;
        Ok(written)
    }
}

/// Puts an effect's values into its table; those that stand there and are not among them go.
fn fill(table: &mut Table, effect: &FoundEffect, by: &str) {
    let keep = |key: &str| key == "effect" || effect.parameters.iter().any(|(name, _)| *name == key);
    let stale: Vec<String> = table.iter().map(|(k, _)| k.to_owned()).filter(|k| !keep(k)).collect();
    stale.iter().for_each(|key| {
        table.remove(key);
    });
    table.insert("effect", Item::Value(effect.effect.into()));
    for (name, quantity) in &effect.parameters {
        let mut value = written(*quantity);
        value.decor_mut().set_suffix(format!(" # {by}"));
        table.insert(name, Item::Value(value));
    }
}

/// A quantity as it stands in a rig description.
pub fn written(quantity: Quantity) -> Value {
    let Some(tol) = quantity.tol else { return short(quantity.value).into() };
    let mut both = InlineTable::new();
    both.insert("value", short(quantity.value).into());
    both.insert("tol", short(tol.clamp(TOL.0, TOL.1)).into());
    Value::InlineTable(both)
}

/// Six significant digits.
pub fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}
