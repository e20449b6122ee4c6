//! File formats, recognised by content when read and by the file's name when written.

mod bag;
mod blackbox;
mod candump;
mod cdr;
mod csv;
mod dataflash;
mod mcap;
mod parquet;
mod ros;
mod stream;
mod ulog;

pub(crate) use candump::NAME as CANDUMP;
pub(crate) use dataflash::NAME as DATAFLASH;
pub use mcap::{Rows as LiveMcap, schema as message_schema, state_schema};
pub(crate) use ulog::NAME as ULOG;

use std::io::{self, BufRead, Seek, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;

use crate::error::{Problem, RecordingError};
use crate::log::{Log, join};
use crate::map::{ColumnMap, Time};
use crate::recording::Recording;

const GZIP: &[u8] = &[0x1f, 0x8b];
/// What ROS 2 packs bags with, whole or message by message.
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// Decodes by content.
pub(crate) fn decode(
    name: &str,
    mut input: impl BufRead,
    map: Option<&ColumnMap>,
) -> Result<Recording, Problem> {
    let start = input.fill_buf().map_err(unreadable)?;
    if start.is_empty() {
        Err(Problem::Empty)
    } else if start.starts_with(GZIP) {
        decode_plain(name, io::BufReader::with_capacity(1 << 16, MultiGzDecoder::new(input)), map)
    } else {
        decode_plain(name, input, map)
    }
}

fn decode_plain(name: &str, mut input: impl BufRead, map: Option<&ColumnMap>) -> Result<Recording, Problem> {
    let messages = map.is_some_and(|map| matches!(map.time, Time::Clock { .. }));
    match Content::of(input.fill_buf().map_err(unreadable)?) {
        Content::Empty => Err(Problem::Empty),
        Content::Zstd => Err(ZSTD_FILE),
        Content::Mcap if !messages => mcap::decode(name, input, map),
        Content::Csv => csv::decode(name, input, map),
        kind => {
            let Some(map) = map else { return Err(Problem::MapWanted { format: kind.name() }) };
            let sources: Vec<String> = map.sources().map(|(source, _)| source.to_string()).collect();
            join::recording(name, &kind.log(input, Some(&sources))?, map)
        }
    }
}

/// The states of a live recording, see [`Recording::states`].
pub(crate) fn states(input: impl io::Read, take: impl FnMut(f64, &[u8])) -> Result<(), Problem> {
    mcap::states(input, take)
}

/// Reads a log as its messages: the values of the wanted sources, or the statistics of all.
pub(crate) fn log(mut input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let start = input.fill_buf().map_err(unreadable)?;
    if start.starts_with(GZIP) {
        let mut input = io::BufReader::with_capacity(1 << 16, MultiGzDecoder::new(input));
        let kind = Content::of(input.fill_buf().map_err(unreadable)?);
        return kind.log(input, wanted);
    }
    Content::of(start).log(input, wanted)
}

/// Formats of logs, told by how they begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    Empty,
    Zstd,
    Csv,
    Mcap,
    Ulog,
    DataFlash,
    Candump,
    Bag,
    Blackbox,
}

impl Content {
    fn of(start: &[u8]) -> Self {
        match () {
            () if start.is_empty() => Content::Empty,
            () if start.starts_with(ZSTD) => Content::Zstd,
            () if start.starts_with(::mcap::MAGIC) => Content::Mcap,
            () if start.starts_with(ulog::MAGIC) => Content::Ulog,
            () if start.starts_with(dataflash::MAGIC) => Content::DataFlash,
            () if start.starts_with(bag::MAGIC) => Content::Bag,
            () if start.starts_with(blackbox::MAGIC) => Content::Blackbox,
            () if candump::begins(start) => Content::Candump,
            () => Content::Csv,
        }
    }

    /// For people.
    fn name(self) -> &'static str {
        match self {
            Content::Empty => "empty",
            Content::Zstd => "zstd",
            Content::Csv => "CSV",
            Content::Mcap => "MCAP",
            Content::Ulog => ULOG,
            Content::DataFlash => DATAFLASH,
            Content::Candump => CANDUMP,
            Content::Bag => "ROS 2 bag (sqlite)",
            Content::Blackbox => "Betaflight blackbox",
        }
    }

    fn log(self, input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
        match self {
            Content::Empty => Err(Problem::Empty),
            Content::Zstd => Err(ZSTD_FILE),
            Content::Csv => csv::log(input, wanted),
            Content::Mcap => mcap::log(input, wanted),
            Content::Ulog => ulog::log(input, wanted),
            Content::DataFlash => dataflash::log(input, wanted),
            Content::Candump => candump::log(input, wanted),
            Content::Bag => bag::log(input, wanted),
            Content::Blackbox => blackbox::log(input, wanted),
        }
    }
}

const ZSTD_FILE: Problem = Problem::Packed { with: "zstd", hint: "`zstd -d FILE` unpacks it" };
const ZSTD_MESSAGES: Problem = Problem::Packed {
    with: "zstd, message by message",
    hint: "`ros2 bag convert` writes a bag without compression",
};

fn unreadable(error: io::Error) -> Problem {
    Problem::Unreadable { message: error.to_string() }
}

/// MCAP channel of a recording that says of no thruster that it is its own: that of the first one of a service, so that
/// what is drawn of a service's recordings is drawn of it too.
pub const TOPIC: &str = "t1";

/// A format to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// CSV, RFC 4180.
    Csv,
    /// CSV, gzip.
    CsvGz,
    /// MCAP with JSON messages.
    Mcap,
    /// Parquet; written only.
    Parquet,
}

impl Format {
    /// The format that a file's name asks for.
    ///
    /// # Errors
    /// The name ends in none of `.csv`, `.csv.gz`, `.mcap`, `.parquet`.
    pub fn of(path: &Path) -> Result<Self, RecordingError> {
        let name = path.to_string_lossy().to_lowercase();
        match () {
            () if name.ends_with(".csv") => Ok(Format::Csv),
            () if name.ends_with(".csv.gz") => Ok(Format::CsvGz),
            () if name.ends_with(".mcap") => Ok(Format::Mcap),
            () if name.ends_with(".parquet") => Ok(Format::Parquet),
            () => {
                let found =
                    path.extension().map_or("nothing".into(), |e| format!("\".{}\"", e.to_string_lossy()));
                Err(RecordingError::new(&path.display().to_string(), Problem::UnknownFormat { found }))
            }
        }
    }
}

/// Writes a recording row by row, so that a live recorder and a simulation need not hold it.
pub struct Writer<W: Write + Seek + Send>(Kind<W>);

enum Kind<W: Write + Seek + Send> {
    Csv(csv::Rows<W>),
    CsvGz(Box<csv::Rows<GzEncoder<W>>>),
    Mcap(Box<mcap::Rows<W>>),
    Parquet(Box<parquet::Rows<W>>),
}

impl<W: Write + Seek + Send> Writer<W> {
    /// Starts a recording with these columns beside `time_s`. `topic` names the MCAP channel.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn create(format: Format, topic: &str, columns: &[&str], output: W) -> io::Result<Self> {
        Ok(Self(match format {
            Format::Csv => Kind::Csv(csv::Rows::create(columns, output)?),
            Format::CsvGz => {
                let output = GzEncoder::new(output, Compression::default());
                Kind::CsvGz(Box::new(csv::Rows::create(columns, output)?))
            }
            Format::Mcap => Kind::Mcap(Box::new(mcap::Rows::create(topic, columns, output)?)),
            Format::Parquet => Kind::Parquet(Box::new(parquet::Rows::create(columns, output)?)),
        }))
    }

    /// Writes a row; `values` are in the order of the columns, NaN means "not sampled then".
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn row(&mut self, time_s: f64, values: &[f64]) -> io::Result<()> {
        match &mut self.0 {
            Kind::Csv(rows) => rows.row(time_s, values),
            Kind::CsvGz(rows) => rows.row(time_s, values),
            Kind::Mcap(rows) => rows.row(time_s, values),
            Kind::Parquet(rows) => rows.row(time_s, values),
        }
    }

    /// Brings all rows so far to the output, so that a killed process does not lose them.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        match &mut self.0 {
            Kind::Csv(rows) => rows.flush(),
            Kind::CsvGz(rows) => rows.flush(),
            Kind::Mcap(rows) => rows.flush(),
            // It has no end before its last row.
            Kind::Parquet(_) => Ok(()),
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn finish(self) -> io::Result<()> {
        match self.0 {
            Kind::Csv(rows) => rows.finish().map(drop),
            Kind::CsvGz(rows) => rows.finish()?.finish().map(drop),
            Kind::Mcap(rows) => rows.finish(),
            Kind::Parquet(rows) => rows.finish(),
        }
    }
}

impl Recording {
    /// Writes the whole recording.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn write(&self, format: Format, output: impl Write + Seek + Send) -> io::Result<()> {
        let names: Vec<&str> = self.columns.iter().map(|c| c.name.as_str()).collect();
        let topic = self.about.get("thruster").map_or(TOPIC, String::as_str);
        let mut writer = Writer::create(format, topic, &names, output)?;
        let mut row = vec![f64::NAN; names.len()];
        for (i, time_s) in self.time_s.iter().enumerate() {
            for (cell, column) in row.iter_mut().zip(&self.columns) {
                *cell = column.values[i];
            }
            writer.row(*time_s, &row)?;
        }
        writer.finish()
    }

    /// Writes the recording to a file, in the format its name asks for.
    ///
    /// # Errors
    /// The name asks for no known format, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), RecordingError> {
        let format = Format::of(path)?;
        let fail = |e: io::Error| {
            let message = format!("(for writing) {e}");
            RecordingError::new(&path.display().to_string(), Problem::Unreadable { message })
        };
        let file = std::fs::File::create(path).map_err(fail)?;
        self.write(format, io::BufWriter::new(file)).map_err(fail)
    }
}

#[cfg(test)]
mod damaged;
#[cfg(test)]
mod tests;
