//! CSV as RFC 4180 has it, header row first.

mod clocks;
mod encoding;
mod ends;
mod opening;
mod stamps;
mod table;
mod units;

use std::io::{self, Read, Write};

use csv::{ByteRecord, ErrorKind, ReaderBuilder};

use crate::assemble::Assembler;
use crate::cell::{Cell, shown};
use crate::error::{Place, Problem};
use crate::map::ColumnMap;
use crate::recording::Recording;
use encoding::Texts;
use ends::{Ends, Repeats};
use opening::{DELIMITERS, Opening};

pub(super) use table::log;

/// Decodes row by row: memory holds the columns and one row.
pub(super) fn decode(name: &str, input: impl Read, map: Option<&ColumnMap>) -> Result<Recording, Problem> {
    let stated = map.and_then(|map| map.delimiter);
    let wanted = map.map_or(vec!["time_s"], ColumnMap::wanted);
    // A recording of our own that a spreadsheet has saved again is known by its names.
    let offered = match stated {
        Some(delimiter) => vec![delimiter],
        None if map.is_none() => DELIMITERS.to_vec(),
        None => vec![b','],
    };
    let Opening { rows: input, delimiter, lines, mut notes } =
        opening::open(input, stated, &offered, &wanted)?;
    let mut tail = Tail { input, last: b'\n' };
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(&mut tail);
    let mut record = ByteRecord::new();
    if !read(&mut reader, &mut record)? {
        return Err(Problem::Empty);
    }
    let mut texts = Texts::default();
    let mut above = vec![record.clone()];
    texts.take(&mut record, lines.header())?;
    let (mut ends, nameless) = Ends::of(&mut record, delimiter);
    if nameless && map.is_none() {
        return Err(Problem::NoNames { place: Place::Line(lines.header()), found: shown(&said(&record)) });
    }
    let mut header: Vec<String> = if nameless {
        notes.push(ends::said(lines.header()));
        (1..=record.len()).map(ends::by_place).collect()
    } else {
        record.iter().map(|cell| text(cell).trim().to_owned()).collect()
    };
    if map.is_some() {
        // Others end a row with the sign between cells: a column that a map cannot mean.
        for (place, name) in header.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
            *name = format!("(column {})", place + 1);
        }
    }
    let (mut losses, mut empty) = (Vec::new(), 0_u64);
    let mut next = if nameless { Ok(true) } else { read(&mut reader, &mut record) };
    let line = lines.at(&record);
    let second = record.clone();
    if matches!(next, Ok(true))
        && !nameless
        && texts.take(&mut record, line).is_ok()
        && let Some(below) = units::below(&header, &record)
        // Names of our own say the unit themselves: another below them is a contradiction, not a second header.
        && (map.is_some() || units::as_named(&header, &below))
    {
        above.push(second);
        notes.push(units::said(line));
        notes.extend(
            map.iter().flat_map(|map| units::differ(line, &header, &below, map.units_as_they_stand())),
        );
        next = read(&mut reader, &mut record);
    }
    let mut repeats = Repeats::of(if nameless { Vec::new() } else { above });
    notes.extend(ends::without_cells(&mut header, map)?);
    ends.narrow(header.len());
    let width = header.len() as u64;
    let mut rows = Assembler::new(name, header.clone(), map)?;
    // What stands behind the last sign of each row: nothing, if the sign only ends it.
    let mut behind = false;
    let mut first = true;
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
        if is_empty(&record) {
            empty += 1;
            next = read(&mut reader, &mut record);
            continue;
        }
        let line = lines.at(&record);
        if repeats.is(&record, line) {
            next = read(&mut reader, &mut record);
            continue;
        }
        ends.cut(&mut record);
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
            return Err(if first && found < width {
                Problem::HeaderLonger { place, cells: found, names: header }
            } else {
                Problem::RowLength { place, found, expected: width }
            });
        }
        texts.take(&mut record, line)?;
        first = false;
        behind |= record.iter().next_back().is_some_and(|cell| !text(cell).trim().is_empty());
        rows.push(Place::Line(line), |i| match record.get(i).map_or("", text) {
            "" => Cell::Empty,
            text => Cell::Text(text),
        })?;
        next = read(&mut reader, &mut record);
    }
    let mut recording = rows.finish(losses)?;
    if !behind {
        let unnamed = format!("(column {})", header.len());
        recording.unused.retain(|name| *name != unnamed);
    }
    notes.extend(texts.note());
    notes.extend(empty_rows(empty));
    notes.extend(repeats.note());
    notes.extend(ends.note());
    recording.notes.extend(notes);
    Ok(recording)
}

fn read(reader: &mut csv::Reader<impl Read>, record: &mut ByteRecord) -> Result<bool, Problem> {
    reader.read_byte_record(record).map_err(|e| match e.into_kind() {
        ErrorKind::Io(e) => Problem::Unreadable { message: e.to_string() },
        other => Problem::Unreadable { message: format!("{other:?}") },
    })
}

/// How lines are counted: the reader has not taken the second sign of an end of two when it counts the next row, and knows
/// nothing of what stands before the names.
#[derive(Clone, Copy)]
struct Lines {
    of_two: bool,
    before: u64,
}

impl Lines {
    fn of(start: &[u8], before: u64) -> Self {
        let end = start.iter().position(|b| *b == b'\n').unwrap_or(0);
        Self { of_two: start.get(..end).is_some_and(|line| line.ends_with(b"\r")), before }
    }

    /// Line of the names.
    fn header(self) -> u64 {
        self.before + 1
    }

    /// Line of a row below the names.
    fn at(self, row: &ByteRecord) -> u64 {
        row.position().map_or(0, |position| self.before + position.line() + u64::from(self.of_two))
    }
}

/// A cell that [`Texts`] has taken.
fn text(cell: &[u8]) -> &str {
    std::str::from_utf8(cell).unwrap_or_default()
}

/// A row as it is shown.
fn said(row: &ByteRecord) -> String {
    row.iter().map(|cell| text(cell).trim()).collect::<Vec<_>>().join(", ")
}

/// Spreadsheets write a line of delimiters where they have an empty one.
fn is_empty(row: &ByteRecord) -> bool {
    row.iter().all(|cell| cell.trim_ascii().is_empty())
}

fn empty_rows(count: u64) -> Option<String> {
    (count > 0).then(|| format!("{count} row(s) without anything in them are passed over"))
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
