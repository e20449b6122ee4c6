//! MCAP with JSON messages: one channel, one message a row, a field a column. A file of others may
//! have several channels; their fields become columns over the common log time.

mod ended;
mod messages;
mod table;
mod write;

use std::io::{self, Read};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::error::Problem;
use crate::map::ColumnMap;
use crate::recording::Recording;

pub(super) use messages::log;
use table::Table;
pub use write::{Rows, schema};

/// No record and no chunk of a sensible file is longer; a broken length must not eat the memory.
const RECORD_LIMIT: usize = 1 << 30;

/// Every record from start to end; what tore the file, if it has no end.
fn records(
    mut input: impl Read,
    mut take: impl FnMut(Record<'_>) -> Result<(), Problem>,
) -> Result<Option<String>, Problem> {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let (mut complete, mut ours, mut unfinished) = (false, false, false);
    while let Some(event) = reader.next_event() {
        let torn = match event {
            Ok(LinearReadEvent::ReadRequest(need)) => match input.read(reader.insert(need)) {
                Ok(n) => {
                    reader.notify_read(n);
                    continue;
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => e.to_string(),
            },
            Ok(LinearReadEvent::Record { opcode, data }) => {
                complete |= opcode == op::DATA_END;
                match whole(opcode, data) {
                    Some(true) => (),
                    Some(false) => {
                        let message = "a text in it is longer than its record".into();
                        return Err(Problem::Mcap { message });
                    }
                    None => continue,
                }
                match mcap::parse_record(opcode, data) {
                    Ok(record) => {
                        match &record {
                            Record::Header(header) => ours = header.library.starts_with(LIBRARY),
                            // The end that stands behind what is still being written, see [`ended`].
                            Record::Footer(footer) => unfinished = ours && footer.summary_start == 0,
                            _ => (),
                        }
                        take(record)?;
                    }
                    Err(e) => return Err(Problem::Mcap { message: e.to_string() }),
                }
                continue;
            }
            Err(e) => e.to_string(),
        };
        return Ok((!complete).then_some(torn));
    }
    Ok(unfinished.then(|| "whoever wrote it was stopped before its end".to_owned()))
}

/// Whether the texts of a record lie within it; none for a record that is not used. The crate that takes it apart believes
/// their lengths and reserves what they say, and of an attachment that is too short it panics.
fn whole(opcode: u8, data: &[u8]) -> Option<bool> {
    fn text<'d>(rest: &mut &'d [u8]) -> Option<&'d [u8]> {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (text, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        *rest = after;
        Some(text)
    }
    // Bytes before the texts, how many texts, and whether pairs of texts follow.
    let (before, texts, pairs) = match opcode {
        op::HEADER => (0, 2, false),
        op::SCHEMA => (2, 2, false),
        op::CHANNEL => (4, 2, true),
        op::METADATA => (0, 1, true),
        op::FOOTER | op::MESSAGE => (0, 0, false),
        _ => return None,
    };
    let texts_lie_within = || -> Option<()> {
        let mut rest = data.get(before..)?;
        for _ in 0..texts {
            text(&mut rest)?;
        }
        let mut inner = if pairs { text(&mut rest)? } else { &[] };
        while !inner.is_empty() {
            text(&mut inner)?;
        }
        Some(())
    };
    Some(texts_lie_within().is_some())
}

/// Decodes from start to end; a file without its end is read up to the last complete chunk.
pub(super) fn decode(name: &str, input: impl Read, map: Option<&ColumnMap>) -> Result<Recording, Problem> {
    let mut table = Table::default();
    let torn = records(input, |record| table.take(record))?;
    let mut losses = Vec::new();
    if let Some(why) = torn {
        if table.rows.is_empty() {
            return Err(Problem::Mcap { message: why });
        }
        losses.push(format!(
            "the file is cut off ({why}); read up to its last complete chunk: {} messages; what followed is lost",
            table.messages
        ));
    }
    if table.bad_messages > 0 {
        losses.push(format!("{} message(s) are no JSON objects and were skipped", table.bad_messages));
    }
    table.assemble(name, map, losses)
}

/// How files of ours call their library; its version follows.
const LIBRARY: &str = "kort ";
/// Name of the metadata with what is known of a recording.
const ABOUT: &str = "kort";
/// Schemas of channels that stand beside the signals.
const STATE: &str = "kort.state/1";
const EVENT: &str = "kort.event/1";
const BESIDE: [&str; 2] = [STATE, EVENT];
