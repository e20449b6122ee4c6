//! Column maps: how a foreign log's columns become ours. A column whose unit is not given is
//! refused, never guessed.

mod ask;
mod column;
mod read;
mod shipped;
mod time;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use crate::columns::nearest;
use crate::dates::Order;
use crate::units::{self, Unit};

use ask::Asked;

/// A column map, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnMap {
    /// Its name, for messages.
    pub name: String,
    /// Where the log comes from and what its columns mean.
    pub description: String,
    /// What parts the cells of a CSV file, where the map says it: else a comma, or what the file says itself.
    pub delimiter: Option<u8>,
    /// Its numbers have a decimal comma.
    pub decimal_comma: bool,
    /// Names of a table's header that no row has a cell for.
    pub without_cells: Vec<String>,
    /// Where the instants come from.
    pub time: Time,
    /// What the user said of the log: names and values.
    pub given: Vec<(String, String)>,
    /// Which of them are nothing but the map's own examples, and what they mean: the user must say them.
    pub examples: Vec<(String, String)>,
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
        /// The column with the time of day, where the dates have none.
        time_of_day: Option<String>,
        /// What they are.
        stamps: Stamps,
        /// Rows whose stamp does not come after the one before are skipped, and counted as lost.
        drop_stale: bool,
    },
    /// The log's own stamps, each message's: a log of messages, not a table.
    Clock {
        /// The topic whose messages are the rows; `None`: of those taken over the one with the most messages.
        rows_of: Option<String>,
    },
    /// No stamps: each row is one settled point of a table, held this long.
    Settled {
        /// Time a point is held, s.
        settle_s: f64,
    },
}

/// What the stamps of a table are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stamps {
    /// Numbers.
    Numbers {
        /// Factor to seconds.
        to_s: f64,
    },
    /// Dates with their time of day, counted from the first.
    Dates {
        /// What a date begins with, if the map says it; else the column must tell.
        order: Option<Order>,
    },
    /// Times of day without a date, counted from the first.
    OfDay,
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
    /// The log may lack it.
    pub optional: bool,
    /// 1 or -1.
    pub sign: f64,
    /// Factor on the source, before the offset.
    pub scale: f64,
    /// Added after the factor.
    pub offset: f64,
    /// Straight-line table applied to the source first, held at its ends; empty for none.
    pub table: Vec<[f64; 2]>,
    /// The source's number that stands for no value, as a pulse of 0 us.
    pub none: Option<f64>,
    /// What the column is where the source holds no value, SI; else it is not sampled then.
    pub no_value: Option<f64>,
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

/// All that is wrong with a column map, at least one.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct MapErrors(pub Vec<MapError>);

impl From<MapError> for MapErrors {
    fn from(error: MapError) -> Self {
        MapErrors(vec![error])
    }
}

/// Name of a map, and what stands behind its colon.
fn parted(wanted: &str) -> (&str, Option<&str>) {
    match wanted.rsplit_once(':') {
        Some((name, run)) if !Path::new(wanted).exists() && !name.is_empty() => (name, Some(run)),
        _ => (wanted, None),
    }
}

/// The file of a map by path or name, if there is one.
fn file_of(name: &str) -> Option<PathBuf> {
    let is_path = name.ends_with(".toml") || name.contains(['/', '\\']);
    let path = if is_path { name.into() } else { Path::new("config/columns").join(format!("{name}.toml")) };
    path.is_file().then_some(path)
}

impl ColumnMap {
    /// Finds a map: a path to a TOML file, or the name of one in `config/columns/` or of a shipped
    /// one. `NAME:VALUE` takes the run `VALUE` of a file that holds several; `NAME:KEY=VALUE,KEY=VALUE` says what
    /// the map asks for.
    ///
    /// # Errors
    /// No such map (naming the shipped ones), or all that is wrong with it.
    pub fn find(wanted: &str) -> Result<Self, MapErrors> {
        let (name, run) = parted(wanted);
        let asked = Asked::parse(run.unwrap_or(""));
        let mut map = Self::load(name, &asked)?;
        if let Some(value) = asked.run() {
            match &mut map.select {
                Some(select) => select.value = value.into(),
                None => {
                    return Err(fail(
                        name,
                        format!("`:{value}` asks for one run of several, but the map has no [select]"),
                        "leave out the colon and what follows",
                    )
                    .into());
                }
            }
        }
        Ok(map)
    }

    /// The file that [`ColumnMap::find`] reads; none of a map that is built in, or not there.
    pub fn file(wanted: &str) -> Option<PathBuf> {
        file_of(parted(wanted).0)
    }

    fn load(name: &str, asked: &Asked) -> Result<Self, MapErrors> {
        if let Some(path) = file_of(name) {
            let text = std::fs::read_to_string(path)
                .map_err(|e| fail(name, format!("cannot be read: {e}"), "check the path"))?;
            return read::map(name, &text, Some(asked));
        }
        if let Some((_, text)) = shipped::ALL.iter().find(|(n, _)| *n == name) {
            return read::map(name, text, Some(asked));
        }
        let names: Vec<&str> = Self::shipped().collect();
        let hint = match nearest(name, names.iter().copied()) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "give a shipped map's name or the path of a TOML file".into(),
        };
        Err(fail(name, format!("there is no such map; shipped maps: {}", names.join(", ")), &hint).into())
    }

    /// A shipped map with its own examples in the place of what it asks for.
    pub(crate) fn example(name: &str) -> Option<Self> {
        let (_, text) = shipped::ALL.iter().find(|(n, _)| *n == name)?;
        Self::from_toml(name, text).ok()
    }

    /// A shipped map with another value in the place of one that it asks for: each that makes one of its sources one of these,
    /// which its own example does not name.
    pub(crate) fn answered<'s>(name: &str, sources: impl Iterator<Item = &'s str> + Clone) -> Vec<Self> {
        let Some((_, text)) = shipped::ALL.iter().find(|(n, _)| *n == name) else { return Vec::new() };
        let Some(read::Asks { given, sources: templates }) = read::asks(name, text) else {
            return Vec::new();
        };
        let mut maps: Vec<Self> = Vec::new();
        for (key, usual) in &given {
            let filled = |skip: &str, text: &str| {
                let others = given.iter().filter(|(other, _)| other != skip);
                others.fold(text.to_owned(), |text, (other, value)| {
                    text.replace(&format!("{{{other}}}"), value)
                })
            };
            let values = templates.iter().map(|template| filled(key, template)).flat_map(|template| {
                let around = template.split_once(&format!("{{{key}}}"));
                let around = around.map(|(before, behind)| (before.to_owned(), behind.to_owned()));
                sources.clone().filter_map(move |source| {
                    let (before, behind) = around.as_ref()?;
                    Some(source.strip_prefix(before.as_str())?.strip_suffix(behind.as_str())?.to_owned())
                })
            });
            let whole =
                |value: &String| !value.is_empty() && !value.contains(['.', '[', ']', '{', '}', ',', '=']);
            let values: BTreeSet<String> = values.filter(|value| value != usual && whole(value)).collect();
            maps.extend(values.iter().filter_map(|value| {
                let said = given
                    .iter()
                    .map(|(other, usual)| format!("{other}={}", if other == key { value } else { usual }));
                read::map(name, text, Some(&Asked::parse(&said.collect::<Vec<_>>().join(",")))).ok()
            }));
        }
        maps
    }

    /// A shipped map of a CAN bus for this node: the identifiers that it asks for are its example's, of that node. `None`
    /// for a map of no bus, and where there is no such node.
    pub(crate) fn of_node(name: &str, node: i32) -> Option<Self> {
        let (_, text) = shipped::ALL.iter().find(|(n, _)| *n == name)?;
        let sources = || text.lines().filter(|line| line.starts_with("source = \"0x"));
        sources().next()?;
        let mut given = Vec::new();
        for (key, value) in Self::from_toml(name, text).ok()?.given {
            if !sources().any(|line| line.contains(&format!("{{{key}}}"))) {
                given.push(format!("{key}={value}"));
                continue;
            }
            // Three digits are CANopen's: four bits of function, and nodes 1 to 127. Two are a number by themselves.
            let (digits, nodes) = (value.len(), if value.len() == 3 { 1..=0x7F } else { 0..=0xFF });
            let id = i32::from_str_radix(&value, 16).ok().filter(|_| nodes.contains(&node))?;
            given.push(format!("{key}={:0digits$X}", id & !nodes.end() | node));
        }
        read::map(name, text, Some(&Asked::parse(&given.join(",")))).ok()
    }

    /// How it is called for behind `--columns`, with all that it asks for.
    pub(crate) fn call(&self) -> String {
        let given: Vec<String> = self.given.iter().map(|(key, value)| format!("{key}={value}")).collect();
        if given.is_empty() { self.name.clone() } else { format!("{}:{}", self.name, given.join(",")) }
    }

    /// Source columns, and whether a log may lack them.
    pub(crate) fn sources(&self) -> impl Iterator<Item = (&str, bool)> {
        self.columns.iter().flat_map(|column| {
            let sign = column.sign_of.as_ref().map(|(sign, _)| sign.as_str());
            std::iter::once(column.source.as_str()).chain(sign).map(|source| (source, column.optional))
        })
    }

    /// Source columns that a table must have.
    pub(crate) fn wanted(&self) -> Vec<&str> {
        let time = match &self.time {
            Time::Column { source, time_of_day, .. } => vec![Some(source.as_str()), time_of_day.as_deref()],
            Time::Clock { .. } | Time::Settled { .. } => Vec::new(),
        };
        let time = time.into_iter().flatten();
        let columns = self.sources().filter(|(_, optional)| !optional).map(|(source, _)| source);
        time.chain(columns).collect()
    }

    /// Source columns that are taken as they stand, stamps too, with the unit that they are read in.
    pub(crate) fn units_as_they_stand(&self) -> impl Iterator<Item = (&str, &Unit)> {
        let time = match &self.time {
            Time::Column { source, stamps: Stamps::Numbers { to_s }, .. } => units::UNITS
                .iter()
                .find(|u| u.si == "s" && u.factor == *to_s)
                .map(|unit| (source.as_str(), unit)),
            Time::Column { .. } | Time::Clock { .. } | Time::Settled { .. } => None,
        };
        let plain = |c: &&Mapped| c.scale == 1.0 && c.offset == 0.0 && c.table.is_empty();
        time.into_iter().chain(self.columns.iter().filter(plain).map(|c| (c.source.as_str(), &c.unit)))
    }

    /// Names of the shipped maps.
    pub fn shipped() -> impl Iterator<Item = &'static str> {
        shipped::ALL.iter().map(|(name, _)| *name)
    }

    /// Reads a map; where it asks for something, its own example or default stands.
    ///
    /// # Errors
    /// All that is wrong with it; each names the field, the value found and what is allowed.
    pub fn from_toml(name: &str, text: &str) -> Result<Self, MapErrors> {
        read::map(name, text, None)
    }
}

fn fail(map: &str, message: impl Into<String>, hint: &str) -> MapError {
    MapError { map: map.into(), message: message.into(), hint: hint.into() }
}

#[cfg(test)]
mod tests;
