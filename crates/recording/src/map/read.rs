//! A column map's text: its keys, and what each may be. All that is wrong with it is said at once.

use std::collections::BTreeMap;

use kort_complaints::text_as_far_as_it_goes;
use serde::Deserialize;

use super::ask::{Ask, Asked, Given};
use super::column::RawColumn;
use super::time::RawTime;
use super::{ColumnMap, MapError, MapErrors, Select, fail};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    #[serde(default)]
    description: String,
    delimiter: Option<String>,
    decimal: Option<String>,
    #[serde(default)]
    ask: BTreeMap<String, Ask>,
    #[serde(default)]
    without_cells: Vec<String>,
    time: RawTime,
    select: Option<Select>,
    columns: BTreeMap<String, RawColumn>,
    #[serde(default)]
    ignored: Vec<String>,
}

/// What is wrong with a map, as it is found.
pub(super) struct Wrong(Vec<MapError>);

impl Wrong {
    pub fn say(&mut self, error: MapError) {
        self.0.push(error);
    }

    /// What was read, or nothing, with what is wrong kept.
    pub fn take<T>(&mut self, read: Result<T, MapError>) -> Option<T> {
        read.map_err(|error| self.say(error)).ok()
    }
}

/// Reads a map, with what the user said where it is to be used.
pub(super) fn map(name: &str, text: &str, asked: Option<&Asked>) -> Result<ColumnMap, MapErrors> {
    let mut read = text_as_far_as_it_goes::<RawMap>(text);
    let raw = read.value.take();
    let mut wrong = Wrong(Vec::new());
    let map = raw.and_then(|raw| raw.check(name, asked, &mut wrong));
    // What may be due to a key that could not be read is told once it can.
    let mut values = wrong.0;
    values.retain(|error| read.in_file(&error.message).is_some());
    let keys = "docs/recordings.md lists the keys of a column map";
    let said = read.said.iter().map(|words| fail(name, words.clone(), keys));
    let wrong: Vec<MapError> = said.chain(values).collect();
    map.filter(|_| wrong.is_empty()).ok_or(MapErrors(wrong))
}

impl RawMap {
    fn check(self, name: &str, asked: Option<&Asked>, wrong: &mut Wrong) -> Option<ColumnMap> {
        let delimiter = wrong.take(delimiter(name, self.delimiter.as_deref()));
        let decimal_comma = wrong.take(decimal_comma(name, self.decimal.as_deref()));
        let given = Given::new(name, &self.ask, asked, wrong);
        let time = self.time.check(name, &given, wrong);
        if self.columns.is_empty() {
            // Begins as a value's place does: of a map without the table it is told that it is missing.
            wrong.say(fail(
                name,
                "`columns` is empty",
                "name at least one of our columns, for example [columns.thrust_n]",
            ));
        }
        // What stands in a source is confirmed by the log that has it.
        let in_a_source = |key: &str| {
            let inside = [format!("{{{key}}}"), format!("{{{key}+")];
            self.columns.values().any(|column| inside.iter().any(|inside| column.source.contains(inside)))
        };
        let mut examples = given.examples(&self.ask);
        examples.retain(|(key, _)| !in_a_source(key));
        // Each is looked at, also behind one that is wrong.
        let columns: Vec<_> = self
            .columns
            .into_iter()
            .filter_map(|(target, column)| column.check(name, target, &given, wrong))
            .collect();
        Some(ColumnMap {
            name: name.into(),
            description: self.description,
            delimiter: delimiter?,
            decimal_comma: decimal_comma?,
            without_cells: self.without_cells,
            time: time?,
            examples,
            given: given.into_pairs(),
            select: self.select,
            columns,
            ignored: self.ignored,
        })
    }
}

/// A map before it is filled in.
pub(super) struct Asks {
    /// What it asks for, with a value of each.
    pub given: Vec<(String, String)>,
    /// Its sources as they stand in the file.
    pub sources: Vec<String>,
}

/// What a map asks for; of a shipped one, whose asking is sound.
pub(super) fn asks(name: &str, text: &str) -> Option<Asks> {
    let raw: RawMap = toml::from_str(text).ok()?;
    let given = Given::new(name, &raw.ask, None, &mut Wrong(Vec::new()));
    let followed = |source: String| {
        given.following().fold(source, |source, (key, other)| {
            source.replace(&format!("{{{key}}}"), &format!("{{{other}}}"))
        })
    };
    let sources = raw.columns.into_values().map(|column| followed(column.source)).collect();
    Some(Asks { sources, given: given.into_pairs() })
}

fn delimiter(map: &str, wanted: Option<&str>) -> Result<Option<u8>, MapError> {
    match wanted {
        None => Ok(None),
        Some(",") => Ok(Some(b',')),
        Some(";") => Ok(Some(b';')),
        Some("\t") => Ok(Some(b'\t')),
        Some(other) => Err(fail(
            map,
            format!("`delimiter` = {other:?} is outside what is allowed: \",\", \";\", \"\\t\""),
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
            format!("`decimal` = {other:?} is outside what is allowed: \".\", \",\""),
            "the decimal mark of the numbers in the CSV file",
        )),
    }
}
