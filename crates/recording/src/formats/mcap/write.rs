//! Writing MCAP: rows as JSON messages of one channel; beside it, on request, states and events.

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

use mcap::records::MessageHeader;
use serde_json::Value;

use super::ended::Ended;
use super::schemas::{self, EVENT, ROWS, STATE};
use super::{ABOUT, LIBRARY};

/// Size of a chunk before compression, bytes.
const CHUNK_BYTES: u64 = 128 * 1024;

/// Writes rows as JSON messages of one channel; beside it, on request, states and events.
///
/// A chunk is put together in memory and written whole, with an end behind it that the next one takes the place of:
/// whoever is killed at any instant leaves a file that every MCAP reader opens.
pub struct Rows<W: Write + Seek> {
    writer: mcap::Writer<Ended<W>>,
    channel_id: u16,
    beside: Option<[u16; 2]>,
    origin_ns: u64,
    columns: Vec<String>,
    sequence: u32,
    message: Vec<u8>,
}

impl<W: Write + Seek> Rows<W> {
    pub(in crate::formats) fn create(topic: &str, columns: &[&str], output: W) -> io::Result<Self> {
        let mut writer = mcap::WriteOptions::new()
            .library(format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(Ended::new(output)?)
            .map_err(cause)?;
        let schema = schemas::rows(columns).to_string();
        let schema_id = writer.add_schema(ROWS, "jsonschema", schema.as_bytes()).map_err(cause)?;
        let topic = topic_of(topic);
        let channel_id = writer.add_channel(schema_id, &topic, "json", &BTreeMap::new()).map_err(cause)?;
        let columns = columns.iter().map(|c| c.to_string()).collect();
        Ok(Self { writer, channel_id, beside: None, origin_ns: 0, columns, sequence: 0, message: Vec::new() })
    }

    /// A live recording: `about` is what a stranger needs to know (the rig's text above all), `origin_ns` the wall
    /// time of `time_s = 0`, ns since 1970.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn live(
        topic: &str,
        columns: &[&str],
        about: BTreeMap<String, String>,
        origin_ns: u64,
        output: W,
    ) -> io::Result<Self> {
        let mut rows = Self::create(topic, columns, output)?;
        rows.about(about)?;
        let mut channel = |name: &str, schema: Value, topic: &str| -> io::Result<u16> {
            let id =
                rows.writer.add_schema(name, "jsonschema", schema.to_string().as_bytes()).map_err(cause)?;
            rows.writer.add_channel(id, topic, "json", &BTreeMap::new()).map_err(cause)
        };
        let state = channel(STATE, schemas::state(), &format!("{}/state", topic_of(topic)))?;
        let event = channel(EVENT, schemas::event(), "/events")?;
        rows.beside = Some([state, event]);
        rows.origin_ns = origin_ns;
        Ok(rows)
    }

    /// What is known of the recording; what is said again later takes the place of what was said before.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn about(&mut self, about: BTreeMap<String, String>) -> io::Result<()> {
        let about = mcap::records::Metadata { name: ABOUT.into(), metadata: about };
        self.writer.write_metadata(&about).map_err(cause)
    }

    /// A column not sampled in this row is left out of the message; of a recording that is saved whole the first message
    /// has all of them, so that a column without a value is still one when it is read.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn row(&mut self, time_s: f64, values: &[f64]) -> io::Result<()> {
        self.message.clear();
        write!(self.message, "{{\"time_s\":")?;
        serde_json::to_writer(&mut self.message, &time_s)?;
        let all = self.sequence == 0 && self.beside.is_none();
        for (name, value) in self.columns.iter().zip(values).filter(|(_, v)| all || !v.is_nan()) {
            self.message.push(b',');
            serde_json::to_writer(&mut self.message, name)?;
            self.message.push(b':');
            // What is no number is written as null.
            serde_json::to_writer(&mut self.message, value)?;
        }
        self.message.push(b'}');
        let message = std::mem::take(&mut self.message);
        let written = self.send(self.channel_id, time_s, &message);
        self.message = message;
        written
    }

    /// The thruster's state, a JSON object: setpoint, estimates with their doubt, law, limits, faults.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn state(&mut self, time_s: f64, json: &[u8]) -> io::Result<()> {
        match self.beside {
            Some([state, _]) => self.send(state, time_s, json),
            None => Ok(()),
        }
    }

    /// An event, a JSON object.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn event(&mut self, time_s: f64, json: &[u8]) -> io::Result<()> {
        match self.beside {
            Some([_, event]) => self.send(event, time_s, json),
            None => Ok(()),
        }
    }

    fn send(&mut self, channel_id: u16, time_s: f64, message: &[u8]) -> io::Result<()> {
        // A recording that starts before zero keeps its order only in time_s.
        let log_time = self.origin_ns + (time_s.max(0.0) * 1e9).round() as u64;
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, message).map_err(cause)
    }

    /// Ends the chunk and hands it to the system: what a kill may cost is what came after.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(cause)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.writer.finish().map_err(cause)?;
        self.writer.into_inner().flush()
    }
}

/// The system's own words: what a disk refuses with is told by the inner error alone.
fn cause(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

fn topic_of(topic: &str) -> String {
    if topic.starts_with('/') { topic.to_string() } else { format!("/{topic}") }
}
