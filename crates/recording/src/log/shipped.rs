//! Which of the shipped column maps bring a log in.

use std::collections::BTreeSet;

use super::names::words;
use super::rules::{ASKED, COMMANDS, DRIVE};
use super::survey::{Incomplete, Lack, Still};
use super::{Field, Log, Topic, same_source};
use crate::columns::RESPONSES;
use crate::map::{ColumnMap, Time};

/// Those that have all that they must, with what they ask for: first those whose command and response change.
pub(super) fn fitting(log: &Log, table: bool) -> Vec<ColumnMap> {
    let mut maps = complete(log, table);
    maps.sort_by_key(|map| !still(map, log).is_empty());
    maps
}

fn complete(log: &Log, table: bool) -> Vec<ColumnMap> {
    if log.format != "candump" {
        return ColumnMap::shipped().flat_map(|name| suited(name, log, table)).collect();
    }
    let ids = log
        .topics
        .iter()
        .filter_map(|t| i32::from_str_radix(t.name.get(t.name.len().checked_sub(2)?..)?, 16).ok());
    let nodes: BTreeSet<i32> = ids.flat_map(|id| [id, id & 0x7F]).collect();
    let maps = ColumnMap::shipped()
        .flat_map(|name| nodes.iter().filter_map(move |node| ColumnMap::of_node(name, *node)));
    maps.filter(|map| map.sources().all(|(source, _)| on_bus(source, log))).collect()
}

/// Whether frames with this identifier are in the log of a bus, and are long enough for the number.
fn on_bus(source: &str, log: &Log) -> bool {
    let long_enough = || {
        let (id, number) = source.split_once('.')?;
        let (kind, at) = number.strip_suffix(']')?.split_once('[')?;
        let bits: usize = kind.trim_matches(|c: char| !c.is_ascii_digit()).parse().ok()?;
        let last = format!("u8[{}]", at.parse::<usize>().ok()? + bits / 8 - 1);
        let mut frames = log.topics.iter().filter(|topic| topic.name.eq_ignore_ascii_case(id));
        Some(frames.any(|topic| topic.fields.iter().any(|f| f.samples > 0 && f.name == last)))
    };
    long_enough().unwrap_or(false)
}

fn is_in(log: &Log, source: &str) -> bool {
    said(log).any(|(topic, field)| same_source(&topic.source(field), source))
}

/// Whether the map makes of this log a column that a model can be compared with.
pub(super) fn responds(map: &ColumnMap, log: &Log) -> bool {
    let mut columns = map.columns.iter().filter(|column| RESPONSES.contains(&column.name.as_str()));
    columns.any(|column| !column.optional || is_in(log, &column.source))
}

/// What the map takes for a command, or for a response, and never changes in this log, where nothing else of that kind does:
/// another source was meant, or the motor stood.
pub(super) fn still(map: &ColumnMap, log: &Log) -> Vec<Still> {
    let range = |source: &str| {
        said(log).find(|(topic, field)| same_source(&topic.source(field), source)).and_then(|(_, f)| f.range)
    };
    let of_kind = |is: &dyn Fn(&str) -> bool| {
        let columns = map.columns.iter().filter(|column| is(&column.name));
        let ranges: Vec<_> = columns.filter_map(|c| Some((c, range(&c.source)?))).collect();
        let moves = ranges.iter().any(|(_, (low, high))| low < high);
        let all = ranges.into_iter().filter(|_| !moves).map(|(column, (value, _))| Still {
            map: map.call(),
            column: column.name.clone(),
            source: column.source.clone(),
            value,
        });
        all.collect::<Vec<_>>()
    };
    let commands = of_kind(&|name| COMMANDS.iter().any(|(_, command)| *command == name));
    [commands, of_kind(&|name| RESPONSES.contains(&name))].concat()
}

/// A shipped map as its example has it, where that suits the log; else with another value of one that it asks for: another motor,
/// another topic of commands, if its name says that it is one.
fn suited(name: &str, log: &Log, table: bool) -> Vec<ColumnMap> {
    let Some(example) = ColumnMap::example(name) else { return Vec::new() };
    if suits(&example, log, table) {
        return vec![example];
    }
    let sources: Vec<String> = said(log).map(|(topic, field)| topic.source(field)).collect();
    let mut maps = ColumnMap::answered(name, sources.iter().map(String::as_str));
    let says_so = |value: &str| {
        let mut words = words(value).into_iter().peekable();
        words.peek().is_none()
            || words.any(|word| [ASKED, DRIVE].concat().contains(&word.strip_suffix('s').unwrap_or(&word)))
    };
    maps.retain(|map| suits(map, log, table) && map.given.iter().all(|(_, value)| says_so(value)));
    maps
}

/// The shipped maps that make most columns of a log of messages, though none has all that it must.
pub(super) fn in_part(log: &Log) -> Vec<Incomplete> {
    let parts = ColumnMap::shipped().filter_map(ColumnMap::example).filter_map(|map| {
        let clock = matches!(map.time, Time::Clock { .. });
        let (has, lacks): (Vec<_>, Vec<_>) =
            map.columns.iter().partition(|column| is_in(log, &column.source));
        let lacks = lacks.into_iter().filter(|column| !column.optional);
        let lacks = lacks.map(|c| Lack { column: c.name.clone(), source: c.source.clone() }).collect();
        let has: Vec<String> = has.into_iter().map(|column| column.name.clone()).collect();
        (clock && !has.is_empty()).then(|| Incomplete { map: map.call(), has, lacks })
    });
    let mut parts: Vec<Incomplete> = parts.collect();
    let most = parts.iter().map(|part| part.has.len()).max();
    parts.retain(|part| Some(part.has.len()) == most);
    parts
}

/// Fields that something was said in.
fn said(log: &Log) -> impl Iterator<Item = (&Topic, &Field)> {
    let fields = log.topics.iter().flat_map(|topic| topic.fields.iter().map(move |field| (topic, field)));
    fields.filter(|(_, field)| field.samples + field.texts > 0)
}

/// Every source that the map must have is in the log.
fn suits(map: &ColumnMap, log: &Log, table: bool) -> bool {
    let there = |source: &str| is_in(log, source);
    let stamps = match &map.time {
        Time::Clock { .. } => !table,
        // A map that says nothing of a decimal comma reads none.
        Time::Column { source, .. } => table && there(source) && (!log.decimal_comma || map.decimal_comma),
        Time::Settled { .. } => table,
    };
    stamps
        && map.select.as_ref().is_none_or(|select| there(&select.source))
        && map.sources().all(|(source, optional)| optional || there(source))
        && map.sources().any(|(source, _)| there(source))
}
