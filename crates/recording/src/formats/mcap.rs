//! MCAP with JSON messages: one channel, one message a row, a field a column. A file of others may
//! have several channels; their fields become columns over the common log time.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, Write};

use mcap::records::{MessageHeader, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde_json::Value;

use crate::assemble::{Assembler, Cell};
use crate::columns;
use crate::error::{Place, Problem};
use crate::map::ColumnMap;
use crate::recording::Recording;
use crate::units;

/// No record and no chunk of a sensible file is longer; a broken length must not eat the memory.
const RECORD_LIMIT: usize = 1 << 30;

/// Decodes from start to end; a file without its end is read up to the last complete chunk.
pub(super) fn decode(
    name: &str,
    mut input: impl Read,
    map: Option<&ColumnMap>,
) -> Result<Recording, Problem> {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let mut table = Table::default();
    let mut torn = None;
    let mut complete = false;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(need)) => match input.read(reader.insert(need)) {
                Ok(n) => reader.notify_read(n),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => {
                    torn = Some(e.to_string());
                    break;
                }
            },
            Ok(LinearReadEvent::Record { opcode, data }) => {
                complete |= opcode == mcap::records::op::DATA_END;
                match mcap::parse_record(opcode, data) {
                    Ok(record) => table.take(record)?,
                    Err(e) => return Err(Problem::Mcap { message: e.to_string() }),
                }
            }
            Err(e) => {
                torn = Some(e.to_string());
                break;
            }
        }
    }
    let mut losses = Vec::new();
    if let (Some(why), false) = (torn, complete) {
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

/// Name of the metadata with what is known of a recording.
const ABOUT: &str = "kort";
/// Schemas of channels that stand beside the signals.
const STATE: &str = "kort.state/1";
const EVENT: &str = "kort.event/1";
const BESIDE: [&str; 2] = [STATE, EVENT];

/// Messages as rows over (channel, field) columns.
#[derive(Default)]
struct Table {
    topics: BTreeMap<u16, String>,
    other_topics: Vec<String>,
    schemas: BTreeMap<u16, String>,
    about: BTreeMap<String, String>,
    fields: Vec<(u16, String)>,
    places: BTreeMap<(u16, String), usize>,
    rows: Vec<Row>,
    messages: u64,
    bad_messages: u64,
}

/// Numbers of one instant, by field.
struct Row {
    log_time_ns: u64,
    message: u64,
    cells: Vec<(usize, f64)>,
}

impl Table {
    fn take(&mut self, record: Record<'_>) -> Result<(), Problem> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Metadata(about) if about.name == ABOUT => self.about.extend(about.metadata),
            Record::Channel(channel) => {
                // What stands beside the signals for people and tools is no signal.
                if self.schemas.get(&channel.schema_id).is_some_and(|name| BESIDE.contains(&name.as_str())) {
                    return Ok(());
                }
                if channel.message_encoding == "json" {
                    self.topics.insert(channel.id, channel.topic);
                } else {
                    let other = format!("{} ({})", channel.topic, channel.message_encoding);
                    if !self.other_topics.contains(&other) {
                        self.other_topics.push(other);
                    }
                }
            }
            Record::Message { header, data } if self.topics.contains_key(&header.channel_id) => {
                self.messages += 1;
                match serde_json::from_slice(&data) {
                    Ok(Value::Object(fields)) => {
                        let mut cells = Vec::with_capacity(fields.len());
                        for (name, value) in fields {
                            self.flatten(header.channel_id, name, value, &mut cells);
                        }
                        self.place(header.log_time, cells);
                    }
                    _ => self.bad_messages += 1,
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Numbers and switches become cells; nested objects are joined with a dot; texts and lists
    /// are no signals.
    fn flatten(&mut self, channel: u16, name: String, value: Value, cells: &mut Vec<(usize, f64)>) {
        let number = match value {
            Value::Number(n) => n.as_f64(),
            Value::Bool(b) => Some(f64::from(u8::from(b))),
            Value::Null => Some(f64::NAN),
            Value::Object(fields) => {
                for (inner, value) in fields {
                    self.flatten(channel, format!("{name}.{inner}"), value, cells);
                }
                None
            }
            Value::String(_) | Value::Array(_) => None,
        };
        let Some(number) = number else { return };
        let next = self.fields.len();
        let key = (channel, name);
        let place = *self.places.entry(key.clone()).or_insert(next);
        if place == next {
            self.fields.push(key);
        }
        cells.push((place, number));
    }

    /// Messages of several channels with one log time are one row.
    fn place(&mut self, log_time_ns: u64, cells: Vec<(usize, f64)>) {
        let free =
            |row: &Row| cells.iter().all(|(place, _)| row.cells.iter().all(|(there, _)| there != place));
        if let Some(last) = self.rows.last_mut().filter(|r| r.log_time_ns == log_time_ns && free(r)) {
            last.cells.extend(cells);
            return;
        }
        self.rows.push(Row { log_time_ns, message: self.messages, cells });
    }

    fn assemble(
        mut self,
        name: &str,
        map: Option<&ColumnMap>,
        losses: Vec<String>,
    ) -> Result<Recording, Problem> {
        if self.fields.is_empty() {
            let found =
                if self.other_topics.is_empty() { "none".into() } else { self.other_topics.join(", ") };
            return Err(Problem::NoChannel { found });
        }
        let mut names = self.column_names();
        let stamped = names.iter().any(|n| n == "time_s");
        if !stamped {
            // Foreign file: the log time is the instant, from the first message on.
            self.rows.sort_by_key(|r| r.log_time_ns);
            let start = self.rows.first().map_or(0, |r| r.log_time_ns);
            let place = names.len();
            names.push("time_s".into());
            for row in &mut self.rows {
                row.cells.push((place, (row.log_time_ns - start) as f64 * 1e-9));
            }
        }
        let mut line = vec![f64::NAN; names.len()];
        let mut rows = Assembler::new(name, names, map)?;
        for row in self.rows {
            line.fill(f64::NAN);
            for (place, value) in row.cells {
                line[place] = value;
            }
            rows.push(Place::Message(row.message), |i| match line[i] {
                x if x.is_nan() => Cell::Empty,
                x => Cell::Number(x),
            })?;
        }
        let mut recording = rows.finish(losses)?;
        recording.about = self.about;
        if !self.other_topics.is_empty() {
            recording.notes.push(format!(
                "channels without JSON messages are left out: {}",
                self.other_topics.join(", ")
            ));
        }
        Ok(recording)
    }

    /// Field names; with the topic in front where two channels have the same field.
    fn column_names(&self) -> Vec<String> {
        self.fields
            .iter()
            .map(|(channel, field)| {
                if self.fields.iter().filter(|(_, other)| other == field).count() < 2 {
                    return field.clone();
                }
                let topic = self.topics.get(channel).map_or("", String::as_str);
                format!("{}.{field}", topic.trim_start_matches('/'))
            })
            .collect()
    }
}

/// Size of a chunk before compression, bytes.
const CHUNK_BYTES: u64 = 128 * 1024;

/// Writes rows as JSON messages of one channel; beside it, on request, states and events.
///
/// A chunk is put together in memory and written whole: a file that is cut off at any instant ends with a whole
/// chunk or in the middle of one, which every MCAP reader takes for a torn file and not for a broken one.
pub struct Rows<W: Write + Seek> {
    writer: mcap::Writer<W>,
    channel_id: u16,
    beside: Option<[u16; 2]>,
    origin_ns: u64,
    columns: Vec<String>,
    sequence: u32,
    message: Vec<u8>,
}

impl<W: Write + Seek> Rows<W> {
    pub(super) fn create(topic: &str, columns: &[&str], output: W) -> io::Result<Self> {
        let mut writer = mcap::WriteOptions::new()
            .library(concat!("kort ", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(output)
            .map_err(cause)?;
        let schema = schema(columns).to_string();
        let schema_id =
            writer.add_schema("kort.recording/1", "jsonschema", schema.as_bytes()).map_err(cause)?;
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
        let about = mcap::records::Metadata { name: ABOUT.into(), metadata: about };
        rows.writer.write_metadata(&about).map_err(cause)?;
        let object = br#"{"type":"object"}"#;
        let mut channel = |schema: &str, topic: &str| -> io::Result<u16> {
            let id = rows.writer.add_schema(schema, "jsonschema", object).map_err(cause)?;
            rows.writer.add_channel(id, topic, "json", &BTreeMap::new()).map_err(cause)
        };
        let state = channel(STATE, &format!("{}/state", topic_of(topic)))?;
        let event = channel(EVENT, "/events")?;
        rows.beside = Some([state, event]);
        rows.origin_ns = origin_ns;
        Ok(rows)
    }

    /// A column not sampled in this row is left out of the message.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn row(&mut self, time_s: f64, values: &[f64]) -> io::Result<()> {
        self.message.clear();
        write!(self.message, "{{\"time_s\":")?;
        serde_json::to_writer(&mut self.message, &time_s)?;
        for (name, value) in self.columns.iter().zip(values).filter(|(_, v)| !v.is_nan()) {
            self.message.push(b',');
            serde_json::to_writer(&mut self.message, name)?;
            self.message.push(b':');
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

/// JSON schema of a message, so that Foxglove lists the signals with unit and meaning.
fn schema(columns: &[&str]) -> Value {
    let about = |name: &str| match columns::find(name) {
        Some(known) => format!("{} [{}]", known.meaning, known.unit),
        None => units::of_column(name).map_or("1".into(), |u| u.symbol.to_string()),
    };
    let properties: serde_json::Map<String, Value> = std::iter::once(&"time_s")
        .chain(columns)
        .map(|name| ((*name).to_string(), serde_json::json!({"type": "number", "description": about(name)})))
        .collect();
    serde_json::json!({"type": "object", "title": "kort.recording/1", "properties": properties, "required": ["time_s"]})
}
