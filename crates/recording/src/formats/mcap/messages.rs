//! An MCAP file as a log of messages: every channel a topic, its numbers as fields, stamped with the log time.

use std::collections::{BTreeMap, HashMap};
use std::io::Read;

use mcap::records::{MessageHeader, Record};
use serde_json::Value;

use super::super::cdr::Layout;
use super::super::ros::Topic;
use super::super::{ZSTD, ZSTD_MESSAGES};
use super::records;
use super::schemas::BESIDE;
use crate::error::Problem;
use crate::log::{Gather, Log};

/// A channel, by how its messages become fields.
enum Channel {
    Json { topic: usize, places: HashMap<String, usize> },
    Cdr(Topic),
}

struct Messages<'w> {
    gather: Gather<'w>,
    /// Name, encoding and text.
    schemas: HashMap<u16, (String, String, Vec<u8>)>,
    channels: HashMap<u16, Channel>,
    others: Vec<String>,
    /// Log time of the first message: a day of nanoseconds since 1970 leaves a double too few digits.
    start_ns: Option<u64>,
    messages: u64,
    bad: u64,
}

/// The messages of every channel that can be read.
pub(in crate::formats) fn log(input: impl Read, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let mut all = Messages {
        gather: Gather::new("MCAP", "log times from the first message on", wanted),
        schemas: HashMap::new(),
        channels: HashMap::new(),
        others: Vec::new(),
        start_ns: None,
        messages: 0,
        bad: 0,
    };
    let damage = records(input, |record| all.take(record))?;
    for loss in damage.losses(all.messages)? {
        all.gather.loss(loss);
    }
    if all.bad > 0 {
        all.gather.loss(format!("{} message(s) do not fit their schema and were skipped", all.bad));
    }
    let channels: BTreeMap<_, _> = all.channels.iter().collect();
    for channel in channels.into_values() {
        if let Channel::Cdr(topic) = channel {
            all.gather.losses(topic.losses());
        }
    }
    if !all.others.is_empty() {
        all.gather.note(format!(
            "channels whose encoding kort does not read are left out: {}",
            all.others.join(", ")
        ));
    }
    if all.channels.is_empty() {
        let found = if all.others.is_empty() { "none".into() } else { all.others.join(", ") };
        return Err(Problem::NoChannel { found });
    }
    Ok(all.gather.finish())
}

impl Messages<'_> {
    fn take(&mut self, record: Record<'_>) -> Result<(), Problem> {
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                // A chunk's channels stand again at the end of the file.
                if self.channels.contains_key(&channel.id)
                    || schema.is_some_and(|s| BESIDE.contains(&s.0.as_str()))
                {
                    return Ok(());
                }
                let name = channel.topic.trim_start_matches('/');
                let read = match (channel.message_encoding.as_str(), schema) {
                    ("json", _) => {
                        Ok(Channel::Json { topic: self.gather.topic(name), places: HashMap::new() })
                    }
                    ("cdr", Some((kind, encoding, text))) if encoding == "ros2msg" => {
                        Layout::parse(kind, &String::from_utf8_lossy(text))
                            .map(|layout| Channel::Cdr(Topic::new(&mut self.gather, name, layout)))
                    }
                    (other, schema) => {
                        let described = schema.map_or("no schema", |s| s.1.as_str());
                        Err(format!("{other}, {described}"))
                    }
                };
                match read {
                    Ok(read) => drop(self.channels.insert(channel.id, read)),
                    Err(why) => {
                        let words = format!("{} ({why})", channel.topic);
                        if !self.others.contains(&words) {
                            self.others.push(words);
                        }
                    }
                }
            }
            Record::Message { data, .. } if data.starts_with(ZSTD) => return Err(ZSTD_MESSAGES),
            Record::Message { header, data } => self.message(&header, &data),
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8]) {
        let Some(channel) = self.channels.get_mut(&header.channel_id) else { return };
        self.messages += 1;
        let start_ns = *self.start_ns.get_or_insert(header.log_time);
        let stamp_s = (i128::from(header.log_time) - i128::from(start_ns)) as f64 * 1e-9;
        let read = match channel {
            Channel::Json { topic, places } => match serde_json::from_slice(data) {
                Ok(Value::Object(fields)) => {
                    self.gather.message(*topic, stamp_s);
                    for (name, value) in fields {
                        json(&mut self.gather, *topic, places, name, &value);
                    }
                    true
                }
                _ => false,
            },
            Channel::Cdr(topic) => topic.message(&mut self.gather, stamp_s, data),
        };
        self.bad += u64::from(!read);
    }
}

/// A field's place in its topic; the first time it comes it gets one.
fn place(gather: &mut Gather, topic: usize, places: &mut HashMap<String, usize>, name: &str) -> usize {
    if let Some(place) = places.get(name) {
        return *place;
    }
    let place = gather.field(topic, name, None);
    places.insert(name.into(), place);
    place
}

/// Numbers and switches are fields; nested objects are joined with a dot; lists are no signals.
fn json(gather: &mut Gather, topic: usize, places: &mut HashMap<String, usize>, name: String, value: &Value) {
    if let Value::Object(fields) = value {
        for (inner, value) in fields {
            json(gather, topic, places, format!("{name}.{inner}"), value);
        }
        return;
    }
    let number = match value {
        Value::Number(n) => n.as_f64(),
        Value::Bool(b) => Some(f64::from(u8::from(*b))),
        _ => None,
    };
    if number.is_none() && !value.is_string() {
        return;
    }
    let field = place(gather, topic, places, &name);
    match number {
        Some(number) => gather.set(topic, field, number),
        None => gather.text(topic, field),
    }
}
