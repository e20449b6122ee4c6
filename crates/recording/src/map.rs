//! Column maps: how a foreign log's columns become ours. A column whose unit is not given is
//! refused, never guessed.

mod shipped;

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use thiserror::Error;

use crate::columns::{self, nearest};
use crate::units::{self, Unit};

/// A column map, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnMap {
    /// Its name, for messages.
    pub name: String,
    /// Where the log comes from and what its columns mean.
    pub description: String,
    /// Where the instants come from.
    pub time: Time,
    /// Only rows with this value, if the file holds several runs.
    pub select: Option<Select>,
    /// Our columns.
    pub columns: Vec<Mapped>,
    /// Source columns left out on purpose.
    pub ignored: Vec<String>,
}

/// Where the instants come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Time {
    /// A column of stamps.
    Column {
        /// Source column.
        source: String,
        /// Factor to seconds.
        to_s: f64,
        /// Rows whose stamp does not come after the one before are skipped, and counted as lost.
        drop_stale: bool,
    },
    /// No stamps: each row is one settled point of a table, held this long.
    Settled {
        /// Time a point is held, s.
        settle_s: f64,
    },
}

/// Rows of one run among several in a file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Select {
    /// Source column that tells the runs apart.
    pub source: String,
    /// Its value for the wanted run.
    pub value: String,
}

/// One of our columns and how it is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// Our name, unit last.
    pub name: String,
    /// Source column.
    pub source: String,
    /// Unit of `sign * (scale * source + offset)`.
    pub unit: Unit,
    /// 1 or -1.
    pub sign: f64,
    /// Factor on the source, before the offset.
    pub scale: f64,
    /// Added after the factor.
    pub offset: f64,
    /// Straight-line table applied to the source first, held at its ends; empty for none.
    pub table: Vec<[f64; 2]>,
    /// Source column and the value at which the sign turns, for a sensor that shows no sign.
    pub sign_of: Option<(String, f64)>,
}

impl Mapped {
    /// Our value, SI, from the source's.
    pub fn apply(&self, source: f64) -> f64 {
        let x = if self.table.is_empty() { source } else { interpolate(&self.table, source) };
        self.unit.factor * (self.sign * (self.scale * x + self.offset)) + self.unit.offset
    }
}

fn interpolate(table: &[[f64; 2]], x: f64) -> f64 {
    let at = table.partition_point(|p| p[0] <= x);
    match (at.checked_sub(1).map(|i| table[i]), table.get(at)) {
        (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]),
        (Some(end), None) => end[1],
        (None, Some(end)) => end[1],
        (None, None) => x,
    }
}

/// Why a column map cannot be used.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("column map {map}: {message}\nhint: {hint}")]
pub struct MapError {
    /// The map's name or path.
    pub map: String,
    /// Field, value found, what is allowed.
    pub message: String,
    /// What to do.
    pub hint: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    #[serde(default)]
    description: String,
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
    stale_rows: Option<String>,
    settle_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawColumn {
    source: String,
    unit: Option<String>,
    sign: Option<f64>,
    scale: Option<f64>,
    offset: Option<f64>,
    #[serde(default)]
    table: Vec<[f64; 2]>,
    sign_of: Option<String>,
    sign_zero: Option<f64>,
}

impl ColumnMap {
    /// Finds a map: a path to a TOML file, or the name of one in `config/columns/` or of a shipped
    /// one. `NAME:VALUE` takes the run `VALUE` of a file that holds several.
    ///
    /// # Errors
    /// No such map (naming the shipped ones), or a map with an error in it.
    pub fn find(wanted: &str) -> Result<Self, MapError> {
        let whole = Path::new(wanted);
        let (name, run) = match wanted.rsplit_once(':') {
            Some((name, run)) if !whole.exists() && !name.is_empty() => (name, Some(run)),
            _ => (wanted, None),
        };
        let mut map = Self::load(name)?;
        if let Some(run) = run {
            match &mut map.select {
                Some(select) => select.value = run.into(),
                None => {
                    return Err(fail(
                        name,
                        format!("`:{run}` asks for one run of several, but the map has no [select]"),
                        "leave out the colon and what follows",
                    ));
                }
            }
        }
        Ok(map)
    }

    fn load(name: &str) -> Result<Self, MapError> {
        let in_config = Path::new("config/columns").join(format!("{name}.toml"));
        let is_path = name.ends_with(".toml") || name.contains(['/', '\\']);
        let path = if is_path { Path::new(name) } else { in_config.as_path() };
        if path.is_file() {
            let text = std::fs::read_to_string(path)
                .map_err(|e| fail(name, format!("cannot be read: {e}"), "check the path"))?;
            return Self::from_toml(name, &text);
        }
        if let Some((_, text)) = shipped::ALL.iter().find(|(n, _)| *n == name) {
            return Self::from_toml(name, text);
        }
        let names: Vec<&str> = Self::shipped().collect();
        let hint = match nearest(name, names.iter().copied()) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "give a shipped map's name or the path of a TOML file".into(),
        };
        Err(fail(name, format!("there is no such map; shipped maps: {}", names.join(", ")), &hint))
    }

    /// Names of the shipped maps.
    pub fn shipped() -> impl Iterator<Item = &'static str> {
        shipped::ALL.iter().map(|(name, _)| *name)
    }

    /// Reads a map.
    ///
    /// # Errors
    /// [`MapError`] names the field, the value found and what is allowed.
    pub fn from_toml(name: &str, text: &str) -> Result<Self, MapError> {
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
        let columns = raw
            .columns
            .into_iter()
            .map(|(target, column)| column.check(name, target))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            name: name.into(),
            description: raw.description,
            time: raw.time.check(name)?,
            select: raw.select,
            columns,
            ignored: raw.ignored,
        })
    }
}

fn fail(map: &str, message: impl Into<String>, hint: &str) -> MapError {
    MapError { map: map.into(), message: message.into(), hint: hint.into() }
}

impl RawTime {
    fn check(self, map: &str) -> Result<Time, MapError> {
        match (self.source, self.settle_s) {
            (Some(source), None) => {
                let symbol = self.unit.ok_or_else(|| {
                    fail(
                        map,
                        "time.unit is missing",
                        "write unit = \"s\", \"ms\", \"us\" or \"ns\"; it is never guessed",
                    )
                })?;
                let unit = units::find(&symbol).filter(|u| u.si == "s").ok_or_else(|| {
                    fail(
                        map,
                        format!(
                            "time.unit = \"{symbol}\" is no unit of time; allowed: {}",
                            units::siblings("s")
                        ),
                        "write the unit of the stamps",
                    )
                })?;
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
                Ok(Time::Column { source, to_s: unit.factor, drop_stale })
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
    fn check(self, map: &str, name: String) -> Result<Mapped, MapError> {
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
            (Some(source), zero) => Some((source, finite("sign_zero", zero, 0.0)?)),
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
            source: self.source,
            unit: *unit,
            sign,
            scale,
            offset: finite("offset", self.offset, 0.0)?,
            table: self.table,
            sign_of,
            name,
        })
    }
}

#[cfg(test)]
mod tests;
