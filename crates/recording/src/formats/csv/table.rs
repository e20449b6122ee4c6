//! A CSV file of anyone as a table of numbers, to say what is in it.

use std::io::BufRead;

use csv::{ByteRecord, ReaderBuilder};

use super::{Lines, read, text, units};
use crate::decimal::{has_comma, with_comma};
use crate::error::Problem;
use crate::log::propose::{is_time, symbol, time_factor};
use crate::log::{Gather, Log};

/// The whole file as one topic without a name; its stamps are those of the column that looks like time.
pub(in crate::formats) fn log(mut input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let start = input.fill_buf().map_err(|e| Problem::Unreadable { message: e.to_string() })?;
    let (delimiter, lines) = (delimiter(start), Lines::of(start));
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(input);
    let mut record = ByteRecord::new();
    if !read(&mut reader, &mut record)? {
        return Err(Problem::Empty);
    }
    let mut names = Vec::with_capacity(record.len());
    for cell in &record {
        names.push(text(cell, 1)?.trim().trim_start_matches('\u{feff}').to_string());
    }
    let mut next = read(&mut reader, &mut record);
    let below = if matches!(next, Ok(true)) { units::below(&names, &record) } else { None };
    if below.is_some() {
        next = read(&mut reader, &mut record);
    }
    let unit = |place: usize| below.as_ref().and_then(|units| units.get(place)?.clone());
    let time = names.iter().position(|name| is_time(name));
    let factor = time.and_then(|t| {
        let said = unit(t).and_then(|unit| symbol(&unit)).filter(|unit| unit.si == "s");
        said.map(|unit| unit.factor).or_else(|| time_factor(&names[t]))
    });
    let clock = match (time, factor) {
        (Some(_), Some(_)) => "those of its time column",
        (Some(_), None) => "those of its time column, whose unit the log does not say: taken as seconds here",
        (None, _) => "none: no column looks like time; rows are counted",
    };
    let mut gather = Gather::new("CSV", clock, wanted);
    gather.delimiter(delimiter);
    let topic = gather.topic("");
    for (place, name) in names.iter().enumerate() {
        let name = if name.is_empty() { format!("(column {})", place + 1) } else { name.clone() };
        gather.field(topic, name, unit(place));
    }
    if below.is_some() {
        gather.note("line 2 holds units, and is no row".into());
    }
    let mut table =
        Table { lines, columns: names.len(), time, factor: factor.unwrap_or(1.0), topic, rows: 0 };
    let mut marks = Marks { points: gather, commas: None, pointed: false, first_comma: None };
    let mut short = 0_u64;
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
        short += u64::from(record.len() != names.len());
        marks.row(&mut table, &record);
        next = read(&mut reader, &mut record);
    }
    if short > 0 {
        marks.loss(&format!("{short} of {} rows are not as long as the header", table.rows));
    }
    Ok(marks.finish())
}

/// Where in a row what stands.
struct Table {
    lines: Lines,
    columns: usize,
    time: Option<usize>,
    factor: f64,
    topic: usize,
    rows: u64,
}

impl Table {
    fn take(&self, gather: &mut Gather, row: &ByteRecord, number: fn(&str) -> Option<f64>) {
        let number = |cell: &[u8]| std::str::from_utf8(cell).ok().and_then(|text| number(text.trim()));
        let stamp_s = match self.time {
            Some(t) => row.get(t).and_then(number).map_or(f64::NAN, |stamp| stamp * self.factor),
            None => self.rows as f64,
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
        table.take(&mut self.points, row, |text| text.parse().ok());
        if let Some(commas) = &mut self.commas {
            table.take(commas, row, with_comma);
        }
        table.rows += 1;
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

/// What parts the cells of the first line.
fn delimiter(start: &[u8]) -> u8 {
    let line = start.split(|b| *b == b'\n').next().unwrap_or(start);
    let count = |wanted: u8| line.iter().filter(|b| **b == wanted).count();
    [b',', b';', b'\t'].into_iter().max_by_key(|d| (count(*d), *d == b',')).unwrap_or(b',')
}
