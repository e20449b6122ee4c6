//! A CSV file of anyone as a table of numbers, to say what is in it.

use std::io::BufRead;

use csv::{ByteRecord, ReaderBuilder};

use super::{read, text};
use crate::error::Problem;
use crate::log::propose::{is_time, time_factor};
use crate::log::{Gather, Log};

/// The whole file as one topic without a name; its stamps are those of the column that looks like time.
pub(in crate::formats) fn log(mut input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let start = input.fill_buf().map_err(|e| Problem::Unreadable { message: e.to_string() })?;
    let delimiter = delimiter(start);
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
    let time = names.iter().position(|name| is_time(name));
    let factor = time.and_then(|t| time_factor(&names[t]));
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
        gather.field(topic, name, None);
    }
    let (mut row, mut short) = (0_u64, 0_u64);
    loop {
        match read(&mut reader, &mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(Problem::Unreadable { message }) => {
                gather.loss(format!("the file ends in the middle of its data: {message}"));
                break;
            }
            Err(other) => return Err(other),
        }
        let number = |cell: &[u8]| std::str::from_utf8(cell).ok().and_then(|t| t.trim().parse::<f64>().ok());
        let stamp_s = match time {
            Some(t) => record.get(t).and_then(number).map_or(f64::NAN, |stamp| stamp * factor.unwrap_or(1.0)),
            None => row as f64,
        };
        row += 1;
        short += u64::from(record.len() != names.len());
        gather.message(topic, stamp_s);
        for (place, cell) in record.iter().take(names.len()).enumerate().filter(|(_, cell)| !cell.is_empty())
        {
            match number(cell) {
                Some(value) => gather.set(topic, place, value),
                None => gather.text(topic, place),
            }
        }
    }
    if short > 0 {
        gather.loss(format!("{short} of {row} rows are not as long as the header"));
    }
    Ok(gather.finish())
}

/// What parts the cells of the first line.
fn delimiter(start: &[u8]) -> u8 {
    let line = start.split(|b| *b == b'\n').next().unwrap_or(start);
    let count = |wanted: u8| line.iter().filter(|b| **b == wanted).count();
    [b',', b';', b'\t'].into_iter().max_by_key(|d| (count(*d), *d == b',')).unwrap_or(b',')
}
