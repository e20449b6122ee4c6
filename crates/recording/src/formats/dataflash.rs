//! ArduPilot DataFlash (.bin), from its public description (ardupilot.org, "Logs", and what the format says of itself).
//!
//! A message is two marks, its type and its fields; types, labels, units and multipliers stand in the file as messages
//! of their own. Bytes that are no message are passed over up to the next mark, and counted.

use std::collections::HashMap;
use std::io::BufRead;

use super::stream::{Stream, bytes};
use crate::error::Problem;
use crate::log::{Gather, Log};

/// How a file begins: the description of what describes the others.
pub(super) const MAGIC: &[u8] = &[0xa3, 0x95, 0x80];
const MARK: &[u8] = &[0xa3, 0x95];
pub(crate) const NAME: &str = "ArduPilot DataFlash";
/// Type of the message that describes types.
const FMT: u8 = 0x80;

/// A field of a message.
struct Field {
    code: u8,
    offset: usize,
    label: String,
}

/// What messages of one type look like.
struct Layout {
    name: String,
    length: usize,
    fields: Vec<Field>,
    /// Units and multipliers, a letter a field.
    units: Vec<u8>,
    multipliers: Vec<u8>,
    /// Topics by instance, with the place of each field in them.
    topics: HashMap<Option<u64>, (usize, Vec<Option<usize>>)>,
}

impl Layout {
    /// The field that tells which sensor or motor it is of.
    fn instance(&self) -> Option<&Field> {
        let place = self.units.iter().position(|unit| *unit == b'#');
        let named = || self.fields.get(1).filter(|f| matches!(f.label.as_str(), "Instance" | "Inst" | "I"));
        place.and_then(|place| self.fields.get(place)).or_else(named)
    }
}

/// Length of a field, by the letter of its type.
fn size(code: u8) -> Option<usize> {
    Some(match code {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'e' | b'E' | b'f' | b'L' | b'n' => 4,
        b'q' | b'Q' | b'd' => 8,
        b'N' => 16,
        b'a' | b'Z' => 64,
        _ => return None,
    })
}

/// Factor that a type has in itself: hundredths.
fn scale(code: u8) -> f64 {
    if matches!(code, b'c' | b'C' | b'e' | b'E') { 0.01 } else { 1.0 }
}

/// A number; `None` for texts, lists and what lies beyond the message.
fn number(code: u8, data: &[u8], at: usize) -> Option<f64> {
    let raw = match code {
        b'b' => f64::from(i8::from_le_bytes(bytes(data, at)?)),
        b'B' | b'M' => f64::from(*data.get(at)?),
        b'h' | b'c' => f64::from(i16::from_le_bytes(bytes(data, at)?)),
        b'H' | b'C' => f64::from(u16::from_le_bytes(bytes(data, at)?)),
        b'i' | b'e' => f64::from(i32::from_le_bytes(bytes(data, at)?)),
        b'I' | b'E' => f64::from(u32::from_le_bytes(bytes(data, at)?)),
        // A position in degrees.
        b'L' => f64::from(i32::from_le_bytes(bytes(data, at)?)) * 1e-7,
        b'f' => f64::from(f32::from_le_bytes(bytes(data, at)?)),
        b'd' => f64::from_le_bytes(bytes(data, at)?),
        b'q' => i64::from_le_bytes(bytes(data, at)?) as f64,
        b'Q' => u64::from_le_bytes(bytes(data, at)?) as f64,
        _ => return None,
    };
    Some(raw * scale(code))
}

fn text(data: &[u8]) -> String {
    let end = data.iter().position(|b| *b == 0).unwrap_or(data.len());
    String::from_utf8_lossy(&data[..end]).trim().to_string()
}

struct Reader<'w, R> {
    stream: Stream<R>,
    gather: Gather<'w>,
    layouts: HashMap<u8, Layout>,
    units: HashMap<u8, String>,
    multipliers: HashMap<u8, f64>,
    skipped: u64,
    /// Where the first passed over bytes are.
    skipped_at: u64,
}

/// The whole log.
pub(super) fn log(input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let mut reader = Reader {
        stream: Stream::new(input),
        gather: Gather::new(NAME, "seconds since the board started", wanted),
        layouts: HashMap::from([(
            FMT,
            Layout {
                name: "FMT".into(),
                length: 89,
                fields: Vec::new(),
                units: Vec::new(),
                multipliers: Vec::new(),
                topics: HashMap::new(),
            },
        )]),
        units: HashMap::new(),
        multipliers: HashMap::new(),
        skipped: 0,
        skipped_at: 0,
    };
    while reader.record() {}
    reader.finish()
}

impl<R: BufRead> Reader<'_, R> {
    /// One message; false at the end.
    fn record(&mut self) -> bool {
        let from = self.stream.at();
        let mut head = [0; 3];
        if self.stream.fill(&mut head) < head.len() {
            return false;
        }
        let known = head.starts_with(MARK).then(|| self.layouts.get(&head[2]).map(|l| l.length)).flatten();
        let Some(length) = known else { return self.resume(from, head) };
        let mut data = Vec::new();
        if !self.stream.take(&mut data, length - head.len()) {
            if self.stream.torn().is_none() {
                self.gather.loss(format!("the file ends in a message at byte {from}; what followed is lost"));
            }
            return false;
        }
        match head[2] {
            FMT => self.describe(&data),
            kind => self.message(kind, &data),
        }
        true
    }

    /// Passes over what is no message, up to one that is.
    fn resume(&mut self, from: u64, head: [u8; 3]) -> bool {
        let mut last = head;
        let mut passed = 0;
        let mut empty = true;
        loop {
            if last.starts_with(MARK) && self.layouts.contains_key(&last[2]) {
                break;
            }
            // What a flash chip holds where nothing was written.
            empty &= last[0] == 0xff || last[0] == 0;
            passed += 1;
            let mut byte = [0];
            if self.stream.fill(&mut byte) == 0 {
                if !empty {
                    self.count(from, passed + 2);
                }
                return false;
            }
            last = [last[1], last[2], byte[0]];
        }
        if !empty {
            self.count(from, passed);
        }
        let mut data = Vec::new();
        let length = self.layouts.get(&last[2]).map_or(3, |l| l.length);
        if !self.stream.take(&mut data, length - last.len()) {
            return false;
        }
        match last[2] {
            FMT => self.describe(&data),
            kind => self.message(kind, &data),
        }
        true
    }

    fn count(&mut self, from: u64, passed: u64) {
        if self.skipped == 0 {
            self.skipped_at = from;
        }
        self.skipped += passed;
    }

    /// A type of messages.
    fn describe(&mut self, data: &[u8]) {
        let (Some(kind), Some(length)) = (data.first().copied(), data.get(1).map(|l| usize::from(*l))) else {
            return;
        };
        let (Some(name), Some(codes), Some(labels)) = (data.get(2..6), data.get(6..22), data.get(22..86))
        else {
            return;
        };
        // A type is described once; the first message of a file describes the description.
        if kind == FMT || length < 3 || self.layouts.contains_key(&kind) {
            return;
        }
        let labels = text(labels);
        let mut fields = Vec::new();
        let mut offset = 0;
        for (code, label) in text(codes).bytes().zip(labels.split(',')) {
            let Some(size) = size(code) else { break };
            fields.push(Field { code, offset, label: label.trim().into() });
            offset += size;
        }
        let layout = Layout {
            name: text(name),
            length,
            fields,
            units: Vec::new(),
            multipliers: Vec::new(),
            topics: HashMap::new(),
        };
        self.layouts.insert(kind, layout);
    }

    fn message(&mut self, kind: u8, data: &[u8]) {
        let Some(layout) = self.layouts.get_mut(&kind) else { return };
        let part = |n: usize, length: usize| {
            let at = layout.fields.get(n)?.offset;
            data.get(at..at + length)
        };
        match layout.name.as_str() {
            "UNIT" => {
                if let (Some(id), Some(label)) = (part(1, 1), part(2, 64)) {
                    self.units.insert(id[0], text(label));
                }
                return;
            }
            "MULT" => {
                if let (Some(id), Some(factor)) = (part(1, 1), part(2, 8).and_then(|b| bytes(b, 0))) {
                    self.multipliers.insert(id[0], f64::from_le_bytes(factor));
                }
                return;
            }
            "FMTU" => {
                if let (Some(of), Some(units), Some(multipliers)) = (part(1, 1), part(2, 16), part(3, 16)) {
                    let (of, units, multipliers) = (of[0], text(units), text(multipliers));
                    if let Some(layout) = self.layouts.get_mut(&of) {
                        layout.units = units.into_bytes();
                        layout.multipliers = multipliers.into_bytes();
                    }
                }
                return;
            }
            _ => {}
        }
        let Some(first) = layout.fields.first() else { return };
        let to_s = match (first.label.as_str(), first.code) {
            ("TimeUS", _) | (_, b'Q') => 1e-6,
            ("TimeMS", _) => 1e-3,
            _ => return,
        };
        let Some(stamp) = number(first.code, data, first.offset) else { return };
        let instance = layout.instance().and_then(|f| number(f.code, data, f.offset)).map(|n| n as u64);
        let (topic, places) = layout.topics.entry(instance).or_insert_with(|| {
            let name = match instance {
                Some(number) => format!("{}[{number}]", layout.name),
                None => layout.name.clone(),
            };
            let topic = self.gather.topic(name);
            let places = layout
                .fields
                .iter()
                .enumerate()
                .map(|(n, f)| (n > 0).then(|| self.gather.field(topic, f.label.as_str(), None)))
                .collect();
            (topic, places)
        });
        self.gather.message(*topic, stamp * to_s);
        for (field, place) in layout.fields.iter().zip(places) {
            let Some(place) = place else { continue };
            match number(field.code, data, field.offset) {
                Some(value) => self.gather.set(*topic, *place, value),
                None => self.gather.text(*topic, *place),
            }
        }
    }

    fn finish(mut self) -> Result<Log, Problem> {
        if self.gather.is_empty() {
            let types = self.layouts.len() - 1;
            return Err(Problem::Broken {
                format: NAME,
                message: format!("{types} type(s) described and not one message with a time stamp"),
            });
        }
        for layout in self.layouts.values() {
            for (topic, places) in layout.topics.values() {
                for (n, place) in places.iter().enumerate() {
                    let unit = self.unit(layout, n);
                    if let (Some(place), Some(unit)) = (place, unit) {
                        self.gather.unit(*topic, *place, unit);
                    }
                }
            }
        }
        if let Some(torn) = self.stream.torn() {
            self.gather.loss(torn);
        }
        if self.skipped > 0 {
            self.gather.loss(format!(
                "{} byte(s) are no messages and were passed over, the first at byte {}",
                self.skipped, self.skipped_at
            ));
        }
        Ok(self.gather.finish())
    }

    /// A field's unit with the multiplier that its type does not have in itself, as in `mA`.
    fn unit(&self, layout: &Layout, n: usize) -> Option<String> {
        let label =
            self.units.get(layout.units.get(n)?).filter(|label| !label.is_empty() && *label != "instance")?;
        let factor = layout.multipliers.get(n).and_then(|m| self.multipliers.get(m)).copied().unwrap_or(1.0);
        let own = layout.fields.get(n).map_or(1.0, |f| scale(f.code));
        // No multiplier stands as zero.
        let left = if factor == 0.0 { 1.0 } else { factor / own };
        let near = |wanted: f64| (left / wanted - 1.0).abs() < 1e-6;
        let prefix = [(1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-2, "c"), (1e3, "k")];
        Some(match prefix.iter().find(|(factor, _)| near(*factor)) {
            Some((_, prefix)) => format!("{prefix}{label}"),
            None => format!("{label}*{left}"),
        })
    }
}
