//! Why a recording cannot be used: file, place, value found, what is allowed, and a hint.

use std::fmt;

use thiserror::Error;

use crate::dates::{FORMS, is_date};
use crate::decimal::has_comma;
use crate::log::propose::symbol;

/// An unusable recording.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{file}: {problem}\nhint: {}", problem.hint())]
pub struct RecordingError {
    /// The file's path, or the recording's name.
    pub file: String,
    /// What is wrong with it.
    pub problem: Problem,
}

impl RecordingError {
    pub(crate) fn new(file: &str, problem: Problem) -> Self {
        Self { file: file.into(), problem }
    }

    /// There is nothing in it to be read, as after a logger that was stopped at once.
    pub fn has_no_rows(&self) -> bool {
        matches!(self.problem, Problem::Empty | Problem::TooFewRows { .. })
    }
}

/// Where in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a CSV file; the header is line 1.
    Line(u64),
    /// Message of an MCAP file, from 1.
    Message(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(n) => write!(f, "line {n}"),
            Place::Message(n) => write!(f, "message {n}"),
        }
    }
}

/// What is wrong with a recording.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Problem {
    /// The file cannot be opened or read.
    #[error("cannot be read: {message}")]
    Unreadable {
        /// The system's words.
        message: String,
    },
    /// A folder, as a ROS 2 bag is.
    #[error("is a folder; allowed: a file{}", inside.as_ref().map_or(String::new(), |log| format!(", as `{log}` in it")))]
    Folder {
        /// A log in it.
        inside: Option<String>,
    },
    /// Packed as kort does not unpack.
    #[error("is packed with {with}; allowed: plain or gzip")]
    Packed {
        /// With what.
        with: &'static str,
        /// What to do.
        hint: &'static str,
    },
    /// The name of a file to write ends in nothing kort writes.
    #[error("file name ends in {found}; allowed: .csv, .csv.gz, .mcap or .parquet")]
    UnknownFormat {
        /// The ending found.
        found: String,
    },
    /// Nothing in it.
    #[error("is empty; a recording has a header row and at least two rows")]
    Empty,
    /// Bytes that are no text.
    #[error(
        "{place} is no text, and the file begins like no log that kort reads; allowed: CSV in UTF-8, UTF-16 with its mark or Windows-1252 (Latin-1), MCAP, PX4 ULog, ArduPilot DataFlash, ROS 2 bag, Betaflight or INAV blackbox, candump; plain or gzip"
    )]
    NotText {
        /// Where.
        place: Place,
    },
    /// UTF-16 that does not say so.
    #[error(
        "line 1 has a zero beside each sign, as UTF-16 has, without the mark that UTF-16 begins with; allowed: CSV in UTF-8, UTF-16 with its mark or Windows-1252 (Latin-1)"
    )]
    Utf16Unmarked,
    /// What a file's first line says of its delimiter is none, or not what the map says.
    #[error("line 1 says that the cells are parted by {found:?}; allowed: {allowed}")]
    Delimiter {
        /// What it says.
        found: char,
        /// What may stand there.
        allowed: String,
    },
    /// A header name twice.
    #[error("column `{column}` stands twice in the header, at positions {first} and {second}")]
    DuplicateColumn {
        /// The name.
        column: String,
        /// First position, from 1.
        first: usize,
        /// Second position, from 1.
        second: usize,
    },
    /// A header cell without a name.
    #[error("the header's position {position} has no name")]
    UnnamedColumn {
        /// Position, from 1.
        position: usize,
    },
    /// No time column.
    #[error("column `{wanted}` is missing; found: {found}")]
    MissingTime {
        /// The time column looked for.
        wanted: String,
        /// The columns there are.
        found: String,
        /// What to do.
        hint: String,
    },
    /// A column of ours whose unit is missing or another.
    #[error("column `{column}` has no SI unit at the end of its name; {allowed}")]
    UnitMissing {
        /// The column.
        column: String,
        /// What would be allowed.
        allowed: String,
    },
    /// A row of another length than the header.
    #[error("{place} has {found} cells, the header has {expected}")]
    RowLength {
        /// Where.
        place: Place,
        /// Cells found.
        found: u64,
        /// Cells in the header.
        expected: u64,
    },
    /// A row without its instant.
    #[error("{place}, column `{column}` is empty; every row needs its time")]
    TimeEmpty {
        /// Where.
        place: Place,
        /// The time column.
        column: String,
    },
    /// Time stands still or runs back.
    #[error("{place}: `{column}` = {value} does not come after {before}; time must be strictly increasing")]
    TimeNotIncreasing {
        /// Where.
        place: Place,
        /// The time column.
        column: String,
        /// Time of the row before, as the file has it.
        before: String,
        /// Time found.
        value: String,
    },
    /// A stamp that is no date, where the column map says that the stamps are dates.
    #[error(
        "{place}, column `{column}`: \"{text}\" is no date with its time of day, {orders}; allowed: {}",
        FORMS
    )]
    NotADate {
        /// Where.
        place: Place,
        /// The time column.
        column: String,
        /// The cell.
        text: String,
        /// What a date may begin with there.
        orders: String,
    },
    /// A date whose day and month may be either.
    #[error(
        "{place}, column `{column}`: \"{text}\" may be {orders}, each at another time after the first row, and no row up to there has a number above 12; allowed: the order stated, or the year first"
    )]
    DateOrder {
        /// Where.
        place: Place,
        /// The time column.
        column: String,
        /// The cell.
        text: String,
        /// What it may begin with.
        orders: String,
    },
    /// A cell that is no number.
    #[error(
        "{place}, column `{column}`: \"{text}\" is not a number; allowed: a finite decimal number, or an empty cell for \"not sampled then\""
    )]
    NotANumber {
        /// Where.
        place: Place,
        /// Which column.
        column: String,
        /// The cell.
        text: String,
    },
    /// A decimal point where the column map says that the decimal mark is a comma.
    #[error(
        "{place}, column `{column}`: \"{text}\" has a point, and the column map says decimal = \",\"; allowed: 1234,5 without a mark for thousands"
    )]
    PointBesideComma {
        /// Where.
        place: Place,
        /// Which column.
        column: String,
        /// The cell.
        text: String,
    },
    /// NaN or infinity written out.
    #[error(
        "{place}, column `{column}`: \"{text}\" is not finite; allowed: a finite decimal number, or an empty cell for \"not sampled then\""
    )]
    NotFinite {
        /// Where.
        place: Place,
        /// Which column.
        column: String,
        /// The cell.
        text: String,
    },
    /// Not enough rows.
    #[error("{found} row(s) of data; at least 2 are needed")]
    TooFewRows {
        /// Rows found.
        found: usize,
    },
    /// A column map names a column that the file does not have.
    #[error("column map `{map}` wants the column `{column}`, which the file does not have; found: {found}")]
    MappedColumnMissing {
        /// The map.
        map: String,
        /// The source column.
        column: String,
        /// The columns there are.
        found: String,
        /// What to do.
        hint: String,
    },
    /// A log of messages, read without a map.
    #[error("is a {format} log, which comes in through a column map")]
    MapWanted {
        /// The format.
        format: &'static str,
    },
    /// A log of messages, read with a map for tables.
    #[error(
        "column map `{map}` is for tables with a column of stamps; the file is a {format} log, whose messages have stamps of their own"
    )]
    ClockWanted {
        /// The map.
        map: String,
        /// The format.
        format: &'static str,
    },
    /// A table, read with a map for logs of messages.
    #[error("column map `{map}` is for logs of messages; the file is a table")]
    TableWanted {
        /// The map.
        map: String,
    },
    /// A log that cannot be read.
    #[error("not a readable {format} log: {message}")]
    Broken {
        /// The format.
        format: &'static str,
        /// What is wrong, and where.
        message: String,
    },
    /// No row has the selected value.
    #[error("no row has `{column}` = \"{wanted}\"; found: {found}")]
    NothingSelected {
        /// The column selected by.
        column: String,
        /// The value asked for.
        wanted: String,
        /// The values there are.
        found: String,
    },
    /// An MCAP file without a usable channel.
    #[error(
        "no channel holds numbers kort can read: {found}; allowed: JSON messages, and through a column map ROS 2 messages (cdr with ros2msg)"
    )]
    NoChannel {
        /// The channels there are.
        found: String,
    },
    /// Broken MCAP.
    #[error("not a readable MCAP file: {message}")]
    Mcap {
        /// The reader's words.
        message: String,
    },
}

impl Problem {
    /// The way out.
    pub fn hint(&self) -> String {
        match self {
            Problem::Unreadable { .. } => "check the path and that the file may be read".into(),
            Problem::Folder { inside: Some(log) } => format!("name {log}; the files of a bag in several parts are read one by one, and all recordings of a folder at once by `fit` and `diagnose` only"),
            Problem::Folder { inside: None } => "name the log itself; no file in this folder is called like a recording or a log (.csv, .mcap, .ulg, .bin, .db3, .bfl, .bbl, .log; plain or .gz)".into(),
            Problem::Packed { hint, .. } => (*hint).into(),
            Problem::UnknownFormat { .. } => "name the file REC.csv, REC.csv.gz or REC.mcap".into(),
            Problem::Empty => "was the logger stopped before its first row?".into(),
            Problem::NotText { .. } => {
                "a table, or a spreadsheet, must be saved as CSV in UTF-8; a log of another format must be converted to one of these".into()
            }
            Problem::Utf16Unmarked => {
                "save it as CSV in UTF-8; or `iconv -f UTF-16LE -t UTF-8 FILE` (UTF-16BE where the zero comes first)".into()
            }
            Problem::Delimiter { .. } => {
                "save the file with a delimiter that is allowed, or correct `delimiter` in the column map".into()
            }
            Problem::DuplicateColumn { .. } => "rename or remove one of the two".into(),
            Problem::UnnamedColumn { .. } => {
                "name it, or remove the column; an extra comma at the end of the header is one".into()
            }
            Problem::MissingTime { hint, .. } | Problem::MappedColumnMissing { hint, .. } => hint.clone(),
            Problem::UnitMissing { .. } => {
                "rename the column if its values are in that unit; otherwise bring the log in with a column map (--columns NAME), which states the unit"
                    .into()
            }
            Problem::RowLength { .. } => {
                "cells are parted by commas, or what the column map's `delimiter` says; a decimal comma or a comma in a text must be quoted there".into()
            }
            Problem::TimeEmpty { .. } => "fill in the time, or remove the row".into(),
            Problem::TimeNotIncreasing { before, value, .. } if before == value => {
                "where rows come faster than their stamps can tell, as stamps of whole seconds, have the logger write fractions of a second; of rows with one stamp a column map may keep the first: [time] stale_rows = \"drop\"".into()
            }
            Problem::TimeNotIncreasing { .. } => {
                "sort the rows and remove repeated stamps; separate runs belong in separate files; a column map may say [time] stale_rows = \"drop\"".into()
            }
            Problem::NotANumber { text, .. } if has_comma(text) => {
                "a decimal comma is read where the column map says decimal = \",\"; `kort columns LOG` proposes such a map".into()
            }
            Problem::NotANumber { text, .. } if is_date(text) => {
                "dates are read where the column map says [time] unit = \"date\"; `kort columns LOG` proposes such a map".into()
            }
            Problem::NotADate { .. } => {
                "write all stamps in one of these forms, or as numbers with their unit; the column map may state `order` in [time]: \"year-first\", \"day-first\" or \"month-first\"".into()
            }
            Problem::DateOrder { .. } => {
                "say in the column map [time] order = \"day-first\" or \"month-first\"; `kort columns LOG` proposes it where a later row tells".into()
            }
            Problem::NotANumber { place: Place::Line(2), text, .. } if symbol(text).is_some() => {
                "a row of units below names of our own must repeat the units that they end in; other names come in through a column map: `kort columns LOG` proposes one".into()
            }
            Problem::PointBesideComma { .. } => {
                "write the file without marks for thousands and with one decimal mark throughout, or correct `decimal` in the map".into()
            }
            Problem::NotANumber { .. } => {
                "a text column can be left out by a column map (--columns NAME)".into()
            }
            Problem::NotFinite { .. } => "leave the cell empty if there was no sample".into(),
            Problem::TooFewRows { .. } => "was the logger stopped too early?".into(),
            Problem::NothingSelected { .. } => "give the value after the map's name: --columns NAME:VALUE".into(),
            Problem::MapWanted { .. } => {
                "`kort columns LOG` lists what is in it and which map fits; then --columns NAME".into()
            }
            Problem::ClockWanted { .. } => "such a map has [time] clock = \"log\"; `kort columns LOG` proposes one".into(),
            Problem::TableWanted { .. } => {
                "a map for tables names the column of stamps: [time] source and unit; `kort columns LOG` proposes one".into()
            }
            Problem::Broken { .. } => "was the file copied whole? A log that was cut off is read up to where it ends".into(),
            Problem::NoChannel { .. } => "`kort columns LOG` lists what can be read; else export the signals with JSON messages, or as CSV".into(),
            Problem::Mcap { .. } => "a file cut off by a killed process is read up to its last complete chunk; this one has none".into(),
        }
    }
}
