//! A column map's text: its keys, and what each may be.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::ask::{Ask, Asked, Given};
use super::{ColumnMap, MapError, Mapped, Select, Stamps, Time, fail};
use crate::columns;
use crate::dates::{self, Order};
use crate::units;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    #[serde(default)]
    description: String,
    delimiter: Option<String>,
    decimal: Option<String>,
    #[serde(default)]
    ask: BTreeMap<String, Ask>,
    time: RawTime,
    select: Option<Select>,
    columns: BTreeMap<String, RawColumn>,
    #[serde(default)]
    ignored: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTime {
    source: Option<String>,
    unit: Option<String>,
    order: Option<String>,
    stale_rows: Option<String>,
    settle_s: Option<f64>,
    clock: Option<String>,
    rows_of: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawColumn {
    source: String,
    unit: Option<String>,
    #[serde(default)]
    optional: bool,
    sign: Option<f64>,
    scale: Option<f64>,
    divide_by: Option<String>,
    offset: Option<f64>,
    #[serde(default)]
    table: Vec<[f64; 2]>,
    sign_of: Option<String>,
    sign_zero: Option<f64>,
}

/// Reads a map, with what the user said where it is to be used.
pub(super) fn map(name: &str, text: &str, asked: Option<&Asked>) -> Result<ColumnMap, MapError> {
    let raw: RawMap = toml::from_str(text).map_err(|e| {
        fail(name, e.to_string().trim_end(), "docs/recordings.md lists the keys of a column map")
    })?;
    if raw.columns.is_empty() {
        return Err(fail(
            name,
            "[columns] is empty",
            "name at least one of our columns, for example [columns.thrust_n]",
        ));
    }
    let given = Given::new(name, &raw.ask, asked)?;
    let columns = raw
        .columns
        .into_iter()
        .map(|(target, column)| column.check(name, target, &given))
        .collect::<Result<Vec<_>, _>>()?;
    let mut time = raw.time.check(name)?;
    if let Time::Clock { rows_of: Some(topic) } = &mut time {
        *topic = given.fill(name, topic)?;
    }
    Ok(ColumnMap {
        name: name.into(),
        description: raw.description,
        delimiter: delimiter(name, raw.delimiter.as_deref())?,
        decimal_comma: decimal_comma(name, raw.decimal.as_deref())?,
        time,
        given: given.into_pairs(),
        select: raw.select,
        columns,
        ignored: raw.ignored,
    })
}

/// A map before it is filled in.
pub(super) struct Asks {
    /// What it asks for, with a value of each.
    pub given: Vec<(String, String)>,
    /// Its sources as they stand in the file.
    pub sources: Vec<String>,
}

/// What a map asks for.
pub(super) fn asks(name: &str, text: &str) -> Option<Asks> {
    let raw: RawMap = toml::from_str(text).ok()?;
    let given = Given::new(name, &raw.ask, None).ok()?.into_pairs();
    Some(Asks { given, sources: raw.columns.into_values().map(|column| column.source).collect() })
}

fn delimiter(map: &str, wanted: Option<&str>) -> Result<Option<u8>, MapError> {
    match wanted {
        None => Ok(None),
        Some(",") => Ok(Some(b',')),
        Some(";") => Ok(Some(b';')),
        Some("\t") => Ok(Some(b'\t')),
        Some(other) => Err(fail(
            map,
            format!("delimiter = {other:?}; allowed: \",\", \";\", \"\\t\""),
            "what parts the cells of the CSV file",
        )),
    }
}

fn decimal_comma(map: &str, wanted: Option<&str>) -> Result<bool, MapError> {
    match wanted {
        None | Some(".") => Ok(false),
        Some(",") => Ok(true),
        Some(other) => Err(fail(
            map,
            format!("decimal = {other:?}; allowed: \".\", \",\""),
            "the decimal mark of the numbers in the CSV file",
        )),
    }
}

fn stamps(map: &str, unit: Option<&str>, order: Option<&str>) -> Result<Stamps, MapError> {
    let Some(symbol) = unit else {
        return Err(fail(
            map,
            "time.unit is missing",
            "write unit = \"s\", \"ms\", \"us\" or \"ns\", or \"date\" for dates with their time of day; it is never guessed",
        ));
    };
    if symbol == dates::UNIT {
        return Ok(Stamps::Dates { order: order.map(|order| self::order(map, order)).transpose()? });
    }
    if order.is_some() {
        return Err(fail(map, "time.order needs unit = \"date\"", "it says what a date begins with"));
    }
    let unit = units::find(symbol).filter(|unit| unit.si == "s").ok_or_else(|| {
        let allowed = units::siblings("s");
        let message =
            format!("time.unit = \"{symbol}\" is no unit of time; allowed: {allowed}, \"{}\"", dates::UNIT);
        fail(map, message, "write the unit of the stamps")
    })?;
    Ok(Stamps::Numbers { to_s: unit.factor })
}

fn order(map: &str, wanted: &str) -> Result<Order, MapError> {
    Order::ALL.into_iter().find(|order| order.name() == wanted).ok_or_else(|| {
        let allowed = Order::ALL.map(|order| format!("\"{}\"", order.name())).join(", ");
        fail(map, format!("time.order = \"{wanted}\"; allowed: {allowed}"), "what a date begins with")
    })
}

impl RawTime {
    fn of_messages(&self, map: &str, clock: &str) -> Result<Time, MapError> {
        if clock != "log" {
            return Err(fail(
                map,
                format!("time.clock = \"{clock}\"; allowed: \"log\""),
                "the stamps that the log of messages has; a table names its column of stamps in `source`",
            ));
        }
        if self.source.is_some()
            || self.unit.is_some()
            || self.order.is_some()
            || self.settle_s.is_some()
            || self.stale_rows.is_some()
        {
            return Err(fail(
                map,
                "[time] has both `clock` and keys of a table; allowed beside `clock`: `rows_of`",
                "a log of messages has its stamps in seconds already",
            ));
        }
        Ok(Time::Clock { rows_of: self.rows_of.clone() })
    }

    fn check(self, map: &str) -> Result<Time, MapError> {
        if let Some(clock) = &self.clock {
            return self.of_messages(map, clock);
        }
        if self.rows_of.is_some() {
            return Err(fail(
                map,
                "time.rows_of needs clock = \"log\"",
                "it names a message of a log of messages",
            ));
        }
        match (self.source, self.settle_s) {
            (Some(source), None) => {
                let stamps = stamps(map, self.unit.as_deref(), self.order.as_deref())?;
                let drop_stale = match self.stale_rows.as_deref() {
                    None | Some("refuse") => false,
                    Some("drop") => true,
                    Some(other) => {
                        return Err(fail(
                            map,
                            format!("time.stale_rows = \"{other}\"; allowed: \"refuse\", \"drop\""),
                            "\"drop\" skips rows whose stamp does not come after the one before",
                        ));
                    }
                };
                Ok(Time::Column { source, stamps, drop_stale })
            }
            (None, Some(settle_s)) if settle_s.is_finite() && settle_s > 0.0 => {
                Ok(Time::Settled { settle_s })
            }
            (None, Some(settle_s)) => Err(fail(
                map,
                format!("time.settle_s = {settle_s}; allowed: above 0"),
                "seconds that a point of the table is held",
            )),
            (found, _) => Err(fail(
                map,
                if found.is_some() {
                    "[time] has both `source` and `settle_s`; allowed: one of them"
                } else {
                    "[time] has neither `source` nor `settle_s`"
                },
                "name the column of stamps in `source`; `settle_s` is for tables of settled points",
            )),
        }
    }
}

impl RawColumn {
    fn check(self, map: &str, name: String, given: &Given) -> Result<Mapped, MapError> {
        let at = |field: &str| format!("columns.{name}.{field}");
        if name == "time_s" {
            return Err(fail(
                map,
                "columns.time_s: time has its own table",
                "name the column of stamps in [time]",
            ));
        }
        let Some(symbol) = self.unit else {
            return Err(fail(
                map,
                format!("{} is missing", at("unit")),
                "write the unit of the source column; it is never guessed (\"1\" if it has none)",
            ));
        };
        let target_si = match columns::find(&name) {
            Some(known) => known.unit,
            None => match columns::unit_missing(&name) {
                Some(near) => {
                    let hint = near.map_or("end the name in its SI unit".into(), |k| {
                        format!("did you mean `{}`?", k.name)
                    });
                    return Err(fail(
                        map,
                        format!("columns.{name} has no SI unit at the end of its name"),
                        &hint,
                    ));
                }
                None => units::of_column(&name).map_or("1", |u| u.si),
            },
        };
        let unit = units::find(&symbol).filter(|u| u.si == target_si).ok_or_else(|| {
            fail(
                map,
                format!(
                    "{} = \"{symbol}\" cannot become {target_si}; allowed: {}",
                    at("unit"),
                    units::siblings(target_si)
                ),
                "`unit` is the unit after sign, scale and offset",
            )
        })?;
        let finite = |field: &str, value: Option<f64>, default: f64| match value.unwrap_or(default) {
            v if v.is_finite() => Ok(v),
            v => {
                Err(fail(map, format!("{} = {v}; allowed: a finite number", at(field)), "correct the number"))
            }
        };
        let sign = finite("sign", self.sign, 1.0)?;
        if sign.abs() != 1.0 {
            return Err(fail(
                map,
                format!("{} = {sign}; allowed: 1 or -1", at("sign")),
                "use `scale` for a factor",
            ));
        }
        let scale = finite("scale", self.scale, 1.0)?;
        let scale = match &self.divide_by {
            None => scale,
            Some(by) => match given.fill(map, by)?.trim().parse::<f64>() {
                Ok(by) if by.is_finite() && by != 0.0 => scale / by,
                _ => {
                    return Err(fail(
                        map,
                        format!(
                            "{} = \"{by}\"; allowed: a number that is not 0, or the name of one asked for",
                            at("divide_by")
                        ),
                        "divide_by = \"{pole_pairs}\" divides by what the user gives",
                    ));
                }
            },
        };
        if scale == 0.0 {
            return Err(fail(
                map,
                format!("{} = 0; allowed: any other finite number", at("scale")),
                "remove the column instead",
            ));
        }
        let rising = self.table.windows(2).all(|w| w[1][0] > w[0][0]);
        if self.table.len() == 1 || !rising || self.table.iter().flatten().any(|v| !v.is_finite()) {
            return Err(fail(
                map,
                format!("{} needs at least two pairs of finite numbers, first numbers rising", at("table")),
                "table = [[1100, -40.0], [1500, 0.0], [1900, 50.0]]",
            ));
        }
        let sign_of = match (self.sign_of, self.sign_zero) {
            (Some(source), zero) => Some((given.fill(map, &source)?, finite("sign_zero", zero, 0.0)?)),
            (None, None) => None,
            (None, Some(_)) => {
                return Err(fail(
                    map,
                    format!("{} is missing", at("sign_of")),
                    "sign_zero belongs to sign_of",
                ));
            }
        };
        Ok(Mapped {
            source: given.fill(map, &self.source)?,
            unit: *unit,
            optional: self.optional,
            sign,
            scale,
            offset: finite("offset", self.offset, 0.0)?,
            table: self.table,
            sign_of,
            name,
        })
    }
}
