//! A CSV file of anyone as a table of numbers, to say what is in it.

use std::collections::BTreeMap;
use std::io::Read;

use csv::{ByteRecord, ReaderBuilder};

use super::clocks::Clocks;
use super::encoding::Texts;
use super::ends::{self, Ends, Repeats};
use super::opening::{self, DELIMITERS, Opening};
use super::stamps::{self, Stamps};
use super::{Lines, empty_rows, is_empty, read, text, units};
use crate::cell::{Odd, is_no_value};
use crate::decimal::{has_comma, thousands, with_comma, with_point};
use crate::error::{Place, Problem};
use crate::log::{Gather, Log};

/// The whole file as one topic without a name; its stamps are those of the column that looks like time.
pub(in crate::formats) fn log(input: impl Read, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let Opening { rows: input, delimiter, lines, notes } = opening::open(input, None, &DELIMITERS, &[])?;
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(input);
    let mut record = ByteRecord::new();
    if !read(&mut reader, &mut record)? {
        return Err(Problem::Empty);
    }
    let mut texts = Texts::default();
    let mut above = vec![record.clone()];
    texts.take(&mut record, lines.header())?;
    let (mut ends, nameless) = Ends::of(&mut record, delimiter);
    let names: Vec<String> = if nameless {
        (1..=record.len()).map(ends::by_place).collect()
    } else {
        record.iter().map(|cell| text(cell).trim().to_owned()).collect()
    };
    let mut next = if nameless { Ok(true) } else { read(&mut reader, &mut record) };
    let mut line = if nameless { lines.header() } else { lines.at(&record) };
    let second = record.clone();
    let is_text = matches!(next, Ok(true)) && texts.take(&mut record, line).is_ok();
    let below = if is_text && !nameless { units::below(&names, &record) } else { None };
    let units_line = line;
    if below.is_some() {
        above.push(second);
        next = read(&mut reader, &mut record);
        line = lines.at(&record);
    }
    let unit = |place: usize| below.as_ref().and_then(|units| units.get(place)?.clone());
    let (stamps, unread) = stamps::find(&names, unit, &record, Place::Line(line));
    let clocks = Clocks::of(&names, unit, &stamps, &record);
    let mut gather = Gather::new("CSV", stamps.clock(), wanted);
    gather.delimiter(delimiter);
    let topic = gather.topic("");
    for (place, name) in names.iter().enumerate() {
        let name = if name.is_empty() { format!("(column {})", place + 1) } else { name.clone() };
        gather.field(topic, name, stamps.unit(place).map(str::to_owned).or_else(|| unit(place)));
    }
    if nameless {
        gather.nameless();
        gather.note(ends::said(lines.header()));
    }
    let twice = (0..names.len()).find_map(|second| {
        let first = names[..second].iter().position(|name| *name == names[second] && !name.is_empty())?;
        Some(Problem::DuplicateColumn { column: names[second].clone(), first: first + 1, second: second + 1 })
    });
    if let Some(twice) = twice {
        gather.loss(format!("{twice}: refused where the file is read; {}", twice.hint()));
    }
    if below.is_some() {
        gather.note(units::said(units_line));
    }
    notes.into_iter().for_each(|note| gather.note(note));
    if let Some(problem) = unread {
        gather.note(format!("the stamps cannot be read: {problem}; {}", problem.hint()));
    }
    let mut repeats = Repeats::of(if nameless { Vec::new() } else { above });
    let mut table = Table { lines, columns: names.len(), stamps, topic, rows: 0 };
    let points = Side::new(gather, clocks);
    let mut marks =
        Marks { points, commas: None, pointed: false, settled: false, thousands: false, first_comma: None };
    // Rows of another length than the header, by their length.
    let (mut odd, mut empty) = (BTreeMap::<usize, u64>::new(), 0_u64);
    loop {
        match next {
            Ok(true) => {}
            Ok(false) => break,
            Err(Problem::Unreadable { message }) => {
                marks.loss(&format!("the file ends in the middle of its data: {message}"));
                break;
            }
            Err(other) => return Err(other),
        }
        if is_empty(&record) {
            empty += 1;
        } else {
            let line = lines.at(&record);
            if repeats.is(&record, line) {
                next = read(&mut reader, &mut record);
                continue;
            }
            // What is no text is counted as such, and refused by line where the log is read.
            let _ = texts.take(&mut record, line);
            ends.cut(&mut record);
            if record.len() != names.len() {
                *odd.entry(record.len()).or_default() += 1;
            }
            marks.row(&mut table, &record);
        }
        next = read(&mut reader, &mut record);
    }
    let cells = odd.first_key_value().filter(|(cells, rows)| **rows == table.rows && **cells < names.len());
    let beyond = cells.map_or(Vec::new(), |(cells, _)| ends::perhaps_without(&names, *cells));
    if !beyond.is_empty() {
        marks.loss(&ends::said_longer(&names, &beyond));
    } else if !odd.is_empty() {
        let rows: u64 = odd.values().sum();
        marks.loss(&format!("{rows} of {} rows are not as long as the header", table.rows));
    }
    let notes = texts.note().into_iter().chain(empty_rows(empty)).chain(ends.note()).chain(repeats.note());
    notes.for_each(|note| marks.note(&note));
    let mut log = marks.finish(&names);
    log.without_cells = beyond;
    // A separator at the end of every row, the names' too, begins no column.
    let fields = &mut log.topics[topic].fields;
    if names.last().is_some_and(String::is_empty)
        && fields.pop_if(|field| field.samples + field.texts == 0).is_some()
    {
        log.notes.push("a separator ends the rows, and begins no column".into());
    }
    log.dates = table.stamps.into_dates();
    let midnights = log.dates.as_ref().and_then(|dates| dates.midnights());
    log.notes.extend(midnights);
    Ok(log)
}

/// Where in a row what stands.
struct Table {
    lines: Lines,
    columns: usize,
    stamps: Stamps,
    topic: usize,
    rows: u64,
}

/// The table as it reads with one decimal mark.
#[derive(Clone)]
struct Side<'w> {
    gather: Gather<'w>,
    clocks: Clocks,
    /// Rows without a stamp, and with one that cannot be read.
    unstamped: Odd,
    unread: Odd,
    /// Cells that hold no value, and those that hold no number, by column.
    no_value: BTreeMap<usize, Odd>,
    no_number: BTreeMap<usize, Odd>,
}

impl<'w> Side<'w> {
    fn new(gather: Gather<'w>, clocks: Clocks) -> Self {
        let (unstamped, unread) = (Odd::default(), Odd::default());
        Self { gather, clocks, unstamped, unread, no_value: BTreeMap::new(), no_number: BTreeMap::new() }
    }

    fn take(&mut self, table: &Table, row: &ByteRecord, number: fn(&str) -> Option<f64>) {
        let of = |text: &str| number(text).filter(|number| number.is_finite());
        let stamp_s = table.stamps.now_s(row, table.rows, of);
        let place = || Place::Line(table.lines.at(row));
        if stamp_s.is_nan() {
            let said = table.stamps.said(row);
            let none = said.is_empty() || is_no_value(&said);
            (if none { &mut self.unstamped } else { &mut self.unread }).add(place(), &said);
            return self.gather.unstamped();
        }
        self.clocks.take(row, stamp_s, of);
        self.gather.message(table.topic, stamp_s);
        for (column, cell) in row.iter().take(table.columns).enumerate().filter(|(_, cell)| !cell.is_empty())
        {
            let cell = std::str::from_utf8(cell).map_or("", str::trim);
            match number(cell) {
                Some(value) if value.is_finite() => self.gather.set(table.topic, column, value),
                _ if is_no_value(cell) => self.no_value.entry(column).or_default().add(place(), cell),
                _ => {
                    self.gather.text(table.topic, column);
                    self.no_number.entry(column).or_default().add(place(), cell);
                }
            }
        }
    }

    /// The log, and the rows and cells that it lacks.
    fn finish(mut self, names: &[String]) -> Log {
        self.gather.losses(self.unstamped.said("row(s) have no stamp and are left out").into_iter().chain(
            self.unread.said(
                "row(s) have no stamp that can be read: left out here, and refused where the file is read",
            ),
        ));
        let (notes, clocks) = (self.clocks.notes(names), self.clocks.others());
        notes.into_iter().for_each(|note| self.gather.note(note));
        let mut log = self.gather.finish();
        log.other_clocks = clocks;
        for (column, name) in names.iter().enumerate() {
            let none = self.no_value.get(&column).and_then(|odd| odd.no_value(name));
            let word = self.no_number.get(&column).and_then(|odd| {
                odd.said(&format!(
                    "cell(s) of `{name}` are no number, and a recording that takes it is refused"
                ))
            });
            let lost: Vec<String> = none.into_iter().chain(word).collect();
            if !lost.is_empty() {
                log.lost_in.insert(column, lost);
            }
        }
        log
    }
}

/// The table as it reads with decimal points and, from the first number with a comma on, as it reads with decimal commas.
/// Which of them it is the whole file says: a number with a point anywhere, and it is points; nothing but commas that may
/// be marks for thousands, and nobody knows.
struct Marks<'w> {
    points: Side<'w>,
    commas: Option<Side<'w>>,
    pointed: bool,
    /// A comma was seen that can be nothing but a decimal mark.
    settled: bool,
    /// Commas were seen that can be nothing but marks for thousands.
    thousands: bool,
    /// Line and cell.
    first_comma: Option<(u64, String)>,
}

impl Marks<'_> {
    fn row(&mut self, table: &mut Table, row: &ByteRecord) {
        for text in row.iter().filter_map(|cell| std::str::from_utf8(cell).ok()).map(str::trim) {
            self.pointed = self.pointed || text.contains('.') && with_point(text).is_some();
            let marks = thousands(text);
            self.thousands = self.thousands || marks.is_some_and(|marks| marks > 1);
            if has_comma(text) {
                self.settled = self.settled || marks.is_none();
                if self.first_comma.is_none() {
                    self.first_comma = Some((table.lines.at(row), text.to_owned()));
                }
            }
        }
        if self.pointed {
            self.commas = None;
        } else if self.first_comma.is_some() && self.commas.is_none() {
            // Up to here both read alike.
            self.commas = Some(self.points.clone());
        }
        table.stamps.read(row);
        self.points.take(table, row, with_point);
        if let Some(commas) = &mut self.commas {
            commas.take(table, row, with_comma);
        }
        table.rows += 1;
    }

    fn note(&mut self, words: &str) {
        self.points.gather.note(words.to_owned());
        if let Some(commas) = &mut self.commas {
            commas.gather.note(words.to_owned());
        }
    }

    fn loss(&mut self, words: &str) {
        self.points.gather.loss(words.to_owned());
        if let Some(commas) = &mut self.commas {
            commas.gather.loss(words.to_owned());
        }
    }

    fn finish(mut self, names: &[String]) -> Log {
        let commas = self.commas.filter(|_| !self.thousands);
        let mut unknown = false;
        if let Some(mut commas) = commas {
            if self.settled {
                commas.gather.decimal_comma();
                commas.gather.note("the numbers have a decimal comma".into());
                return commas.finish(names);
            }
            unknown = true;
        }
        if let Some((line, text)) = self.first_comma {
            let why = if unknown {
                "nothing in the file tells whether their comma is a decimal mark or one for thousands: every one stands before three digits"
            } else if self.pointed {
                "other numbers have a decimal point; a file has one decimal mark, and none for thousands"
            } else {
                "other numbers have several commas, which are marks for thousands; a file has none of these"
            };
            self.points
                .gather
                .note(format!("\"{text}\" (line {line}) and its like are taken for text: {why}"));
        }
        let mut log = self.points.finish(names);
        log.perhaps_decimal_comma = unknown;
        log
    }
}
