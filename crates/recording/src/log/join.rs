//! From a log of messages to a recording: one clock, one grid of rows.
//!
//! The rows are the instants of one topic's messages, as a logger with that rate would have written them: a command
//! stands from its message until the next, a measured value stands in the first row after its message and nowhere
//! else, so that no sample is made up and none counts twice.

use std::collections::BTreeMap;

use super::{Log, Topic, same_source, steps};
use crate::assemble::{Assembler, CLOCK, Cell};
use crate::columns::nearest;
use crate::error::{Place, Problem};
use crate::map::{ColumnMap, Time};
use crate::recording::Recording;

/// A source column of the map within the log.
struct Taken<'l> {
    source: String,
    topic: usize,
    stamps_s: &'l [f64],
    values: &'l [f64],
    held: bool,
    /// Next message to look at.
    next: usize,
    now: f64,
}

impl Taken<'_> {
    /// The value in the row at this instant.
    fn at(&mut self, time_s: f64) -> f64 {
        if !self.held {
            self.now = f64::NAN;
        }
        while self.stamps_s.get(self.next).is_some_and(|stamp| *stamp <= time_s) {
            let value = self.values[self.next];
            if value.is_finite() {
                self.now = value;
            }
            self.next += 1;
        }
        self.now
    }
}

/// A recording of what the map names.
pub(crate) fn recording(name: &str, log: &Log, map: &ColumnMap) -> Result<Recording, Problem> {
    let Time::Clock { rows_of } = &map.time else {
        return Err(Problem::ClockWanted { map: map.name.clone(), format: log.format });
    };
    let found = find(log, map)?;
    let stretch = longest(log, &found);
    let mut taken: Vec<Taken> = found
        .iter()
        .map(|(source, (topic, field))| {
            let of = &log.topics[*topic];
            let range = of.stretch(stretch);
            Taken {
                source: source.clone(),
                topic: *topic,
                stamps_s: &of.stamps_s[range.clone()],
                values: &of.fields[*field].values[range],
                held: held(map, source),
                next: 0,
                now: f64::NAN,
            }
        })
        .collect();
    let grid = grid(log, &taken, rows_of.as_deref(), map)?;
    let stamps_s = &log.topics[grid].stamps_s[log.topics[grid].stretch(stretch)];
    let header = std::iter::once(CLOCK.to_string()).chain(taken.iter().map(|t| t.source.clone())).collect();
    let mut rows = Assembler::new(name, header, Some(map))?;
    let mut row = Vec::with_capacity(taken.len());
    for (k, time_s) in stamps_s.iter().enumerate() {
        row.clear();
        row.extend(taken.iter_mut().map(|one| one.at(*time_s)));
        rows.push(Place::Message(k as u64 + 1), |i| match i.checked_sub(1).map(|i| row[i]) {
            None => Cell::Number(*time_s),
            Some(value) if value.is_nan() => Cell::Empty,
            Some(value) => Cell::Number(value),
        })?;
    }
    let mut losses = log.losses.clone();
    losses.extend(other_stretches(log, grid, stretch));
    let mut recording = rows.finish(losses)?;
    recording.unused = unused(log, &taken);
    let mut notes = log.notes.clone();
    notes.push(words(log, &taken, grid, stretch));
    notes.extend(silences(log, &taken, grid, stretch));
    notes.append(&mut recording.notes);
    recording.notes = notes;
    Ok(recording)
}

/// A command stands until the next one; so does what tells the sign of another column.
fn held(map: &ColumnMap, source: &str) -> bool {
    map.columns.iter().any(|column| {
        let sign = column.sign_of.as_ref().is_some_and(|(sign, _)| sign == source);
        sign || column.source == source && column.name.contains("_cmd")
    })
}

type Found = BTreeMap<String, (usize, usize)>;

/// Where the map's sources are.
fn find(log: &Log, map: &ColumnMap) -> Result<Found, Problem> {
    let mut found = Found::new();
    for (source, optional) in map.sources() {
        let place = log.topics.iter().enumerate().find_map(|(t, topic)| {
            let field = topic.fields.iter().position(|f| same_source(&topic.source(f), source));
            field.filter(|_| !topic.stamps_s.is_empty()).map(|f| (t, f))
        });
        match place {
            Some(place) => {
                found.insert(source.to_string(), place);
            }
            None if optional => {}
            None => return Err(missing(log, map, source)),
        }
    }
    Ok(found)
}

fn missing(log: &Log, map: &ColumnMap, wanted: &str) -> Problem {
    let all: Vec<String> = log.topics.iter().flat_map(|t| t.fields.iter().map(|f| t.source(f))).collect();
    let topic = wanted.split(['.', '[']).next().unwrap_or(wanted);
    let mut near: Vec<&str> = all.iter().map(String::as_str).filter(|name| name.starts_with(topic)).collect();
    if near.is_empty() {
        near = log.topics.iter().map(|t| t.name.as_str()).collect();
    }
    let more = if near.len() > 30 { ", …" } else { "" };
    near.truncate(30);
    let hint = match nearest(wanted, all.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? `kort columns LOG` lists what is in the log"),
        None => "`kort columns LOG` lists what is in the log and which map fits".into(),
    };
    Problem::MappedColumnMissing {
        map: map.name.clone(),
        column: wanted.into(),
        found: format!("{}{more}", near.join(", ")),
        hint,
    }
}

/// The stretch between resets of the clock with the most messages.
fn longest(log: &Log, found: &Found) -> usize {
    let count = |stretch: usize| -> usize {
        found.values().map(|(topic, _)| log.topics[*topic].stretch(stretch).len()).sum()
    };
    (0..=log.resets).max_by_key(|stretch| (count(*stretch), log.resets - stretch)).unwrap_or(0)
}

/// The topic whose messages are the rows.
fn grid(log: &Log, taken: &[Taken], wanted: Option<&str>, map: &ColumnMap) -> Result<usize, Problem> {
    if let Some(wanted) = wanted {
        let bare = |name: &str| name.strip_suffix("[0]").unwrap_or(name).to_string();
        let place = log.topics.iter().position(|t| bare(&t.name) == bare(wanted) && !t.stamps_s.is_empty());
        return place.ok_or_else(|| missing(log, map, wanted));
    }
    let densest = taken.iter().max_by_key(|one| one.stamps_s.len()).map(|one| one.topic);
    densest.ok_or(Problem::TooFewRows { found: 0 })
}

fn other_stretches(log: &Log, grid: usize, stretch: usize) -> Option<String> {
    let topic = &log.topics[grid];
    let range = topic.stretch(stretch);
    let (from, to) = (topic.stamps_s.get(range.start)?, topic.stamps_s.get(range.end.checked_sub(1)?)?);
    (log.resets > 0).then(|| {
        format!(
            "the clock begins anew {} time(s); the longest stretch, {from} to {to} s, is read, and {} messages of `{}` outside it are left out",
            log.resets,
            topic.stamps_s.len() - range.len(),
            topic.name
        )
    })
}

/// Topics that are in the log and not in the map.
fn unused(log: &Log, taken: &[Taken]) -> Vec<String> {
    let used = |place: usize| taken.iter().any(|one| one.topic == place);
    let left = log.topics.iter().enumerate().filter(|(place, t)| !used(*place) && !t.stamps_s.is_empty());
    let mut names: Vec<String> = left.map(|(_, topic)| topic.name.clone()).collect();
    if names.len() > 40 {
        let more = names.len() - 40;
        names.truncate(40);
        names.push(format!("and {more} more"));
    }
    names
}

fn rate(topic: &Topic, stretch: usize) -> String {
    let (step_s, _) = steps(&topic.stamps_s[topic.stretch(stretch)]);
    if step_s > 0.0 {
        format!("`{}` ({:.1} Hz)", topic.name, 1.0 / step_s)
    } else {
        format!("`{}`", topic.name)
    }
}

/// Topics in use beside the one whose messages are the rows.
fn beside(taken: &[Taken], grid: usize) -> Vec<usize> {
    let mut topics: Vec<usize> = taken.iter().map(|one| one.topic).filter(|topic| *topic != grid).collect();
    topics.sort_unstable();
    topics.dedup();
    topics
}

/// How several rates became one.
fn words(log: &Log, taken: &[Taken], grid: usize, stretch: usize) -> String {
    let others = beside(taken, grid);
    let mut text = format!(
        "{}, stamps are {}; the rows are the messages of {}",
        log.format,
        log.clock,
        rate(&log.topics[grid], stretch)
    );
    if !others.is_empty() {
        let names: Vec<String> = others.into_iter().map(|topic| rate(&log.topics[topic], stretch)).collect();
        text += &format!(
            ", beside them {}: a command stands until its next message, a measured value in the first row after its own",
            names.join(", ")
        );
    }
    text
}

/// Gaps in the topics beside the one that makes the rows, whose gaps are those of the recording.
fn silences(log: &Log, taken: &[Taken], grid: usize, stretch: usize) -> Vec<String> {
    let line = |place: usize| {
        let topic = &log.topics[place];
        let (_, gaps) = steps(&topic.stamps_s[topic.stretch(stretch)]);
        let longest = gaps.iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
        let (name, count) = (&topic.name, gaps.len());
        Some(format!("{count} gap(s) in `{name}`, the longest from {} to {} s", longest.0, longest.1))
    };
    beside(taken, grid).into_iter().filter_map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Gather;
    use super::*;

    const MAP: &str = "[time]\nclock = \"log\"\n\
        [columns.duty_cmd]\nsource = \"out.control[0]\"\nunit = \"1\"\n\
        [columns.shaft_speed_rad_s]\nsource = \"esc.rpm\"\nunit = \"rpm\"\n\
        [columns.temperature_c]\nsource = \"esc.temp\"\nunit = \"C\"\noptional = true\n";

    /// Commands at 100 Hz, speed at 25 Hz; the clock begins anew after `first` s.
    fn log(first: f64) -> (ColumnMap, Log) {
        let map = ColumnMap::from_toml("m", MAP).unwrap();
        let sources: Vec<String> = map.sources().map(|(s, _)| s.to_string()).collect();
        let mut gather = Gather::new("test", "seconds", Some(&sources));
        let (out, esc) = (gather.topic("out"), gather.topic("esc[0]"));
        let (control, rpm) = (gather.field(out, "control[0]", None), gather.field(esc, "rpm", None));
        for k in 0..1000 {
            let time_s = f64::from(k) * 0.01;
            let stamp_s = 5.0 + if time_s < first { time_s } else { time_s - first - 4.0 };
            gather.message(out, stamp_s);
            gather.set(out, control, f64::from(k / 100) * 0.1);
            if k % 4 == 0 {
                gather.message(esc, stamp_s + 0.003);
                gather.set(esc, rpm, f64::from(k));
            }
        }
        (map, gather.finish())
    }

    #[test]
    fn several_rates_become_one_grid_without_made_up_samples() {
        let (map, log) = log(100.0);
        let r = recording("r", &log, &map).unwrap();
        assert_eq!(r.rows(), 1000);
        let speed = r.column("shaft_speed_rad_s").unwrap();
        assert_eq!(speed.iter().filter(|v| !v.is_nan()).count(), 250);
        assert!(speed[0].is_nan() && speed[2].is_nan());
        assert!((speed[5] - 4.0 * std::f64::consts::TAU / 60.0).abs() < 1e-9, "first row after its message");
        assert!(r.column("duty_cmd").unwrap().iter().all(|v| !v.is_nan()));
        assert!(r.column("temperature_c").is_none(), "optional, and not in this log");
        assert!(r.notes.iter().any(|n| n.contains("`out` (100.0 Hz)") && n.contains("`esc[0]` (25.0 Hz)")));
        assert!(r.losses.is_empty());
    }

    #[test]
    fn the_rows_may_be_those_of_another_message() {
        let (mut map, log) = log(100.0);
        map.time = Time::Clock { rows_of: Some("esc".into()) };
        let r = recording("r", &log, &map).unwrap();
        assert_eq!(r.rows(), 250);
        assert!(r.column("shaft_speed_rad_s").unwrap().iter().all(|v| !v.is_nan()));
        assert!((r.column("duty_cmd").unwrap()[30] - 0.1).abs() < 1e-12, "the command that stands then");
    }

    #[test]
    fn of_a_clock_that_begins_anew_the_longest_stretch_is_read_and_the_rest_is_said() {
        let (map, log) = log(3.0);
        let r = recording("r", &log, &map).unwrap();
        assert_eq!(r.rows(), 700);
        assert_eq!(r.losses.len(), 1);
        assert!(r.losses[0].contains("300 messages"), "{}", r.losses[0]);
    }

    #[test]
    fn what_the_log_lacks_is_named_with_what_comes_near() {
        let (_, log) = log(100.0);
        let map = ColumnMap::from_toml("m", &MAP.replace("esc.rpm", "esc.rmp")).unwrap();
        match recording("r", &log, &map).unwrap_err() {
            Problem::MappedColumnMissing { column, found, hint, .. } => {
                assert_eq!(column, "esc.rmp");
                assert!(found.contains("esc[0].rpm") && hint.contains("esc[0].rpm"), "{found} {hint}");
            }
            other => panic!("{other}"),
        }
    }
}
