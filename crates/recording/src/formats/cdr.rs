//! ROS 2 messages: their description (`ros2msg`, the text of the .msg files) and their bytes (CDR, version 1, as OMG's DDS-XTypes
//! has it).

use std::collections::HashMap;

use super::stream::bytes;

/// Elements of a list that become fields; of a longer one (an image, a cloud of points) the rest is passed over.
const LISTED: usize = 16;
/// Messages within messages, before a description is taken for a circle.
const DEEPEST: usize = 12;

/// What a field is.
#[derive(Clone, Debug)]
enum Kind {
    /// A number: its size, whether it is signed, whether it is floating.
    Number {
        size: usize,
        signed: bool,
        float: bool,
    },
    /// A text, by the size of its letters.
    Text(usize),
    Message(Vec<(String, Kind)>),
    /// A list of this many, or of as many as it says.
    List(Box<Kind>, Option<usize>),
}

/// How messages of one type lie in memory.
#[derive(Clone, Debug)]
pub(super) struct Layout(Kind);

/// A number or a text within a message, by its name.
pub(super) enum Found<'d> {
    Number(f64),
    /// Its bytes, as CDR has them.
    Text(&'d [u8]),
}

impl Layout {
    /// From the description of a type and of all types in it.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn parse(name: &str, text: &str) -> Result<Self, String> {
        let mut types: HashMap<String, &str> = HashMap::new();
        let mut parts = Vec::new();
        let mut from = 0;
        let mut at = 0;
        for line in text.split_inclusive('\n') {
            if line.trim().len() >= 8 && line.trim().bytes().all(|b| b == b'=') {
                parts.push(&text[from..at]);
                from = at + line.len();
            }
            at += line.len();
        }
        parts.push(&text[from..]);
        let mut parts = parts.into_iter();
        let own = parts.next().unwrap_or_default();
        for part in parts {
            let (head, body) = part.split_once('\n').unwrap_or((part, ""));
            if let Some(name) = head.trim().strip_prefix("MSG:") {
                types.insert(plain(name.trim()), body);
            }
        }
        let package = name.split('/').next().unwrap_or_default();
        message(own, package, &types, 0).map(Layout)
    }

    /// Every number and text of a message.
    ///
    /// # Errors
    /// The message is shorter than its description, or of a kind of CDR that kort does not read.
    pub fn read(&self, data: &[u8], take: &mut impl FnMut(&str, Found)) -> Result<(), &'static str> {
        let big = match data.get(1) {
            Some(0) => true,
            Some(1) => false,
            Some(_) => return Err("not plain CDR"),
            None => return Err("no CDR header"),
        };
        let mut reader = Reader { data: data.get(4..).unwrap_or_default(), at: 0, big, name: String::new() };
        reader.kind(&self.0, take).ok_or("shorter than its description")
    }
}

/// `pkg/msg/Type` and `pkg/Type` are one.
fn plain(name: &str) -> String {
    name.replace("/msg/", "/")
}

fn number(name: &str) -> Option<Kind> {
    let (size, signed, float) = match name {
        "bool" | "byte" | "uint8" | "char" => (1, false, false),
        "int8" => (1, true, false),
        "int16" => (2, true, false),
        "uint16" => (2, false, false),
        "int32" => (4, true, false),
        "uint32" => (4, false, false),
        "int64" => (8, true, false),
        "uint64" => (8, false, false),
        "float32" => (4, true, true),
        "float64" => (8, true, true),
        _ => return None,
    };
    Some(Kind::Number { size, signed, float })
}

fn message(text: &str, package: &str, types: &HashMap<String, &str>, depth: usize) -> Result<Kind, String> {
    if depth > DEEPEST {
        return Err("types within types without end".into());
    }
    let mut fields = Vec::new();
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let Some((kind, rest)) = line.split_once(char::is_whitespace) else { continue };
        let name = rest.split_whitespace().next().unwrap_or_default();
        // A constant is no part of the message.
        if rest.contains('=') && !name.is_empty() && is_constant(rest) {
            continue;
        }
        fields.push((name.to_string(), of_kind(kind, package, types, depth)?));
    }
    if fields.is_empty() {
        // A message without fields has one byte, for languages that need one.
        fields.push((
            "structure_needs_at_least_one_member".into(),
            Kind::Number { size: 1, signed: false, float: false },
        ));
    }
    Ok(Kind::Message(fields))
}

/// `NAME=1` or `NAME = 1`; a default value stands without the sign, and a text may hold one.
fn is_constant(rest: &str) -> bool {
    let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    rest[name.len()..].trim_start().starts_with('=')
}

fn of_kind(kind: &str, package: &str, types: &HashMap<String, &str>, depth: usize) -> Result<Kind, String> {
    if let Some((element, count)) = kind.strip_suffix(']').and_then(|rest| rest.rsplit_once('[')) {
        let element = Box::new(of_kind(element, package, types, depth)?);
        let count = match count {
            "" => None,
            bound if bound.starts_with("<=") => None,
            fixed => Some(fixed.parse().map_err(|_| format!("`{kind}`: no length of a list"))?),
        };
        return Ok(Kind::List(element, count));
    }
    let bare = kind.split("<=").next().unwrap_or(kind);
    match bare {
        "string" => return Ok(Kind::Text(1)),
        "wstring" => return Ok(Kind::Text(2)),
        // Two words of 32 bits, where a description does not spell them out.
        "time" | "duration" | "builtin_interfaces/Time" | "builtin_interfaces/Duration" => {
            let number = |signed| Kind::Number { size: 4, signed, float: false };
            return Ok(Kind::Message(vec![("sec".into(), number(true)), ("nanosec".into(), number(false))]));
        }
        _ => {}
    }
    if let Some(number) = number(bare) {
        return Ok(number);
    }
    let full = plain(bare);
    let within = format!("{package}/{full}");
    let (name, body) = match types.get(&full) {
        Some(body) => (full, body),
        None if full == "Header" => {
            ("std_msgs/Header".into(), types.get("std_msgs/Header").ok_or("`Header` is not described")?)
        }
        None => (within.clone(), types.get(&within).ok_or(format!("`{bare}` is not described"))?),
    };
    message(body, name.split('/').next().unwrap_or_default(), types, depth + 1)
}

struct Reader<'d> {
    data: &'d [u8],
    at: usize,
    big: bool,
    name: String,
}

impl Reader<'_> {
    fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size);
    }

    /// An unsigned number of so many bytes.
    fn raw(&mut self, size: usize) -> Option<u64> {
        self.align(size);
        let at = self.at;
        self.at += size;
        Some(match (size, self.big) {
            (1, _) => u64::from(*self.data.get(at)?),
            (2, false) => u64::from(u16::from_le_bytes(bytes(self.data, at)?)),
            (2, true) => u64::from(u16::from_be_bytes(bytes(self.data, at)?)),
            (4, false) => u64::from(u32::from_le_bytes(bytes(self.data, at)?)),
            (4, true) => u64::from(u32::from_be_bytes(bytes(self.data, at)?)),
            (_, false) => u64::from_le_bytes(bytes(self.data, at)?),
            (_, true) => u64::from_be_bytes(bytes(self.data, at)?),
        })
    }

    fn number(&mut self, size: usize, signed: bool, float: bool) -> Option<f64> {
        let raw = self.raw(size)?;
        Some(match (size, signed, float) {
            (4, _, true) => f64::from(f32::from_bits(raw as u32)),
            (_, _, true) => f64::from_bits(raw),
            (_, false, _) => raw as f64,
            (1, ..) => f64::from(raw as u8 as i8),
            (2, ..) => f64::from(raw as u16 as i16),
            (4, ..) => f64::from(raw as u32 as i32),
            _ => raw as i64 as f64,
        })
    }

    fn kind(&mut self, kind: &Kind, take: &mut dyn FnMut(&str, Found)) -> Option<()> {
        match kind {
            Kind::Number { size, signed, float } => {
                let value = self.number(*size, *signed, *float)?;
                take(&self.name, Found::Number(value));
            }
            Kind::Text(letter) => {
                let length = usize::try_from(self.raw(4)?).ok()?.checked_mul(*letter)?;
                let from = self.at;
                self.pass(length)?;
                take(&self.name, Found::Text(self.data.get(from..self.at)?));
            }
            Kind::Message(fields) => {
                let before = self.name.len();
                for (name, kind) in fields {
                    if before > 0 {
                        self.name.push('.');
                    }
                    self.name.push_str(name);
                    self.kind(kind, take)?;
                    self.name.truncate(before);
                }
            }
            Kind::List(element, count) => {
                let count = match count {
                    Some(count) => *count,
                    None => usize::try_from(self.raw(4)?).ok()?,
                };
                self.list(element, count, take)?;
            }
        }
        Some(())
    }

    fn list(&mut self, element: &Kind, count: usize, take: &mut dyn FnMut(&str, Found)) -> Option<()> {
        let before = self.name.len();
        for k in 0..count {
            if k >= LISTED {
                match element {
                    Kind::Number { size, .. } => return self.pass(size.checked_mul(count - k)?),
                    // No element is shorter than a byte: a count beyond the message is broken.
                    _ if count > self.data.len() => return None,
                    _ => self.kind(element, &mut |_: &str, _| ())?,
                }
                continue;
            }
            self.name.push_str(&format!("[{k}]"));
            self.kind(element, take)?;
            self.name.truncate(before);
        }
        Some(())
    }

    fn pass(&mut self, length: usize) -> Option<()> {
        self.at = self.at.checked_add(length).filter(|at| *at <= self.data.len())?;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ESC: &str = "\
# a speed controller
std_msgs/Header header
uint8 ARMED=1
bool armed
float64 speed_rad_s   # shaft
int16[3] raw
string name \"esc\"
float32[] phases
Temperature motor
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: drive_msgs/Temperature
float32 celsius
";

    fn put(out: &mut Vec<u8>, bytes: &[u8]) {
        // After the four bytes of the header.
        while !(out.len() - 4).is_multiple_of(bytes.len()) {
            out.push(0);
        }
        out.extend(bytes);
    }

    fn text(out: &mut Vec<u8>, text: &str) {
        put(out, &(text.len() as u32 + 1).to_le_bytes());
        out.extend(text.as_bytes());
        out.push(0);
    }

    fn sample() -> Vec<u8> {
        let mut out = vec![0, 1, 0, 0];
        put(&mut out, &12_i32.to_le_bytes());
        put(&mut out, &500_u32.to_le_bytes());
        text(&mut out, "base");
        out.push(1);
        put(&mut out, &(-3.5_f64).to_le_bytes());
        for raw in [-1_i16, 2, 300] {
            put(&mut out, &raw.to_le_bytes());
        }
        text(&mut out, "left");
        put(&mut out, &2_u32.to_le_bytes());
        put(&mut out, &1.5_f32.to_le_bytes());
        put(&mut out, &2.5_f32.to_le_bytes());
        put(&mut out, &40.0_f32.to_le_bytes());
        out
    }

    fn numbers(layout: &Layout, data: &[u8]) -> Result<Vec<(String, f64)>, &'static str> {
        let mut found = Vec::new();
        layout.read(data, &mut |name: &str, value| {
            if let Found::Number(value) = value {
                found.push((name.to_string(), value));
            }
        })?;
        Ok(found)
    }

    #[test]
    fn a_message_lies_as_its_description_says() {
        let layout = Layout::parse("drive_msgs/msg/Esc", ESC).unwrap();
        let found = numbers(&layout, &sample()).unwrap();
        let wanted = [
            ("header.stamp.sec", 12.0),
            ("header.stamp.nanosec", 500.0),
            ("armed", 1.0),
            ("speed_rad_s", -3.5),
            ("raw[0]", -1.0),
            ("raw[1]", 2.0),
            ("raw[2]", 300.0),
            ("phases[0]", 1.5),
            ("phases[1]", 2.5),
            ("motor.celsius", 40.0),
        ];
        let wanted: Vec<(String, f64)> =
            wanted.iter().map(|(name, value)| ((*name).into(), *value)).collect();
        assert_eq!(found, wanted);
        let whole = sample();
        for end in 0..whole.len() {
            assert!(numbers(&layout, &whole[..end]).is_err(), "cut off after {end}");
        }
    }

    #[test]
    fn what_is_not_described_or_has_no_end_is_refused() {
        assert!(Layout::parse("a/msg/B", "Missing m\n").unwrap_err().contains("Missing"));
        assert!(Layout::parse("a/msg/B", "B b\n========\nMSG: a/B\nB b\n").is_err());
        assert!(Layout::parse("a/msg/B", "float64[x] b\n").is_err());
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(text in "((float64|string|int8\\[\\]|uint64\\[3\\]|wstring|Header) [a-z]{1,3}(=3)?\n){0,6}", data in proptest::collection::vec(0_u8..12, 0..80)) {
            for text in [text.as_str(), ESC] {
                if let Ok(layout) = Layout::parse("drive_msgs/msg/Esc", text) {
                    let _ = numbers(&layout, &data);
                }
            }
        }
    }
}
