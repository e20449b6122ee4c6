//! Why a recording cannot be used: file, place, value found, what is allowed, and a hint.

mod hint;

use std::fmt;

use thiserror::Error;

use crate::dates::{FORMS, FORMS_OF_DAY};

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
    /// Numbers where the names should stand.
    #[error(
        "{place} holds numbers where the names of the columns should stand: {found}; allowed: a header row of names, `time_s` among them"
    )]
    NoNames {
        /// Where.
        place: Place,
        /// The row.
        found: String,
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
    /// Names without cells below them, and nothing shows which.
    #[error(
        "{place} has {cells} cells, the header names {}: {}; nothing in the file shows which of them has no cell", names.len(), names.join(" | ")
    )]
    HeaderLonger {
        /// Where the first row is.
        place: Place,
        /// Its cells.
        cells: u64,
        /// The names of the header.
        names: Vec<String>,
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
    /// A stamp that is no time of day, where the column map says that the stamps are times of day.
    #[error("{place}, column `{column}`: \"{text}\" is no time of day; allowed: {}", FORMS_OF_DAY)]
    NotATimeOfDay {
        /// Where.
        place: Place,
        /// The time column.
        column: String,
        /// The cell.
        text: String,
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
