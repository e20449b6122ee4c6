//! A CSV file of anyone as a table of numbers, to say what is in it.

use std::io::Read;

use csv::{ByteRecord, ReaderBuilder};

use super::encoding::Texts;
use super::opening::{self, DELIMITERS, Opening};
use super::{Lines, empty_rows, is_empty, read, text, units};
use crate::dates::{self, Dates, is_date};
use crate::decimal::{has_comma, with_comma};
use crate::error::Problem;
use crate::log::propose::symbol;
use crate::log::stamps::{is_time, time_factor};
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
    let names: Vec<String> = record.iter().map(|cell| text(cell).trim().to_owned()).collect();
    let mut next = read(&mut reader, &mut record);
    let line = lines.at(&record);
    let is_text = matches!(next, Ok(true)) && texts.take(&mut record, line).is_ok();
    let below = if is_text { units::below(&names, &record) } else { None };
    if below.is_some() {
        next = read(&mut reader, &mut record);
    }
    let unit = |place: usize| below.as_ref().and_then(|units| units.get(place)?.clone());
    let (time, dated) = time_column(&names, &record);
    let factor = time.and_then(|t| {
        let said = unit(t).and_then(|unit| symbol(&unit)).filter(|unit| unit.si == "s");
        said.map(|unit| unit.factor).or_else(|| time_factor(&names[t]))
    });
    let clock = match (time, factor) {
        (Some(_), _) if dated => "the dates of its time column, counted from the first",
        (Some(_), Some(_)) => "those of its time column",
        (Some(_), None) => "those of its time column, whose unit the log does not say: taken as seconds here",
        (None, _) => "none: no column looks like time; rows are counted",
    };
    let mut gather = Gather::new("CSV", clock, wanted);
    gather.delimiter(delimiter);
    let topic = gather.topic("");
    for (place, name) in names.iter().enumerate() {
        let name = if name.is_empty() { format!("(column {})", place + 1) } else { name.clone() };
        let unit = if dated && time == Some(place) { Some(dates::UNIT.to_owned()) } else { unit(place) };
        gather.field(topic, name, unit);
    }
    if below.is_some() {
        gather.note(units::said(line));
    }
    notes.into_iter().for_each(|note| gather.note(note));
    let stamps = match time {
        Some(column) if dated => Stamps::Dates { column, dates: Dates::new(None), now_s: 0.0 },
        Some(column) => Stamps::Numbers { column, factor: factor.unwrap_or(1.0) },
        None => Stamps::Rows,
    };
    let mut table = Table { lines, columns: names.len(), stamps, topic, rows: 0 };
    let mut marks = Marks { points: gather, commas: None, pointed: false, first_comma: None };
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
            short += u64::from(record.len() != names.len());
            let line = lines.at(&record);
            // What is no text is counted as such, and refused by line where the log is read.
            let _ = texts.take(&mut record, line);
            marks.row(&mut table, &record);
        }
        next = read(&mut reader, &mut record);
    }
    if short > 0 {
        marks.loss(&format!("{short} of {} rows are not as long as the header", table.rows));
    }
    texts.note().into_iter().chain(empty_rows(empty)).for_each(|note| marks.note(&note));
    let mut log = marks.finish();
    if let Stamps::Dates { dates, .. } = table.stamps {
        log.dates = Some(dates);
    }
    Ok(log)
}

/// The column of stamps, and whether they are dates: the one whose name says it, if a stamp stands in it in the first row, else
/// the first one with a date there.
fn time_column(names: &[String], row: &ByteRecord) -> (Option<usize>, bool) {
    let cell =
        |place: usize| row.get(place).map_or("", |cell| std::str::from_utf8(cell).unwrap_or_default().trim());
    let dated = |place: &usize| is_date(cell(*place));
    let stamp = |place: &usize| {
        dated(place) || cell(*place).parse::<f64>().is_ok() || with_comma(cell(*place)).is_some()
    };
    let named = || (0..names.len()).filter(|place| is_time(&names[*place]));
    let first_dated = || (0..names.len()).find(dated);
    let time = named().find(stamp).or_else(first_dated).or_else(|| named().next());
    (time, time.is_some_and(|place| dated(&place)))
}

/// What makes the stamps.
enum Stamps {
    /// The rows are counted.
    Rows,
    Numbers {
        column: usize,
        factor: f64,
    },
    /// With the time of the row under way.
    Dates {
        column: usize,
        dates: Dates,
        now_s: f64,
    },
}

/// Where in a row what stands.
struct Table {
    lines: Lines,
    columns: usize,
    stamps: Stamps,
    topic: usize,
    rows: u64,
}

impl Table {
    /// Reads the row's date, once however often the row is taken.
    fn date(&mut self, row: &ByteRecord) {
        if let Stamps::Dates { column, dates, now_s } = &mut self.stamps {
            let text = row.get(*column).and_then(|cell| std::str::from_utf8(cell).ok());
            *now_s = dates.nearest_s(text.unwrap_or_default());
        }
    }

    fn take(&self, gather: &mut Gather, row: &ByteRecord, number: fn(&str) -> Option<f64>) {
        let number = |cell: &[u8]| std::str::from_utf8(cell).ok().and_then(|text| number(text.trim()));
        let stamp_s = match self.stamps {
            Stamps::Rows => self.rows as f64,
            Stamps::Numbers { column, factor } => {
                row.get(column).and_then(number).map_or(f64::NAN, |stamp| stamp * factor)
            }
            Stamps::Dates { now_s, .. } => now_s,
        };
        gather.message(self.topic, stamp_s);
        for (place, cell) in row.iter().take(self.columns).enumerate().filter(|(_, cell)| !cell.is_empty()) {
            match number(cell) {
                Some(value) => gather.set(self.topic, place, value),
                None => gather.text(self.topic, place),
            }
        }
    }
}

/// The table as it reads with decimal points and, from the first number with a comma on, as it reads with decimal commas.
/// Which of them it is the whole file says: a number with a point anywhere, and it is points.
struct Marks<'w> {
    points: Gather<'w>,
    commas: Option<Gather<'w>>,
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
        table.date(row);
        table.take(&mut self.points, row, |text| text.parse().ok());
        if let Some(commas) = &mut self.commas {
            table.take(commas, row, with_comma);
        }
        table.rows += 1;
    }

    fn note(&mut self, words: &str) {
        self.points.note(words.to_owned());
        if let Some(commas) = &mut self.commas {
            commas.note(words.to_owned());
        }
    }

    fn loss(&mut self, words: &str) {
        self.points.loss(words.to_owned());
        if let Some(commas) = &mut self.commas {
            commas.loss(words.to_owned());
        }
    }

    fn finish(mut self) -> Log {
        if let Some(mut commas) = self.commas {
            commas.decimal_comma();
            commas.note("the numbers have a decimal comma".into());
            return commas.finish();
        }
        if let Some((line, text)) = self.first_comma {
            self.points.note(format!(
                "\"{text}\" (line {line}) and its like are taken for text: other numbers have a decimal point; a file has one decimal mark, and none for thousands"
            ));
        }
        self.points.finish()
    }
}
