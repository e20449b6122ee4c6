//! PX4 ULog, version 1, from its public description (docs.px4.io, "ULog File Format").
//!
//! Formats and subscriptions stand in the file; every logged message begins with a time stamp in microseconds since the
//! board started. Where a record cannot be one, what follows is passed over up to the next synchronisation
//! mark or the next message of a subscription, whichever comes first: many logs have no marks.

use std::collections::HashMap;
use std::io::BufRead;

use super::stream::{Stream, bytes};
use crate::error::Problem;
use crate::log::{Gather, Log};

/// How a file begins, before version and start time.
pub(super) const MAGIC: &[u8] = &[0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35];
const SYNC: &[u8] = &[0x08, 0x00, b'S', 0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
pub(crate) const NAME: &str = "PX4 ULog";
/// A message's data are at most this long, so no format may describe more.
const LONGEST: usize = u16::MAX as usize;
/// Formats within formats, before a description is taken for a circle.
const DEEPEST: usize = 12;

/// A number within a message.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Bool,
    Char,
}

impl Type {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "int8_t" => Type::I8,
            "uint8_t" => Type::U8,
            "int16_t" => Type::I16,
            "uint16_t" => Type::U16,
            "int32_t" => Type::I32,
            "uint32_t" => Type::U32,
            "int64_t" => Type::I64,
            "uint64_t" => Type::U64,
            "float" => Type::F32,
            "double" => Type::F64,
            "bool" => Type::Bool,
            "char" => Type::Char,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Type::I8 | Type::U8 | Type::Bool | Type::Char => 1,
            Type::I16 | Type::U16 => 2,
            Type::I32 | Type::U32 | Type::F32 => 4,
            Type::I64 | Type::U64 | Type::F64 => 8,
        }
    }

    fn read(self, data: &[u8], at: usize) -> Option<f64> {
        Some(match self {
            Type::I8 => f64::from(i8::from_le_bytes(bytes(data, at)?)),
            Type::U8 | Type::Bool | Type::Char => f64::from(*data.get(at)?),
            Type::I16 => f64::from(i16::from_le_bytes(bytes(data, at)?)),
            Type::U16 => f64::from(u16::from_le_bytes(bytes(data, at)?)),
            Type::I32 => f64::from(i32::from_le_bytes(bytes(data, at)?)),
            Type::U32 => f64::from(u32::from_le_bytes(bytes(data, at)?)),
            Type::I64 => i64::from_le_bytes(bytes(data, at)?) as f64,
            Type::U64 => u64::from_le_bytes(bytes(data, at)?) as f64,
            Type::F32 => f64::from(f32::from_le_bytes(bytes(data, at)?)),
            Type::F64 => f64::from_le_bytes(bytes(data, at)?),
        })
    }
}

/// One number of a message, and where it stands.
struct Number {
    kind: Type,
    offset: usize,
    /// Its field in the topic; none for the stamp and for filling bytes.
    field: Option<usize>,
}

/// What messages of one subscription look like.
struct Layout {
    topic: usize,
    stamp: usize,
    /// How long they are, and without the filling bytes at their end, which are not written.
    size: usize,
    size_written: usize,
    numbers: Vec<Number>,
}

struct Reader<'w, R> {
    stream: Stream<R>,
    gather: Gather<'w>,
    formats: HashMap<String, String>,
    subscribed: HashMap<u16, Layout>,
    /// Where appended data begin: a record cut off before such a place ends there.
    appended: Vec<u64>,
    dropouts: u64,
    dropped_ms: u64,
    /// Bytes passed over, and records that fit no format.
    skipped: u64,
    bad: u64,
}

/// The whole log.
pub(super) fn log(input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let mut stream = Stream::new(input);
    let mut start = [0; 16];
    let got = stream.fill(&mut start);
    if got < start.len() {
        return Err(broken(format!("the header has {got} of 16 bytes")));
    }
    let mut reader = Reader {
        stream,
        gather: Gather::new(NAME, "seconds since the board started", wanted),
        formats: HashMap::new(),
        subscribed: HashMap::new(),
        appended: Vec::new(),
        dropouts: 0,
        dropped_ms: 0,
        skipped: 0,
        bad: 0,
    };
    while reader.record() {}
    reader.finish()
}

/// Whether a message of a subscription lies ahead: its letter, its number, and the length that its format has.
fn begins_message(ahead: &[u8], subscribed: &HashMap<u16, Layout>) -> bool {
    let number = |at| bytes(ahead, at).map(u16::from_le_bytes);
    let (Some(size), Some(b'D'), Some(id)) = (number(0), ahead.get(2), number(3)) else { return false };
    let long = usize::from(size);
    subscribed.get(&id).is_some_and(|layout| (layout.size_written + 2..=layout.size + 2).contains(&long))
}

fn broken(message: String) -> Problem {
    Problem::Broken { format: NAME, message }
}

impl<R: BufRead> Reader<'_, R> {
    /// One record; false at the end.
    fn record(&mut self) -> bool {
        let mut data = Vec::new();
        let from = self.stream.at();
        if let Some(place) = self.next_appended(from, 3) {
            return self.pass_to(place);
        }
        let mut head = [0; 3];
        let got = self.stream.fill(&mut head);
        if got < head.len() {
            return got > 0 && self.ends_in(from);
        }
        let size = usize::from(u16::from_le_bytes([head[0], head[1]]));
        if !b"BFIMPQARDLCSO".contains(&head[2]) {
            self.stream.put_back(&head[1..]);
            let subscribed = &self.subscribed;
            let whole = |ahead: &[u8]| ahead == SYNC || begins_message(ahead, subscribed);
            let (passed, found) = self.stream.seek(SYNC.len(), whole);
            self.skipped += passed + 1;
            return found;
        }
        if let Some(place) = self.next_appended(from, 3 + size) {
            return self.pass_to(place);
        }
        if !self.stream.take(&mut data, size) {
            return self.ends_in(from);
        }
        self.take(head[2], &data);
        true
    }

    /// A place with appended data that a record of this length would run over.
    fn next_appended(&self, from: u64, size: usize) -> Option<u64> {
        self.appended.iter().copied().find(|place| from < *place && *place < from + size as u64)
    }

    fn pass_to(&mut self, place: u64) -> bool {
        let left = place - self.stream.at().min(place);
        let passed = self.stream.skip(left);
        self.skipped += passed;
        passed == left
    }

    /// The file ends in the record that begins here; false, as at every end.
    fn ends_in(&mut self, from: u64) -> bool {
        if self.stream.torn().is_none() {
            self.gather.loss(format!("the file ends in a record at byte {from}; what followed is lost"));
        }
        false
    }

    fn take(&mut self, kind: u8, data: &[u8]) {
        match kind {
            b'B' => {
                let places = (16..40).step_by(8).filter_map(|at| bytes(data, at).map(u64::from_le_bytes));
                self.appended = places.filter(|place| *place > 0).collect();
                self.appended.sort_unstable();
            }
            b'F' => {
                let text = String::from_utf8_lossy(data);
                if let Some((name, fields)) = text.split_once(':') {
                    self.formats.insert(name.trim().into(), fields.into());
                }
            }
            b'I' => self.info(data),
            b'A' => self.subscribe(data),
            b'D' => self.bad += u64::from(self.message(data).is_none()),
            b'O' => {
                self.dropouts += 1;
                self.dropped_ms += bytes(data, 0).map_or(0, |b| u64::from(u16::from_le_bytes(b)));
            }
            _ => {}
        }
    }

    /// Who wrote the log.
    fn info(&mut self, data: &[u8]) {
        let Some((length, rest)) = data.split_first() else { return };
        let Some((key, value)) = rest.split_at_checked(usize::from(*length)) else { return };
        let key = String::from_utf8_lossy(key);
        let Some((kind, name)) = key.split_once(' ') else { return };
        if kind.starts_with("char") && matches!(name, "sys_name" | "ver_hw" | "ver_sw_release") {
            let value = String::from_utf8_lossy(value)
                .chars()
                .filter(|c| !c.is_control())
                .take(60)
                .collect::<String>();
            self.gather.note(format!("{name}: {value}"));
        }
    }

    fn subscribe(&mut self, data: &[u8]) {
        let (Some(instance), Some(id)) = (data.first().copied(), bytes(data, 1).map(u16::from_le_bytes))
        else {
            self.bad += 1;
            return;
        };
        let name = String::from_utf8_lossy(&data[3..]).into_owned();
        let mut flat = Vec::new();
        let mut offset = 0;
        if self.flatten(&name, "", &mut offset, &mut flat, 0).is_none() {
            self.bad += 1;
            return;
        }
        let Some(stamp) =
            flat.iter().find(|(n, kind, _)| n == "timestamp" && *kind == Type::U64).map(|f| f.2)
        else {
            self.bad += 1;
            return;
        };
        let filling = flat.iter().rev().take_while(|(name, _, _)| name.contains("_padding"));
        let size_written = filling.last().map_or(offset, |(_, _, at)| *at);
        let topic = self.gather.topic(if instance == 0 { name } else { format!("{name}[{instance}]") });
        let numbers = flat
            .into_iter()
            .map(|(name, kind, offset)| {
                let plain = name == "timestamp" || name.contains("_padding");
                Number { kind, offset, field: (!plain).then(|| self.gather.field(topic, name, None)) }
            })
            .collect();
        self.subscribed.insert(id, Layout { topic, stamp, size: offset, size_written, numbers });
    }

    /// The numbers of a format and those within it, with their offsets; `None` for a format that cannot be.
    fn flatten(
        &self,
        format: &str,
        prefix: &str,
        offset: &mut usize,
        out: &mut Vec<(String, Type, usize)>,
        depth: usize,
    ) -> Option<()> {
        if depth > DEEPEST {
            return None;
        }
        for field in self.formats.get(format)?.split(';').map(str::trim).filter(|f| !f.is_empty()) {
            let (kind, name) = field.split_once(' ')?;
            let (kind, count) = match kind.split_once('[') {
                Some((kind, count)) => (kind, count.strip_suffix(']')?.parse::<usize>().ok()?),
                None => (kind, 1),
            };
            let list = field.split_once(' ')?.0.contains('[');
            for k in 0..count {
                let name = if list { format!("{prefix}{name}[{k}]") } else { format!("{prefix}{name}") };
                match Type::of(kind) {
                    // A text is one field, not a hundred numbers.
                    Some(Type::Char) if list => {
                        out.push((format!("{prefix}{}", field.split_once(' ')?.1), Type::Char, *offset));
                        *offset += count;
                        break;
                    }
                    Some(kind) => {
                        out.push((name, kind, *offset));
                        *offset += kind.size();
                    }
                    None => self.flatten(kind, &format!("{name}."), offset, out, depth + 1)?,
                }
                if *offset > LONGEST {
                    return None;
                }
            }
        }
        Some(())
    }

    fn message(&mut self, data: &[u8]) -> Option<()> {
        let id = u16::from_le_bytes(bytes(data, 0)?);
        let layout = self.subscribed.get(&id)?;
        let data = &data[2..];
        let stamp_us = u64::from_le_bytes(bytes(data, layout.stamp)?);
        self.gather.message(layout.topic, stamp_us as f64 * 1e-6);
        for number in &layout.numbers {
            let Some(field) = number.field else { continue };
            if number.kind == Type::Char {
                self.gather.text(layout.topic, field);
            } else if let Some(value) = number.kind.read(data, number.offset) {
                self.gather.set(layout.topic, field, value);
            }
        }
        Some(())
    }

    fn finish(mut self) -> Result<Log, Problem> {
        if self.gather.is_empty() {
            let formats = self.formats.len();
            return Err(broken(format!("{formats} format(s) and not one message that fits them")));
        }
        if self.dropouts > 0 {
            self.gather.note(format!(
                "the logger itself missed {} stretch(es), {:.3} s together",
                self.dropouts,
                self.dropped_ms as f64 * 1e-3
            ));
        }
        if let Some(torn) = self.stream.torn() {
            self.gather.loss(torn);
        }
        if self.skipped > 0 {
            self.gather.loss(format!("{} byte(s) are no records and were passed over", self.skipped));
        }
        if self.bad > 0 {
            self.gather.loss(format!("{} record(s) fit no format and were skipped", self.bad));
        }
        Ok(self.gather.finish())
    }
}
