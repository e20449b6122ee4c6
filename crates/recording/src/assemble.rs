//! From rows of a file to a recording: names, units, time, maps. The same for every format.

mod angle;
mod clock;
mod take;

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::cell::{Cell, Odd};
use crate::columns::{self, nearest};
use crate::error::{Place, Problem};
use crate::log::{Back, longest_is_read};
use crate::map::{ColumnMap, Time};
use crate::recording::{Column, Recording};
use clock::{Clock, SECONDS};
use take::Take;

/// Name of the first column where rows come from a log of messages with a clock of its own.
pub(crate) const CLOCK: &str = "the log's clock";

/// A point of a settled table shows its measured values this far into its hold.
const SETTLED_AT: f64 = 0.95;

/// Stamps beyond this, s, count from 1970: three years, as long as no board and no test runs.
const SINCE_1970_S: f64 = 1e8;

/// Takes rows one by one.
pub(crate) struct Assembler<'m> {
    source: Vec<String>,
    /// Texts have a decimal comma.
    decimal_comma: bool,
    /// A log of others: what stands there for no value is none.
    foreign: bool,
    /// Its rows without a stamp, and its cells that hold no value, by source column.
    unstamped: Odd,
    no_value: BTreeMap<usize, Odd>,
    time: TimeColumn,
    select: Option<(usize, &'m str, Vec<String>)>,
    takes: Vec<Take<'m>>,
    recording: Recording,
    last_time: Option<f64>,
    stale_rows: u64,
    /// Where each stretch between resets of the clock begins.
    stretches: Vec<usize>,
    rows: usize,
    row: Vec<f64>,
}

enum TimeColumn {
    Stamps { index: usize, of_day: Option<usize>, clock: Clock, drop_stale: bool },
    Settled { settle_s: f64 },
}

impl<'m> Assembler<'m> {
    pub(crate) fn new(name: &str, source: Vec<String>, map: Option<&'m ColumnMap>) -> Result<Self, Problem> {
        check_header(&source)?;
        let mut recording = Recording { name: name.into(), ..Recording::default() };
        let (time, select, takes) = match map {
            Some(map) => mapped(&source, map, &mut recording)?,
            None => native(&source, &mut recording)?,
        };
        Ok(Self {
            row: Vec::with_capacity(takes.len()),
            source,
            decimal_comma: map.is_some_and(|map| map.decimal_comma),
            foreign: map.is_some(),
            unstamped: Odd::default(),
            no_value: BTreeMap::new(),
            time,
            select,
            takes,
            recording,
            last_time: None,
            stale_rows: 0,
            stretches: vec![0],
            rows: 0,
        })
    }

    /// Takes one row; `cell(i)` is the row's cell of source column `i`.
    pub(crate) fn push<'c>(&mut self, place: Place, cell: impl Fn(usize) -> Cell<'c>) -> Result<(), Problem> {
        if let Some((index, wanted, seen)) = &mut self.select {
            let text = cell(*index).text();
            if text != *wanted {
                if seen.len() < 40 && !seen.contains(&text) {
                    seen.push(text);
                }
                return Ok(());
            }
        }
        let time_s = match &mut self.time {
            TimeColumn::Settled { settle_s } => self.rows as f64 * *settle_s,
            TimeColumn::Stamps { index, of_day, clock, drop_stale } => {
                let column = &self.source[*index];
                if self.foreign && (cell(*index).is_empty() || cell(*index).is_no_value()) {
                    self.unstamped.add(place, &cell(*index).text());
                    return Ok(());
                }
                let beside = of_day.map(|of_day| (self.source[of_day].as_str(), cell(of_day)));
                let raw = clock.read(place, (column, cell(*index)), beside, self.decimal_comma)?;
                if raw.is_nan() {
                    return Err(Problem::TimeEmpty { place, column: column.clone() });
                }
                let time_s = raw * clock.to_s();
                if let Some(before) = self.last_time.filter(|before| raw <= *before) {
                    if !*drop_stale {
                        let ([before, value], column) = (clock.said(before, raw), column.clone());
                        return Err(Problem::TimeNotIncreasing { place, column, before, value });
                    }
                    let stretch = &self.recording.time_s[self.stretches.last().copied().unwrap_or(0)..];
                    match Back::of(time_s, stretch) {
                        Back::Late => {
                            self.stale_rows += 1;
                            return Ok(());
                        }
                        Back::NewestDamaged => self.drop_newest(),
                        Back::Anew => self.stretches.push(self.recording.rows()),
                    }
                }
                self.last_time = Some(raw);
                time_s
            }
        };
        let number = |index: usize| {
            let cell = if self.foreign { cell(index).or_empty() } else { cell(index) };
            cell.number(place, &self.source[index], self.decimal_comma)
        };
        self.row.clear();
        for take in &mut self.takes {
            let (text, raw) = (cell(take.index), number(take.index)?);
            let says_none = self.foreign && text.is_no_value() || take.is_none(raw);
            if says_none && take.rest(place, text).is_none() {
                self.no_value.entry(take.index).or_default().add(place, &text.text());
            }
            let mut value = take.value(raw, says_none);
            if let Some((index, zero)) = take.sign_of {
                let side = number(index)? - zero;
                value *= if side == 0.0 { 0.0 } else { side.signum() };
            }
            self.row.push(value);
        }
        self.rows += 1;
        match self.time {
            TimeColumn::Stamps { .. } => self.append(time_s, true),
            TimeColumn::Settled { settle_s } => {
                self.append(time_s, false);
                self.append(time_s + SETTLED_AT * settle_s, true);
            }
        }
        Ok(())
    }

    fn append(&mut self, time_s: f64, measured: bool) {
        self.recording.time_s.push(time_s);
        for ((column, take), value) in self.recording.columns.iter_mut().zip(&self.takes).zip(&self.row) {
            column.values.push(if measured || take.command { *value } else { f64::NAN });
        }
    }

    fn drop_newest(&mut self) {
        self.recording.time_s.pop();
        for column in &mut self.recording.columns {
            column.values.pop();
        }
        self.rows -= 1;
        self.stale_rows += 1;
    }

    /// Keeps the stretch between resets of the clock with the most rows, the first of several; what that costs.
    fn keep_longest(&mut self) -> Option<String> {
        let resets = self.stretches.len() - 1;
        if resets == 0 {
            return None;
        }
        let rows = self.recording.rows();
        let ends = self.stretches.iter().skip(1).copied().chain([rows]);
        let stretches = self.stretches.iter().zip(ends).map(|(from, to)| *from..to);
        let longest = stretches.min_by_key(|stretch| Reverse(stretch.len()))?;
        let left_out = format!("{} row(s)", rows - longest.len());
        let lost = longest_is_read(resets, self.recording.time_s.get(longest.clone())?, &left_out);
        let columns = self.recording.columns.iter_mut().map(|column| &mut column.values);
        for values in columns.chain([&mut self.recording.time_s]) {
            values.truncate(longest.end);
            values.drain(..longest.start);
        }
        self.rows = longest.len();
        lost
    }

    /// Ends the recording; `losses` are those of the format.
    pub(crate) fn finish(mut self, losses: Vec<String>) -> Result<Recording, Problem> {
        if let Some((index, wanted, mut seen)) = self.select.take().filter(|_| self.rows == 0) {
            seen.sort();
            let column = self.source[index].clone();
            return Err(Problem::NothingSelected { column, wanted: wanted.into(), found: list(&seen) });
        }
        let resets = self.keep_longest();
        if self.rows < 2 {
            return Err(Problem::TooFewRows { found: self.rows });
        }
        let mut recording = self.recording;
        recording.losses = losses;
        recording.losses.extend(resets);
        recording.losses.extend(self.unstamped.said("row(s) have no stamp and are left out"));
        recording.losses.extend(self.no_value.iter().filter_map(|(at, odd)| odd.no_value(&self.source[*at])));
        if self.foreign {
            angle::unwrap(&mut recording);
            recording.notes.extend(self.takes.iter().flat_map(Take::notes));
        }
        if self.stale_rows > 0 {
            let rows = self.stale_rows;
            recording.losses.push(format!("{rows} row(s) with a stale time stamp skipped"));
        }
        if let TimeColumn::Stamps { clock, .. } = &self.time {
            if let Some(dates) = clock.dates() {
                recording.notes.push(format!("time_s counts from {}", dates.first()));
                recording.notes.extend(dates.midnights());
            }
            count_from_the_first(&mut recording);
            note_gaps(&mut recording);
        }
        for column in &recording.columns {
            if column.samples() == 0 {
                recording.notes.push(format!("column `{}` has no sample", column.name));
            }
        }
        Ok(recording)
    }
}

/// Stamps of the time of day are counted from the first row: in what is told of them seconds since 1970 have no digits left.
fn count_from_the_first(recording: &mut Recording) {
    let Some(first_s) = recording.time_s.first().copied().filter(|first_s| *first_s > SINCE_1970_S) else {
        return;
    };
    recording.time_s.iter_mut().for_each(|time_s| *time_s -= first_s);
    recording.notes.push(format!(
        "the stamps begin at {first_s:.6} s, as those that count from 1970; here they count from the first row"
    ));
}

fn note_gaps(recording: &mut Recording) {
    let gaps = recording.gaps();
    if let Some(longest) = gaps.iter().max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s))) {
        recording.notes.push(format!(
            "{} gap(s) in time, the longest from {:.3} to {:.3} s (rows are usually {:.4} s apart)",
            gaps.len(),
            longest.from_s,
            longest.to_s,
            recording.period_s(),
        ));
    }
}

fn check_header(source: &[String]) -> Result<(), Problem> {
    let mut seen = std::collections::HashMap::with_capacity(source.len());
    for (i, name) in source.iter().enumerate() {
        if name.is_empty() {
            return Err(Problem::UnnamedColumn { position: i + 1 });
        }
        if let Some(first) = seen.insert(name, i + 1) {
            return Err(Problem::DuplicateColumn { column: name.clone(), first, second: i + 1 });
        }
    }
    Ok(())
}

fn list(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(30).map(String::as_str).collect();
    let more = if names.len() > shown.len() { ", …" } else { "" };
    format!("{}{more}", shown.join(", "))
}

type Plan<'m> = (TimeColumn, Option<(usize, &'m str, Vec<String>)>, Vec<Take<'m>>);

/// Our own names.
fn native<'m>(source: &[String], recording: &mut Recording) -> Result<Plan<'m>, Problem> {
    let Some(time) = source.iter().position(|n| n == "time_s") else {
        const MAP: &str = "a log with other names or units comes in through a column map (--columns NAME): `kort columns LOG` names the one that fits, or proposes one";
        let hint = match nearest("time_s", source.iter().map(String::as_str)) {
            Some(near) => format!("if `{near}` is time in seconds, rename it to time_s; {MAP}"),
            None => MAP.into(),
        };
        return Err(Problem::MissingTime { wanted: "time_s".into(), found: list(source), hint });
    };
    let mut takes = Vec::with_capacity(source.len());
    for (index, name) in source.iter().enumerate().filter(|(i, _)| *i != time) {
        if let Some(near) = columns::unit_missing(name) {
            let allowed = near.map_or("allowed: a name that ends in its SI unit".into(), |k| {
                format!("allowed: `{}` in {}", k.name, k.unit)
            });
            return Err(Problem::UnitMissing { column: name.clone(), allowed });
        }
        recording.columns.push(Column::new(name.as_str(), Vec::new()));
        takes.push(Take::own(index));
    }
    Ok((TimeColumn::Stamps { index: time, of_day: None, clock: SECONDS, drop_stale: false }, None, takes))
}

/// A foreign log through its map.
fn mapped<'m>(source: &[String], map: &'m ColumnMap, recording: &mut Recording) -> Result<Plan<'m>, Problem> {
    let mut used = vec![false; source.len()];
    let mut find = |name: &str| {
        let Some(index) = source.iter().position(|n| n == name) else {
            let hint = match nearest(name, source.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`? Correct the map or choose another"),
                None => "is this the right map for this log?".into(),
            };
            let (map, column) = (map.name.clone(), name.to_string());
            return Err(Problem::MappedColumnMissing { map, column, found: list(source), hint });
        };
        used[index] = true;
        Ok(index)
    };
    let time = match &map.time {
        Time::Column { source, time_of_day, stamps, drop_stale } => {
            let (index, clock) = (find(source)?, Clock::of(*stamps));
            let of_day = time_of_day.as_deref().map(&mut find).transpose()?;
            TimeColumn::Stamps { index, of_day, clock, drop_stale: *drop_stale }
        }
        Time::Settled { settle_s } => TimeColumn::Settled { settle_s: *settle_s },
        Time::Clock { .. } if source.first().is_some_and(|first| first == CLOCK) => {
            find(CLOCK)?;
            TimeColumn::Stamps { index: 0, of_day: None, clock: SECONDS, drop_stale: false }
        }
        Time::Clock { .. } => return Err(Problem::TableWanted { map: map.name.clone() }),
    };
    let select = match &map.select {
        Some(select) => Some((find(&select.source)?, select.value.as_str(), Vec::new())),
        None => None,
    };
    let mut takes = Vec::with_capacity(map.columns.len());
    let mut lacking = Vec::new();
    for column in &map.columns {
        if column.optional && !source.contains(&column.source) {
            lacking.push(column.source.as_str());
            continue;
        }
        let sign_of = match &column.sign_of {
            Some((source, zero)) => Some((find(source)?, *zero)),
            None => None,
        };
        takes.push(Take::mapped(find(&column.source)?, column, sign_of));
        recording.columns.push(Column::new(column.name.as_str(), Vec::new()));
    }
    if !map.given.is_empty() {
        let given: Vec<String> = map.given.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        recording.notes.push(format!("column map {}: {}", map.name, given.join(", ")));
    }
    if !lacking.is_empty() {
        recording
            .notes
            .push(format!("not in this log, though the column map has it: {}", lacking.join(", ")));
    }
    recording.unused = source.iter().zip(&used).filter(|(_, used)| !**used).map(|(n, _)| n.clone()).collect();
    Ok((time, select, takes))
}
