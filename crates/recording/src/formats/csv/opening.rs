//! What a file begins with before its rows: a mark of its encoding, Excel's `sep=;`, lines about the measurement, the names.

use std::io::{self, Cursor, Read};

use csv::{ByteRecord, ReaderBuilder};
use encoding_rs_io::DecodeReaderBytesBuilder;

use super::encoding::Texts;
use super::{Lines, units};
use crate::dates::{is_date, is_day, is_time_of_day};
use crate::decimal::{with_comma, with_point};
use crate::error::Problem;

/// The names of the columns are looked for in so many bytes.
const WINDOW: u64 = 1 << 16;

/// What parts cells.
pub(super) const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];

/// A file from the line of its names on.
pub(super) struct Opening<R> {
    /// Its bytes, in UTF-8 where it is UTF-16.
    pub rows: R,
    /// What parts its cells.
    pub delimiter: u8,
    /// How its lines are counted.
    pub lines: Lines,
    /// What was passed over.
    pub notes: Vec<String>,
}

/// Finds the line of the names: the first one with all that are wanted, else the one that stands above rows of numbers, else
/// the first of all. Cells are parted by what the map states, else by what the file says itself, else by one of those offered.
pub(super) fn open<R: Read>(
    input: R,
    stated: Option<u8>,
    offered: &[u8],
    wanted: &[&str],
) -> Result<Opening<impl Read + use<R>>, Problem> {
    // What begins as UTF-16 comes out as UTF-8, all else as it is.
    let mut input = DecodeReaderBytesBuilder::new().utf8_passthru(true).strip_bom(true).build(input);
    let mut start = Vec::new();
    let broken = input.by_ref().take(WINDOW).read_to_end(&mut start).err();
    if utf16_without_mark(&start) {
        return Err(Problem::Utf16Unmarked);
    }
    let mut notes = Vec::new();
    let mut begins = 0;
    let said = said(&start)?;
    if let Some((delimiter, behind)) = said {
        let shown = char::from(delimiter);
        if let Some(map) = stated.filter(|map| *map != delimiter) {
            let allowed = format!("{:?}, as the column map has it", char::from(map));
            return Err(Problem::Delimiter { found: shown, allowed });
        }
        notes.push(format!("line 1 says that the cells are parted by {shown:?}, and is no row"));
        begins = behind;
    }
    let whole = (start.len() as u64) < WINDOW;
    // What others saved again has the map's names and another sign between them.
    let known = |delimiter: u8| Rows::of(&start[begins..], delimiter, whole).with(wanted).is_some();
    let saved_again = stated.filter(|map| said.is_none() && !wanted.is_empty() && !known(*map));
    let other = saved_again.and_then(|map| Some((map, *DELIMITERS.iter().find(|other| known(**other))?)));
    if let Some((map, other)) = other {
        let [map, other] = [map, other].map(char::from);
        notes.push(format!("the cells are parted by {other:?}, not by {map:?} as the column map has it"));
    }
    let only = said.map(|(delimiter, _)| [delimiter]).or(other.map(|(_, other)| [other]));
    let offered = only.as_ref().map_or(offered, |one| one);
    let (delimiter, found) = header(&start[begins..], whole, offered, wanted);
    let names = begins + found;
    let before = count(&start[..begins]);
    if found > 0 {
        notes.push(passed_over(&start[begins..names], before));
    }
    let lines = Lines::of(&start[names..], before + count(&start[begins..names]));
    let mut rows = Cursor::new(start);
    rows.set_position(names as u64);
    Ok(Opening { rows: rows.chain(Broken(broken)).chain(input), delimiter, lines, notes })
}

/// Fails once, where the file did while its beginning was read.
struct Broken(Option<io::Error>);

impl Read for Broken {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        self.0.take().map_or(Ok(0), Err)
    }
}

fn count(bytes: &[u8]) -> u64 {
    bytes.iter().filter(|b| **b == b'\n').count() as u64
}

/// A zero beside each sign of its first ones.
fn utf16_without_mark(start: &[u8]) -> bool {
    let pairs = &start[..start.len().min(64) & !1];
    let zeros = |at: usize| pairs.iter().skip(at).step_by(2).all(|b| *b == 0);
    pairs.len() >= 4 && zeros(0) != zeros(1)
}

/// What Excel's first line says of the cells, and where the next one begins.
fn said(start: &[u8]) -> Result<Option<(u8, usize)>, Problem> {
    let end = start.iter().position(|b| *b == b'\n').map_or(start.len(), |end| end + 1);
    let line = String::from_utf8_lossy(&start[..end]);
    let line = line.trim_end_matches(['\r', '\n']).trim_matches('"');
    let Some(("sep=", sign)) = line.split_at_checked(4).filter(|(word, _)| word.eq_ignore_ascii_case("sep="))
    else {
        return Ok(None);
    };
    let mut signs = sign.chars();
    match (signs.next(), signs.next()) {
        (Some(found), None) => match u8::try_from(found).ok().filter(|sign| DELIMITERS.contains(sign)) {
            Some(sign) => Ok(Some((sign, end))),
            None => Err(Problem::Delimiter { found, allowed: "',', ';' or '\\t'".into() }),
        },
        _ => Ok(None),
    }
}

/// Words on the lines before the names, of which the first ones are shown.
fn passed_over(lines: &[u8], before: u64) -> String {
    const SHOWN: usize = 3;
    let words = encoding_rs::WINDOWS_1252.decode_without_bom_handling(lines).0;
    let words = std::str::from_utf8(lines).unwrap_or(&words);
    let mut shown: Vec<String> = words
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .map(|line| format!("{:?}", line.chars().take(60).collect::<String>()))
        .collect();
    if shown.len() > SHOWN {
        shown.truncate(SHOWN);
        shown.push("…".into());
    }
    let (first, last) = (before + 1, before + count(lines));
    let (lines, verb) = if first == last {
        (format!("line {first}"), "stands")
    } else {
        (format!("lines {first} to {last}"), "stand")
    };
    format!("{lines} {verb} before the names of the columns and are passed over: {}", shown.join(", "))
}

/// What parts the cells, and where the line of the names begins.
fn header(start: &[u8], whole: bool, offered: &[u8], wanted: &[&str]) -> (u8, usize) {
    let line = start.split(|b| *b == b'\n').next().unwrap_or(start);
    let marks = |wanted: u8| line.iter().filter(|b| **b == wanted).count();
    let usual = offered.iter().copied().max_by_key(|d| (marks(*d), *d == b',')).unwrap_or(b',');
    let named = |delimiter| Rows::of(start, delimiter, whole).with(wanted);
    if !wanted.is_empty()
        && let Some((delimiter, at)) = offered.iter().find_map(|d| Some((*d, named(*d)?)))
    {
        return (delimiter, at);
    }
    let above = |delimiter| Some((delimiter, Rows::of(start, delimiter, whole).above_numbers()?));
    match above(usual) {
        Some((delimiter, Header { at: 0, .. })) => (delimiter, 0),
        _ => offered
            .iter()
            .filter_map(|delimiter| above(*delimiter))
            .max_by(|(_, a), (_, b)| a.numbers.total_cmp(&b.numbers).then(a.width.cmp(&b.width)))
            .map_or((usual, 0), |(delimiter, header)| (delimiter, header.at)),
    }
}

/// A line of names.
struct Header {
    at: usize,
    width: usize,
    /// Share of numbers in the rows below.
    numbers: f64,
}

/// The rows that a file begins with.
struct Rows(Vec<(usize, ByteRecord)>);

impl Rows {
    fn of(start: &[u8], delimiter: u8, whole: bool) -> Self {
        let mut reader =
            ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(start);
        let mut rows = Vec::new();
        for mut row in reader.byte_records().map_while(Result::ok) {
            let at = row.position().map_or(0, |position| position.byte() as usize);
            // The reader counts the ends of lines before a row to it.
            let ends = start[at..].iter().take_while(|b| matches!(b, b'\r' | b'\n')).count();
            // What is no text is refused where it is read.
            let _ = Texts::default().take(&mut row, 0);
            rows.push((if rows.is_empty() { 0 } else { at + ends }, row));
        }
        if !whole {
            rows.pop();
        }
        Self(rows)
    }

    /// Where the first row begins that has these names.
    fn with(&self, wanted: &[&str]) -> Option<usize> {
        let has = |row: &ByteRecord, name: &str| row.iter().any(|cell| text(cell) == name);
        self.0.iter().find(|(_, row)| wanted.iter().all(|name| has(row, name))).map(|(at, _)| *at)
    }

    /// The row of words above the greater part of the rows that hold numbers in as many cells; above a row of units, if there
    /// is one.
    fn above_numbers(&self) -> Option<Header> {
        let mut longest = 0..0;
        let mut from = 0;
        for (place, (_, row)) in self.0.iter().enumerate() {
            if !holds_numbers(row) {
                from = place + 1;
            } else {
                if self.0[from].1.len() != row.len() {
                    from = place;
                }
                if place + 1 - from > longest.len() {
                    longest = from..place + 1;
                }
            }
        }
        let width = self.0.get(longest.start).filter(|_| !longest.is_empty())?.1.len();
        let names = |place: usize| self.0.get(place).is_some_and(|(_, row)| are_names(row, width));
        let below = |place: usize| {
            let (_, above) = self.0.get(place)?;
            let (_, row) = self.0.get(place + 1)?;
            let words: Vec<String> = above.iter().map(|cell| text(cell).to_owned()).collect();
            units::below(&words, row)
        };
        let holds =
            |place: usize| self.0.get(place).is_some_and(|(_, row)| row.len() == width && holds_numbers(row));
        let first = names(0) && (holds(1) || below(0).is_some() && holds(2));
        let place = if first { 0 } else { (0..longest.start).rev().find(|place| names(*place))? };
        let place = match place.checked_sub(1) {
            Some(above) if names(above) && below(above).is_some() => above,
            _ => place,
        };
        let rows = &self.0[longest];
        let cells: usize = rows.iter().map(|(_, row)| filled(row)).sum();
        let numbers: usize = rows.iter().map(|(_, row)| numbers(row)).sum();
        Some(Header { at: self.0[place].0, width, numbers: numbers as f64 / cells as f64 })
    }
}

fn text(cell: &[u8]) -> &str {
    std::str::from_utf8(cell).unwrap_or_default().trim()
}

pub(super) fn filled(row: &ByteRecord) -> usize {
    row.iter().filter(|cell| !cell.trim_ascii().is_empty()).count()
}

/// Whether it is a number: a date, a day and a time of day are too, for no name is one.
pub(super) fn is_number(text: &str) -> bool {
    let stamp = || is_date(text) || is_day(text) || is_time_of_day(text);
    with_point(text).is_some() || with_comma(text).is_some() || stamp()
}

pub(super) fn numbers(row: &ByteRecord) -> usize {
    row.iter().filter(|cell| is_number(text(cell))).count()
}

/// More than a word with its value, as `Rate;100` in lines about the measurement.
fn holds_numbers(row: &ByteRecord) -> bool {
    let numbers = numbers(row);
    numbers >= 2 && 2 * numbers >= filled(row)
}

/// Excel fills lines about the measurement with empty cells up to the width of the table.
fn are_names(row: &ByteRecord, width: usize) -> bool {
    row.len() == width && numbers(row) == 0 && filled(row) >= 2 && 2 * filled(row) > width
}
