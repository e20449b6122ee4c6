//! A CSV file of anyone as a table of numbers, to say what is in it.

use std::io::Read;

use csv::{ByteRecord, ReaderBuilder};

use super::encoding::Texts;
use super::ends::{self, Ends};
use super::opening::{self, DELIMITERS, Opening};
use super::stamps::{self, Stamps};
use super::{Lines, empty_rows, is_empty, read, text, units};
use crate::cell::shown;
use crate::decimal::{has_comma, with_comma};
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
    texts.take(&mut record, lines.header())?;
    let (mut ends, nameless) = Ends::of(&mut record, delimiter);
    let names: Vec<String> = if nameless {
        (1..=record.len()).map(ends::by_place).collect()
    } else {
        record.iter().map(|cell| text(cell).trim().to_owned()).collect()
    };
    let mut next = if nameless { Ok(true) } else { read(&mut reader, &mut record) };
    let mut line = if nameless { lines.header() } else { lines.at(&record) };
    let is_text = matches!(next, Ok(true)) && texts.take(&mut record, line).is_ok();
    let below = if is_text && !nameless { units::below(&names, &record) } else { None };
    let units_line = line;
    if below.is_some() {
        next = read(&mut reader, &mut record);
        line = lines.at(&record);
    }
    let unit = |place: usize| below.as_ref().and_then(|units| units.get(place)?.clone());
    let (stamps, unread) = stamps::find(&names, unit, &record, Place::Line(line));
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
    if below.is_some() {
        gather.note(units::said(units_line));
    }
    notes.into_iter().for_each(|note| gather.note(note));
    if let Some(problem) = unread {
        gather.note(format!("the stamps cannot be read: {problem}; {}", problem.hint()));
    }
    let mut table = Table { lines, columns: names.len(), stamps, topic, rows: 0 };
    let points = Side { gather, unread: 0, first: None };
    let mut marks = Marks { points, commas: None, pointed: false, first_comma: None };
    let (mut short, mut empty) = (0_u64, 0_u64);
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
            // What is no text is counted as such, and refused by line where the log is read.
            let _ = texts.take(&mut record, line);
            ends.cut(&mut record);
            short += u64::from(record.len() != names.len());
            marks.row(&mut table, &record);
        }
        next = read(&mut reader, &mut record);
    }
    if short > 0 {
        marks.loss(&format!("{short} of {} rows are not as long as the header", table.rows));
    }
    texts.note().into_iter().chain(empty_rows(empty)).chain(ends.note()).for_each(|note| marks.note(&note));
    let mut log = marks.finish();
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
    /// Rows whose stamp cannot be read, and the first of them.
    unread: u64,
    first: Option<(u64, String)>,
}

impl Side<'_> {
    fn take(&mut self, table: &Table, row: &ByteRecord, number: fn(&str) -> Option<f64>) {
        let of = |text: &str| number(text).filter(|number| number.is_finite());
        let stamp_s = table.stamps.now_s(row, table.rows, of);
        if stamp_s.is_nan() {
            self.unread += 1;
            self.first.get_or_insert_with(|| (table.lines.at(row), shown(&table.stamps.said(row))));
            return self.gather.unstamped();
        }
        self.gather.message(table.topic, stamp_s);
        for (place, cell) in row.iter().take(table.columns).enumerate().filter(|(_, cell)| !cell.is_empty()) {
            match std::str::from_utf8(cell).ok().and_then(|text| number(text.trim())) {
                Some(value) => self.gather.set(table.topic, place, value),
                None => self.gather.text(table.topic, place),
            }
        }
    }

    /// The log, and the rows that it lacks.
    fn finish(mut self) -> Log {
        if let Some((line, text)) = self.first {
            let (count, mark) = (self.unread, if self.unread > 1 { ", the first in" } else { ", in" });
            self.gather.loss(format!(
                "{count} row(s) have no stamp that can be read and are left out{mark} line {line}: {text:?}"
            ));
        }
        self.gather.finish()
    }
}

/// The table as it reads with decimal points and, from the first number with a comma on, as it reads with decimal commas.
/// Which of them it is the whole file says: a number with a point anywhere, and it is points.
struct Marks<'w> {
    points: Side<'w>,
    commas: Option<Side<'w>>,
    pointed: bool,
    /// Line and cell.
    first_comma: Option<(u64, String)>,
}

impl Marks<'_> {
    fn row(&mut self, table: &mut Table, row: &ByteRecord) {
        for text in row.iter().filter_map(|cell| std::str::from_utf8(cell).ok()).map(str::trim) {
            self.pointed = self.pointed || text.contains('.') && text.parse::<f64>().is_ok();
            if self.first_comma.is_none() && has_comma(text) {
                self.first_comma = Some((table.lines.at(row), text.to_owned()));
            }
        }
        if self.pointed {
            self.commas = None;
        } else if self.first_comma.is_some() && self.commas.is_none() {
            // Up to here both read alike.
            self.commas = Some(self.points.clone());
        }
        table.stamps.read(row);
        self.points.take(table, row, |text| text.parse().ok());
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

    fn finish(mut self) -> Log {
        if let Some(mut commas) = self.commas {
            commas.gather.decimal_comma();
            commas.gather.note("the numbers have a decimal comma".into());
            return commas.finish();
        }
        if let Some((line, text)) = self.first_comma {
            self.points.gather.note(format!(
                "\"{text}\" (line {line}) and its like are taken for text: other numbers have a decimal point; a file has one decimal mark, and none for thousands"
            ));
        }
        self.points.finish()
    }
}
