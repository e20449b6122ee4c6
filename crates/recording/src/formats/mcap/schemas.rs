//! JSON schemas of what a live recording's channels hold: by them Foxglove and its kin list the fields, each with unit and meaning.
//!
//! Foxglove's reader takes plain types alone, one each, and wants `properties` in every object: it refuses a channel whose schema has
//! anything else, so what may be null is called by its type.

use kort_proto::messages::{PATHS, RESIDUALS};
use kort_proto::signals::{ESTIMATES, Kind, SIGNALS, Signal};
use serde_json::{Map, Value, json};

use crate::columns;
use crate::units;

/// Schema of the rows.
pub(super) const ROWS: &str = "kort.recording/1";
/// Schemas of channels that stand beside them.
pub(super) const STATE: &str = "kort.state/1";
pub(super) const EVENT: &str = "kort.event/1";
pub(super) const BESIDE: [&str; 2] = [STATE, EVENT];

/// Of a message with these columns beside `time_s`.
pub fn rows(columns: &[&str]) -> Value {
    let of = |name: &&str| {
        let number = match columns::find(name) {
            Some(known) => number(known.meaning, known.unit),
            None => number("", units::of_column(name).map_or("1", |unit| unit.symbol)),
        };
        ((*name).to_owned(), number)
    };
    let properties: Map<String, Value> = std::iter::once(&"time_s").chain(columns).map(of).collect();
    json!({"type": "object", "title": ROWS, "properties": properties, "required": ["time_s"]})
}

/// Of a thruster's state.
pub fn state() -> Value {
    let parameter = object([
        ("name", text("Name of the parameter.")),
        ("value", number("Estimate, in the unit beside it.", "")),
        ("unit", text("SI unit.")),
        ("std_error", number("Standard error of the estimate, in the unit beside it.", "")),
    ]);
    let mut estimated = signals(ESTIMATES, |_| true);
    estimated["properties"]["parameters"] = list(parameter);
    let named = |what: &str, names: &[&str], key: &str, value: Value| {
        list(object([(what, text(&names.join(", "))), (key, value)]))
    };
    let mismatch = object([
        ("paths", named("path", &PATHS, "level", number("How near a path is to an alarm; 1 is one.", "1"))),
        ("alarm", text("The path that has changed.")),
        ("since_s", number("Time since it began.", "s")),
        (
            "residuals",
            named(
                "residual",
                &RESIDUALS,
                "share",
                number("Measured less expected, of what is expected.", "1"),
            ),
        ),
    ]);
    let latched = object([
        ("code", json!({"type": "integer"})),
        ("name", text("Name of the fault.")),
        ("help", text("What to do.")),
    ]);
    let mut state = object([
        ("time_s", number("The servo's monotonic time of the measurements.", "s")),
        ("id", text("Name of the thruster.")),
        ("armed", json!({"type": "boolean"})),
        ("controller", text("Control law that runs.")),
        ("observer", text("Observer that runs.")),
        ("estimator", text("Estimator that runs.")),
        (
            "setpoint",
            object([
                ("thrust_n", number("Thrust in force; positive pushes ahead.", "N")),
                ("speed_rad_s", number("Shaft speed in force; positive turns ahead.", "rad/s")),
            ]),
        ),
        ("commanded", signals(SIGNALS, |kind| kind == Kind::Command)),
        ("measured", signals(SIGNALS, |kind| kind == Kind::Measured)),
        ("estimated", estimated),
        ("mismatch", mismatch),
        ("faults", list(latched)),
        ("limits", list(object([("name", text("Limit in force.")), ("meaning", text("What it does."))]))),
    ]);
    state["title"] = STATE.into();
    state
}

/// Of an event.
pub(super) fn event() -> Value {
    let texts = [
        ("time", "Wall time, RFC 3339."),
        ("kind", "What happened."),
        ("thruster", "The thruster; none where it concerns all."),
        ("who", "Who did it."),
        ("detail", "What exactly, in words."),
    ];
    let mut event = object(texts.map(|(name, meaning)| (name, text(meaning))));
    event["title"] = EVENT.into();
    event
}

fn number(meaning: &str, unit: &str) -> Value {
    match unit {
        "" => json!({"type": "number", "description": meaning}),
        unit => {
            json!({"type": "number", "description": format!("{meaning} [{unit}]").trim_start(), "unit": unit})
        }
    }
}

fn text(meaning: &str) -> Value {
    json!({"type": "string", "description": meaning})
}

fn list(item: Value) -> Value {
    json!({"type": "array", "items": item})
}

fn object<const N: usize>(fields: [(&str, Value); N]) -> Value {
    let properties: Map<String, Value> =
        fields.into_iter().map(|(name, field)| (name.to_owned(), field)).collect();
    json!({"type": "object", "properties": properties})
}

fn signals<T>(table: &[Signal<T>], of: impl Fn(Kind) -> bool) -> Value {
    let rows = table.iter().filter(|row| of(row.kind));
    let properties: Map<String, Value> =
        rows.map(|row| (row.name.to_owned(), number(row.meaning, row.unit))).collect();
    json!({"type": "object", "properties": properties})
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As Foxglove's reader goes through a schema (studio's parseJsonSchema.ts, MPL): what it would throw at is named.
    fn refused(at: &str, schema: &Value) -> Vec<String> {
        let kind = schema["type"].as_str().unwrap_or("none");
        match kind {
            "boolean" | "string" | "number" | "integer" if schema.get("oneOf").is_none() => Vec::new(),
            "array" if schema["items"]["type"] != "array" => refused(at, &schema["items"]),
            "object" => match schema["properties"].as_object() {
                Some(fields) => {
                    fields.iter().flat_map(|(name, field)| refused(&format!("{at}.{name}"), field)).collect()
                }
                None => vec![format!("{at}: no properties")],
            },
            other => vec![format!("{at}: {other}")],
        }
    }

    #[test]
    fn every_schema_is_one_that_foxglove_takes_and_every_signal_has_its_unit() {
        let rows = rows(&["thrust_n", "duty_cmd", "valve_open"]);
        for (name, schema) in [(ROWS, &rows), (STATE, &state()), (EVENT, &event())] {
            assert_eq!(refused(name, schema), Vec::<String>::new());
        }
        let field = |name: &str| &rows["properties"][name];
        assert_eq!(field("thrust_n")["unit"], "N");
        assert_eq!(field("thrust_n")["description"], "Thrust; positive pushes ahead. [N]");
        assert_eq!(
            (&field("duty_cmd")["unit"], &field("valve_open")["description"]),
            (&"1".into(), &"[1]".into())
        );
        let state = state();
        for part in ["commanded", "measured", "estimated"] {
            let fields = state["properties"][part]["properties"].as_object().unwrap();
            for (name, field) in fields.iter().filter(|(name, _)| *name != "parameters") {
                assert!(field["unit"].is_string(), "{part}.{name}: {field}");
            }
        }
    }
}
