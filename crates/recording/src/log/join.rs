//! From a log of messages to a recording: one clock, one grid of rows.
//!
//! The rows are the instants of one topic's messages, as a logger with that rate would have written them. A message belongs
//! to the row that it comes nearest to, so that it is at most half a row early or late, and stamps that lie microseconds to
//! this side or that of a row tell nothing. A command stands from there until the next, a measured value stands in that row
//! and nowhere else, so that no sample is made up and none counts twice.

use std::collections::BTreeMap;

use super::nearness::{self, Near};
use super::{Log, said, same_source};
use crate::assemble::{Assembler, CLOCK};
use crate::cell::Cell;
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
    /// The value of the newest message so far, of what stands until the next.
    standing: f64,
    /// Messages so far that are near no row.
    far: u64,
}

impl Taken<'_> {
    /// The value in a row: of the messages that belong to it the one nearest in time, else what stands.
    fn at(&mut self, row: &Near) -> f64 {
        let before = self.until(row.from_s).map_or(self.standing, |(_, value)| value);
        let mut nearest: Option<(f64, f64)> = None;
        let mut newest = before;
        while let Some((stamp_s, value)) = self.next_before(row.to_s) {
            let off_s = (stamp_s - row.at_s).abs();
            if nearest.is_none_or(|(least_s, _)| off_s < least_s) {
                nearest = Some((off_s, value));
            }
            newest = value;
        }
        if self.held {
            self.standing = newest;
        }
        nearest.map_or(if self.held { before } else { f64::NAN }, |(_, value)| value)
    }

    /// Passes over what comes before this instant; the last of it.
    fn until(&mut self, end_s: f64) -> Option<(f64, f64)> {
        let mut last = None;
        while let Some(message) = self.next_before(end_s) {
            self.far += u64::from(!self.held);
            last = Some(message);
        }
        last.filter(|_| self.held)
    }

    /// The next message before this instant that has a value; of a command also one that says that there is none, which ends
    /// what stood before it.
    fn next_before(&mut self, end_s: f64) -> Option<(f64, f64)> {
        while let Some(stamp_s) = self.stamps_s.get(self.next).copied().filter(|stamp_s| *stamp_s < end_s) {
            let value = self.values[self.next];
            self.next += 1;
            if value.is_finite() || self.held && value.is_infinite() {
                return Some((stamp_s, value));
            }
        }
        None
    }
}

/// A recording of what the map names.
pub(crate) fn recording(name: &str, log: &Log, map: &ColumnMap) -> Result<Recording, Problem> {
    let Time::Clock { rows_of } = &map.time else {
        return Err(Problem::ClockWanted { map: map.name.clone(), format: log.format });
    };
    let found = find(log, map)?;
    let stretch = log.longest(found.values().map(|(topic, _)| *topic));
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
                standing: f64::NAN,
                far: 0,
            }
        })
        .collect();
    let grid = grid(log, &taken, rows_of.as_deref(), map)?;
    let stamps_s = &log.topics[grid].stamps_s[log.topics[grid].stretch(stretch)];
    let header = std::iter::once(CLOCK.to_string()).chain(taken.iter().map(|t| t.source.clone())).collect();
    let mut rows = Assembler::new(name, header, Some(map))?;
    let mut row = Vec::with_capacity(taken.len());
    for (k, near) in nearness::of(stamps_s).enumerate() {
        row.clear();
        row.extend(taken.iter_mut().map(|one| one.at(&near)));
        rows.push(Place::Message(k as u64 + 1), |i| match i.checked_sub(1).map(|i| row[i]) {
            None => Cell::Number(near.at_s),
            Some(value) if value.is_nan() => Cell::Empty,
            Some(value) if value.is_infinite() => Cell::Text("NaN"),
            Some(value) => Cell::Number(value),
        })?;
    }
    let mut far = BTreeMap::new();
    for one in &mut taken {
        one.until(f64::INFINITY);
        let most = far.entry(one.topic).or_insert(0);
        *most = one.far.max(*most);
    }
    let mut losses = log.losses.clone();
    losses.extend(said::other_stretches(log, grid, stretch));
    let mut recording = rows.finish(losses)?;
    let used: Vec<usize> = taken.iter().map(|one| one.topic).collect();
    recording.unused = said::unused(log, &used);
    let mut notes = log.notes.clone();
    notes.extend(said::notes(log, &used, grid, stretch));
    notes.extend(said::far(log, &far));
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

/// Whether two sources end in nearly the same name: a topic and a number that they share make them no kin.
fn nearly_spelt(wanted: &str, source: &str) -> bool {
    let name = |source: &str| {
        let last = source.rsplit('.').next().unwrap_or(source);
        last.split('[').next().unwrap_or(last).to_lowercase()
    };
    let (a, b) = (name(wanted), name(source));
    strsim::osa_distance(&a, &b) <= (a.len() / 3).max(1)
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
    let alike = all.iter().map(String::as_str).filter(|source| nearly_spelt(wanted, source));
    // Which place of a list is meant nobody can tell from how it is written.
    let list = |name: &str| name.rsplit_once('[').map(|(list, _)| format!("{list}["));
    let places = all.iter().filter(|source| list(wanted).is_some() && list(source) == list(wanted));
    let places: Vec<&str> = places.map(String::as_str).take(16).collect();
    let hint = match nearest(wanted, alike) {
        Some(_) if !places.is_empty() => {
            format!(
                "say which of {} is meant, behind the colon of --columns or in the map",
                places.join(", ")
            )
        }
        Some(near) => {
            format!("did you mean `{near}`? `kort columns LOG` lists what is in the log and which map fits")
        }
        None => "`kort columns LOG` lists what is in the log and which map fits".into(),
    };
    Problem::MappedColumnMissing {
        map: map.name.clone(),
        column: wanted.into(),
        found: format!("{}{more}", near.join(", ")),
        hint,
    }
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
        assert!(speed[1].is_nan() && speed[3].is_nan());
        assert!(
            (speed[4] - 4.0 * std::f64::consts::TAU / 60.0).abs() < 1e-9,
            "the row nearest to its message"
        );
        assert!(r.column("duty_cmd").unwrap().iter().all(|v| !v.is_nan()));
        assert!(r.column("temperature_c").is_none(), "optional, and not in this log");
        assert!(r.notes.iter().any(|n| n.contains("`out` (100.0 Hz)") && n.contains("`esc[0]` (25.0 Hz)")));
        assert!(r.losses.is_empty());
    }

    /// Commands and speeds at 100 Hz, each a number of its own, the speeds so much later than the commands.
    fn pair(later_s: f64, skipped: std::ops::Range<u32>, rows_of: Option<&str>) -> Recording {
        let mut map = ColumnMap::from_toml("m", MAP).unwrap();
        map.time = Time::Clock { rows_of: rows_of.map(str::to_owned) };
        let sources: Vec<String> = map.sources().map(|(s, _)| s.to_string()).collect();
        let mut gather = Gather::new("test", "seconds", Some(&sources));
        let (out, esc) = (gather.topic("out"), gather.topic("esc[0]"));
        let (control, rpm) = (gather.field(out, "control[0]", None), gather.field(esc, "rpm", None));
        for k in 0..500 {
            let stamp_s = 1.0 + f64::from(k) * 0.01;
            if !skipped.contains(&k) {
                gather.message(out, stamp_s);
                gather.set(out, control, f64::from(k));
            }
            gather.message(esc, stamp_s + later_s);
            gather.set(esc, rpm, f64::from(k));
        }
        recording("r", &gather.finish(), &map).unwrap()
    }

    #[test]
    fn microseconds_to_this_side_or_that_of_a_row_decide_nothing() {
        for later_s in [-1e-6, 0.0, 1e-6, -0.004, 0.004] {
            for rows_of in [None, Some("out"), Some("esc")] {
                let r = pair(later_s, 0..0, rows_of);
                let speed = r.column("shaft_speed_rad_s").unwrap();
                let command = r.column("duty_cmd").unwrap();
                assert_eq!(r.rows(), 500, "{later_s} {rows_of:?}");
                for (speed, command) in speed.iter().zip(command) {
                    let number = speed * 60.0 / std::f64::consts::TAU;
                    assert!((number - command).abs() < 1e-6, "{later_s}: {number} beside {command}");
                }
            }
        }
    }

    #[test]
    fn what_is_measured_in_a_gap_of_the_rows_comes_into_none_of_them() {
        let r = pair(1e-6, 200..300, None);
        // The speeds are more: theirs are the rows, and the command stands over its gap.
        assert_eq!((r.rows(), r.column("duty_cmd").unwrap()[299]), (500, 199.0));
        let r = pair(1e-3, 200..300, Some("out"));
        assert_eq!(r.rows(), 400);
        let speed = r.column("shaft_speed_rad_s").unwrap();
        assert!((speed[200] * 60.0 / std::f64::consts::TAU - 300.0).abs() < 1e-6, "{}", speed[200]);
        let said = r.notes.join("; ");
        assert!(said.contains("100 message(s) of `esc[0]` lie further than half a row"), "{said}");
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
    fn another_clock_and_another_instance_are_said() {
        let map = ColumnMap::from_toml("m", MAP).unwrap();
        let sources: Vec<String> = map.sources().map(|(s, _)| s.to_string()).collect();
        let notes = |ahead_s: f64| {
            let mut gather = Gather::new("test", "seconds", Some(&sources));
            let [out, esc, second] = ["out", "esc[0]", "esc[1]"].map(|name| gather.topic(name));
            let (control, rpm) = (gather.field(out, "control[0]", None), gather.field(esc, "rpm", None));
            for k in 0..400 {
                let stamp_s = f64::from(k) * 0.01;
                gather.message(out, stamp_s);
                gather.set(out, control, 0.1);
                if k % 4 == 0 {
                    gather.message(esc, stamp_s + ahead_s);
                    gather.set(esc, rpm, f64::from(k));
                    gather.message(second, stamp_s);
                }
            }
            recording("r", &gather.finish(), &map).unwrap().notes.join("; ")
        };
        let said = notes(2.0);
        assert!(said.contains("`esc[0]` begins 2.0 s and ends 2.0 s later than the rows"), "{said}");
        assert!(said.contains("also has `esc[1]`"), "{said}");
        assert!(!notes(0.003).contains("begins"), "{}", notes(0.003));
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
        let map = ColumnMap::from_toml("m", &MAP.replace("control[0]", "control[port]")).unwrap();
        match recording("r", &log, &map).unwrap_err() {
            Problem::MappedColumnMissing { hint, .. } => {
                assert!(hint.contains("which of out.control[0] is meant"), "{hint}");
            }
            other => panic!("{other}"),
        }
    }
}
