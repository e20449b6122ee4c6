//! Messages of JSON as rows over (channel, field) columns.

use std::collections::BTreeMap;

use mcap::records::Record;
use serde_json::Value;

use super::ABOUT;
use super::schemas::BESIDE;
use crate::assemble::Assembler;
use crate::cell::Cell;
use crate::error::{Place, Problem};
use crate::map::ColumnMap;
use crate::recording::Recording;

/// Messages as rows over (channel, field) columns.
#[derive(Default)]
pub(super) struct Table {
    topics: BTreeMap<u16, String>,
    other_topics: Vec<String>,
    schemas: BTreeMap<u16, String>,
    about: BTreeMap<String, String>,
    fields: Vec<(u16, String)>,
    places: BTreeMap<(u16, String), usize>,
    pub(super) rows: Vec<Row>,
    pub(super) messages: u64,
    pub(super) bad_messages: u64,
}

/// Numbers of one instant, by field.
pub(super) struct Row {
    log_time_ns: u64,
    message: u64,
    cells: Vec<(usize, f64)>,
}

impl Table {
    pub(super) fn take(&mut self, record: Record<'_>) -> Result<(), Problem> {
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

    pub(super) fn assemble(
        mut self,
        name: &str,
        map: Option<&ColumnMap>,
        losses: Vec<String>,
    ) -> Result<Recording, Problem> {
        if self.messages == 0 && !self.topics.is_empty() {
            return Err(Problem::TooFewRows { found: 0 });
        }
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
