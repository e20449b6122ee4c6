//! MCAP with JSON messages: one channel, one message a row, a field a column. A file of others may
//! have several channels; their fields become columns over the common log time.

mod beside;
mod ended;
mod messages;
mod schemas;
mod table;
mod write;

use std::io::{self, Read};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::error::Problem;
use crate::map::ColumnMap;
use crate::recording::Recording;

pub(super) use beside::states;
pub(super) use messages::log;
pub use schemas::{rows as schema, state as state_schema};
use table::Table;
pub use write::Rows;

/// No record and no chunk of a sensible file is longer; a broken length must not eat the memory.
const RECORD_LIMIT: usize = 1 << 30;

/// What is wrong with a file that was read.
#[derive(Default)]
struct Damage {
    /// What tore it, if it has no end.
    torn: Option<String>,
    /// Its chunks, those of them that cannot be read, and what is wrong with the first of these.
    chunks: u64,
    bad_chunks: u64,
    bad: String,
}

impl Damage {
    /// In words, one loss each, for a file of which so many messages were read.
    fn losses(&self, messages: u64) -> Result<Vec<String>, Problem> {
        let mut losses = Vec::new();
        if self.bad_chunks > 0 {
            let Damage { chunks, bad_chunks, bad, .. } = self;
            losses
                .push(format!("{bad_chunks} of {chunks} chunk(s) are damaged and were passed over ({bad})"));
        }
        if let Some(why) = &self.torn {
            losses.push(format!(
                "the file is cut off ({why}); read up to its last complete chunk: {messages} messages; what followed is lost"
            ));
        }
        match losses.first() {
            Some(_) if messages == 0 => {
                let message = self.torn.as_ref().unwrap_or(&self.bad).clone();
                Err(Problem::Mcap { message })
            }
            _ => Ok(losses),
        }
    }
}

/// Every record from start to end. A chunk that is damaged is passed over: how long it is stands before it, and those behind
/// it are whole.
fn records(
    input: impl Read,
    mut take: impl FnMut(Record<'_>) -> Result<(), Problem>,
) -> Result<Damage, Problem> {
    let (mut complete, mut ours, mut unfinished) = (false, false, false);
    let mut damage = Damage::default();
    let mut one = |opcode: u8, data: &[u8]| {
        complete |= opcode == op::DATA_END;
        match whole(opcode, data) {
            Some(true) => (),
            Some(false) => {
                let message = "a text in it is longer than its record".into();
                return Err(Problem::Mcap { message });
            }
            None => return Ok(()),
        }
        let record =
            mcap::parse_record(opcode, data).map_err(|e| Problem::Mcap { message: e.to_string() })?;
        match &record {
            Record::Header(header) => ours = header.library.starts_with(LIBRARY),
            // The end that stands behind what is still being written, see [`ended`].
            Record::Footer(footer) => unfinished = ours && footer.summary_start == 0,
            _ => (),
        }
        take(record)
    };
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT);
    let within = options.clone().with_skip_start_magic(true).with_skip_end_magic(true);
    let torn = walk(input, options.with_emit_chunks(true), &mut |opcode, data| {
        if opcode != op::CHUNK {
            return one(opcode, data);
        }
        damage.chunks += 1;
        let mut head = [opcode; 9];
        head[1..].copy_from_slice(&(data.len() as u64).to_le_bytes());
        if let Some(why) = walk(head.chain(data), within.clone(), &mut one)? {
            damage.bad_chunks += 1;
            if damage.bad.is_empty() {
                damage.bad = why;
            }
        }
        Ok(())
    })?;
    damage.torn = match torn {
        Some(why) => (!complete).then_some(why),
        None => unfinished.then(|| "whoever wrote it was stopped before its end".to_owned()),
    };
    Ok(damage)
}

/// Hands over every record; what stops it before the end.
fn walk(
    mut input: impl Read,
    options: LinearReaderOptions,
    one: &mut impl FnMut(u8, &[u8]) -> Result<(), Problem>,
) -> Result<Option<String>, Problem> {
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(need)) => match input.read(reader.insert(need)) {
                Ok(n) => reader.notify_read(n),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => (),
                Err(e) => return Ok(Some(e.to_string())),
            },
            Ok(LinearReadEvent::Record { opcode, data }) => one(opcode, data)?,
            Err(e) => return Ok(Some(e.to_string())),
        }
    }
    Ok(None)
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

/// Decodes from start to end; a file without its end is read up to the last complete chunk, and damaged chunks are passed over.
pub(super) fn decode(name: &str, input: impl Read, map: Option<&ColumnMap>) -> Result<Recording, Problem> {
    let mut table = Table::default();
    let damage = records(input, |record| table.take(record))?;
    let mut losses = damage.losses(table.messages)?;
    if table.bad_messages > 0 {
        losses.push(format!("{} message(s) are no JSON objects and were skipped", table.bad_messages));
    }
    table.assemble(name, map, losses)
}

/// How files of ours call their library; its version follows.
const LIBRARY: &str = "kort ";
/// Name of the metadata with what is known of a recording.
const ABOUT: &str = "kort";
