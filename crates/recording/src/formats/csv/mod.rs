//! CSV as RFC 4180 has it, header row first.

mod table;
mod units;

use std::io::{self, BufRead, Read, Write};

use csv::{ByteRecord, ErrorKind, ReaderBuilder};

use crate::assemble::{Assembler, Cell};
use crate::error::{Place, Problem};
use crate::map::ColumnMap;
use crate::recording::Recording;

pub(super) use table::log;

/// Decodes row by row: memory holds the columns and one row.
pub(super) fn decode(
    name: &str,
    mut input: impl BufRead,
    map: Option<&ColumnMap>,
) -> Result<Recording, Problem> {
    let lines = Lines::of(input.fill_buf().map_err(|e| Problem::Unreadable { message: e.to_string() })?);
    let mut tail = Tail { input, last: b'\n' };
    let delimiter = map.map_or(b',', |map| map.delimiter);
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(&mut tail);
    let mut record = ByteRecord::new();
    if !read(&mut reader, &mut record)? {
        return Err(Problem::Empty);
    }
    let mut header = Vec::with_capacity(record.len());
    for cell in &record {
        header.push(text(cell, 1)?.trim().to_string());
    }
    if map.is_some() {
        // Others end a row with the sign between cells: a column that a map cannot mean.
        for (place, name) in header.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
            *name = format!("(column {})", place + 1);
        }
    }
    let width = header.len() as u64;
    let mut rows = Assembler::new(name, header.clone(), map)?;
    let (mut losses, mut notes) = (Vec::new(), Vec::new());
    let mut next = read(&mut reader, &mut record);
    if matches!(next, Ok(true))
        && let Some(below) = units::below(&header, &record)
        // Names of our own say the unit themselves: another below them is a contradiction, not a second header.
        && (map.is_some() || units::as_named(&header, &below))
    {
        notes.push("line 2 holds units, and is no row".to_owned());
        notes.extend(map.iter().flat_map(|map| units::differ(&header, &below, map.units_as_they_stand())));
        next = read(&mut reader, &mut record);
    }
    loop {
        match next {
            Ok(true) => {}
            Ok(false) => break,
            // A gzip stream cut off by a killed process: what came before it stands.
            Err(Problem::Unreadable { message }) => {
                losses.push(format!("the file ends in the middle of its data: {message}"));
                break;
            }
            Err(other) => return Err(other),
        }
        let line = lines.at(&record);
        let found = record.len() as u64;
        if found != width {
            let place = Place::Line(line);
            // Only the last row of a file cut off in mid-write may be short.
            if found < width
                && !read(&mut reader, &mut ByteRecord::new()).unwrap_or(false)
                && reader.get_ref().last != b'\n'
            {
                losses.push(format!("{place} was cut off after {found} of {width} cells and is skipped"));
                break;
            }
            return Err(Problem::RowLength { place, found, expected: width });
        }
        for cell in &record {
            text(cell, line)?;
        }
        // Checked above: every cell is UTF-8.
        rows.push(Place::Line(line), |i| match std::str::from_utf8(&record[i]) {
            Ok("") | Err(_) => Cell::Empty,
            Ok(text) => Cell::Text(text),
        })?;
        next = read(&mut reader, &mut record);
    }
    let mut recording = rows.finish(losses)?;
    recording.notes.extend(notes);
    Ok(recording)
}

fn read(reader: &mut csv::Reader<impl Read>, record: &mut ByteRecord) -> Result<bool, Problem> {
    reader.read_byte_record(record).map_err(|e| match e.into_kind() {
        ErrorKind::Io(e) => Problem::Unreadable { message: e.to_string() },
        other => Problem::Unreadable { message: format!("{other:?}") },
    })
}

/// How lines end, for a row's number: the reader has not taken the second sign of an end of two when it counts the next row.
#[derive(Clone, Copy)]
struct Lines {
    of_two: bool,
}

impl Lines {
    fn of(start: &[u8]) -> Self {
        let end = start.iter().position(|b| *b == b'\n').unwrap_or(0);
        Self { of_two: start.get(..end).is_some_and(|line| line.ends_with(b"\r")) }
    }

    /// Line of a row below the header.
    fn at(self, row: &ByteRecord) -> u64 {
        row.position().map_or(0, |position| position.line() + u64::from(self.of_two))
    }
}

fn text(cell: &[u8], line: u64) -> Result<&str, Problem> {
    match std::str::from_utf8(cell) {
        Ok(text) if !text.contains('\0') => Ok(text),
        _ => Err(Problem::NotUtf8 { place: Place::Line(line) }),
    }
}

/// Passes bytes on and remembers the last one.
struct Tail<R> {
    input: R,
    last: u8,
}

impl<R: Read> Read for &mut Tail<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.input.read(buffer)?;
        if let Some(last) = buffer[..n].last() {
            self.last = *last;
        }
        Ok(n)
    }
}

/// Smaller numbers are written with an exponent.
const SMALLEST_WRITTEN_OUT: f64 = 1e-6;

/// Writes rows.
pub(super) struct Rows<W: Write> {
    output: W,
    line: String,
}

impl<W: Write> Rows<W> {
    pub(super) fn create(columns: &[&str], mut output: W) -> io::Result<Self> {
        let mut header = csv::Writer::from_writer(&mut output);
        header.write_record(std::iter::once("time_s").chain(columns.iter().copied()))?;
        header.flush()?;
        drop(header);
        Ok(Self { output, line: String::new() })
    }

    /// Numbers are the shortest that read back as the same bits.
    pub(super) fn row(&mut self, time_s: f64, values: &[f64]) -> io::Result<()> {
        use std::fmt::Write as _;
        self.line.clear();
        let mut cells = || -> std::fmt::Result {
            write!(self.line, "{time_s}")?;
            for value in values {
                match value.abs() {
                    size if size.is_nan() => self.line.push(','),
                    // Written out, what is left of a signal that died away would be hundreds of zeros.
                    size if size > 0.0 && size < SMALLEST_WRITTEN_OUT => write!(self.line, ",{value:e}")?,
                    _ => write!(self.line, ",{value}")?,
                }
            }
            Ok(())
        };
        cells().map_err(io::Error::other)?;
        self.line.push('\n');
        self.output.write_all(self.line.as_bytes())
    }

    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }

    pub(super) fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}

#[cfg(test)]
mod tests;
