//! candump logs of SocketCAN's can-utils: `(1436509052.249713) can0 185#10270000` (`candump -L`, `-l`) and
//! `(012.249713)  can0  185   [4]  10 27 00 00` (`candump -t a`, `-t z`; with a date `-t A`, since the frame before `-t d`; with the
//! direction before the identifier `-x`).
//!
//! A frame has no fields, only bytes: a source says which of them are a number. `0x185.i16le[2]` is the signed number of 16 bits,
//! least byte first, that begins at byte 2 of the frames with identifier 0x185; an extended identifier has eight digits.

use std::collections::HashMap;
use std::io::BufRead;

use super::stream::bytes;
use crate::dates::Order;
use crate::error::Problem;
use crate::log::{Gather, Log};

pub(crate) const NAME: &str = "candump";
/// A line of candump is shorter; CAN FD has 64 bytes a frame.
const LONGEST: u64 = 4096;
/// Numbers that a survey shows of every frame, at every place where they fit.
const SHOWN: &[(&str, usize)] = &[("u8", 1), ("i16le", 2), ("i16be", 2)];

/// Whether a file begins like a log of candump, or like what candump prints without stamps, which is refused for lack of them.
pub(super) fn begins(start: &[u8]) -> bool {
    let line = start.split(|b| *b == b'\n').next().unwrap_or_default();
    std::str::from_utf8(line).is_ok_and(|line| frame(line.trim()).is_some() || unstamped(line).is_some())
}

/// A frame as a line has it.
struct Frame {
    stamp_s: f64,
    interface: String,
    /// As sources write it.
    id: String,
    data: Vec<u8>,
}

/// A line that is a frame with data; a remote frame has none.
fn frame(line: &str) -> Option<Frame> {
    let (stamp, rest) = line.strip_prefix('(')?.split_once(')')?;
    let stamp = stamp.trim();
    let date_s = || Order::YearFirst.instant_ns(stamp).map(|ns| ns as f64 * 1e-9);
    let stamp_s = stamp.parse::<f64>().ok().filter(|s| s.is_finite()).or_else(date_s)?;
    Some(Frame { stamp_s, ..unstamped(rest)? })
}

/// A frame without its stamp.
fn unstamped(rest: &str) -> Option<Frame> {
    let mut words = rest.split_whitespace();
    let interface = words.next()?.to_owned();
    let mut what = words.next()?;
    if matches!(what, "RX" | "TX") {
        // Two flags follow, each a sign or a letter.
        let flags = [words.next()?, words.next()?];
        what = words.next().filter(|_| flags.iter().all(|flag| matches!(*flag, "-" | "B" | "E")))?;
    }
    let (id, data) = match what.split_once('#') {
        Some((id, data)) => {
            // CAN FD: a second sign, and a digit of flags.
            let data = data.strip_prefix('#').map_or(Some(data), |fd| fd.get(1..))?;
            (id, if data.starts_with('R') { String::new() } else { data.to_string() })
        }
        None => {
            let count = words.next()?.strip_prefix('[')?.strip_suffix(']')?.parse::<usize>().ok()?;
            (what, words.take_while(|word| word.len() == 2).take(count).collect())
        }
    };
    let digits = matches!(id.len(), 3 | 8) && id.bytes().all(|b| b.is_ascii_hexdigit());
    let even = data.len().is_multiple_of(2) && data.bytes().all(|b| b.is_ascii_hexdigit());
    if !digits || !even {
        return None;
    }
    let data = (0..data.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&data[at..at + 2], 16).ok())
        .collect::<Option<_>>()?;
    Some(Frame { stamp_s: f64::NAN, interface, id: format!("0x{}", id.to_uppercase()), data })
}

/// A number within a frame: `i16le[2]`.
struct Number {
    kind: String,
    at: usize,
}

impl Number {
    fn parse(text: &str) -> Option<Self> {
        let (kind, at) = text.strip_suffix(']')?.split_once('[')?;
        let number = Number { kind: kind.into(), at: at.parse().ok().filter(|at| *at < 64)? };
        number.read(&[0; 72]).map(|_| number)
    }

    fn read(&self, data: &[u8]) -> Option<f64> {
        let at = self.at;
        Some(match self.kind.as_str() {
            "u8" => f64::from(*data.get(at)?),
            "i8" => f64::from(*data.get(at)? as i8),
            "u16le" => f64::from(u16::from_le_bytes(bytes(data, at)?)),
            "u16be" => f64::from(u16::from_be_bytes(bytes(data, at)?)),
            "i16le" => f64::from(i16::from_le_bytes(bytes(data, at)?)),
            "i16be" => f64::from(i16::from_be_bytes(bytes(data, at)?)),
            "u32le" => f64::from(u32::from_le_bytes(bytes(data, at)?)),
            "u32be" => f64::from(u32::from_be_bytes(bytes(data, at)?)),
            "i32le" => f64::from(i32::from_le_bytes(bytes(data, at)?)),
            "i32be" => f64::from(i32::from_be_bytes(bytes(data, at)?)),
            "f32le" => f64::from(f32::from_le_bytes(bytes(data, at)?)),
            "f32be" => f64::from(f32::from_be_bytes(bytes(data, at)?)),
            "f64le" => f64::from_le_bytes(bytes(data, at)?),
            "i64le" => i64::from_le_bytes(bytes(data, at)?) as f64,
            "u64le" => u64::from_le_bytes(bytes(data, at)?) as f64,
            _ => return None,
        })
    }
}

/// Frames of one identifier.
struct Topic {
    place: usize,
    numbers: Vec<(usize, Number)>,
    /// Bytes for which a survey has its numbers.
    shown: usize,
}

/// Frames from which it is told what the stamps count from.
const EARLY: usize = 64;

/// Whether stamps are each since the frame before, as `-t d` prints them: they begin at 0 like those of `-t z`, which do not fall.
fn are_steps(frames: &[Frame]) -> bool {
    let stamps_s = || frames.iter().map(|frame| frame.stamp_s);
    let falls = stamps_s().zip(stamps_s().skip(1)).filter(|(before, now)| now < before).count();
    let later: Vec<f64> = stamps_s().skip(1).collect();
    let alike = later.len() > 2 && later[0] > 0.0 && later.iter().all(|stamp_s| *stamp_s == later[0]);
    stamps_s().next() == Some(0.0) && (falls * 10 > frames.len() || alike)
}

/// Frames on their way into a log.
struct Bus<'w> {
    gather: Gather<'w>,
    wanted: Option<&'w [String]>,
    topics: HashMap<(String, String), Topic>,
    /// The first interface on which an identifier comes needs no name.
    first: HashMap<String, String>,
    early: Vec<Frame>,
    /// Whether stamps are each since the frame before, once that is told; then the newest instant.
    steps: Option<bool>,
    now_s: f64,
}

impl Bus<'_> {
    fn take(&mut self, frame: Frame) {
        if self.steps.is_some() {
            return self.put(frame);
        }
        self.early.push(frame);
        if self.early.len() >= EARLY {
            self.tell();
        }
    }

    /// Tells what the stamps count from, and puts in what waited for it.
    fn tell(&mut self) {
        let steps = are_steps(&self.early);
        if steps {
            self.gather.note(
                "the stamps are each since the frame before, as `candump -t d` prints them, and are added up"
                    .into(),
            );
        }
        self.steps = Some(steps);
        for frame in std::mem::take(&mut self.early) {
            self.put(frame);
        }
    }

    fn put(&mut self, frame: Frame) {
        let Self { gather, wanted, topics, first, .. } = self;
        let stamp_s = if self.steps == Some(true) {
            self.now_s += frame.stamp_s;
            self.now_s
        } else {
            frame.stamp_s
        };
        let interface = first.entry(frame.id.clone()).or_insert_with(|| frame.interface.clone());
        let name = if *interface == frame.interface {
            frame.id.clone()
        } else {
            format!("{}:{}", frame.interface, frame.id)
        };
        let topic = topics.entry((frame.interface, frame.id)).or_insert_with(|| {
            let asked: Vec<(&str, &str)> = wanted
                .unwrap_or_default()
                .iter()
                .filter_map(|source| source.split_once('.'))
                .filter(|(of, _)| of.eq_ignore_ascii_case(&name))
                .collect();
            // As the map spells it: hexadecimal has two ways.
            let place = gather.topic(asked.first().map_or(name.as_str(), |(of, _)| of));
            let numbers = asked
                .iter()
                .filter_map(|(_, text)| Some((gather.field(place, *text, None), Number::parse(text)?)));
            Topic { place, numbers: numbers.collect(), shown: 0 }
        });
        if wanted.is_none() && topic.shown < frame.data.len().min(8) {
            show(gather, topic, frame.data.len().min(8));
        }
        gather.message(topic.place, stamp_s);
        for (field, number) in &topic.numbers {
            if let Some(value) = number.read(&frame.data) {
                gather.set(topic.place, *field, value);
            }
        }
    }
}

/// The whole log.
pub(super) fn log(mut input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let mut bus = Bus {
        gather: Gather::new(NAME, "seconds as candump wrote them", wanted),
        wanted,
        topics: HashMap::new(),
        first: HashMap::new(),
        early: Vec::new(),
        steps: None,
        now_s: 0.0,
    };
    let (mut line, mut number, mut bad, mut bad_at) = (Vec::new(), 0_u64, 0_u64, 0_u64);
    loop {
        line.clear();
        let read = std::io::Read::take(&mut input, LONGEST).read_until(b'\n', &mut line);
        match read {
            Ok(0) => break,
            Ok(_) => number += 1,
            Err(e) => {
                bus.gather.loss(format!("the file ends in the middle of its data: {e}"));
                break;
            }
        }
        let text = String::from_utf8_lossy(&line);
        if text.trim().is_empty() {
            continue;
        }
        match frame(text.trim()) {
            Some(frame) => bus.take(frame),
            None => {
                bad += 1;
                bad_at = if bad == 1 { number } else { bad_at };
            }
        }
    }
    if bus.steps.is_none() {
        bus.tell();
    }
    let mut gather = bus.gather;
    if gather.is_empty() {
        return Err(Problem::Broken {
            format: NAME,
            message: format!(
                "not one of {number} line(s) is a frame with a time stamp, as candump prints them without -L, -l or -t a"
            ),
        });
    }
    if bad > 0 {
        gather.loss(format!(
            "{bad} of {number} lines are no frames and were skipped, the first at line {bad_at}"
        ));
    }
    Ok(gather.finish())
}

/// A frame longer than those before has more numbers to show.
fn show(gather: &mut Gather, topic: &mut Topic, length: usize) {
    for (kind, size) in SHOWN {
        let from = (topic.shown + 1).saturating_sub(*size);
        for at in from..=length.saturating_sub(*size) {
            let name = format!("{kind}[{at}]");
            if at + size > topic.shown && at + size <= length {
                let field = gather.field(topic.place, name, None);
                topic.numbers.push((field, Number { kind: (*kind).into(), at }));
            }
        }
    }
    topic.shown = length;
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "(10.000000) can0 181#10270000FFFF\n(10.000500) can0 00000905#0000271000FA00C8\n\
        (10.010000) can0 181#11270000FEFF\n  (010.020000)  can0  181   [6]  12 27 00 00 FD FF   '......'\n\
        (10.025000) can1 181#0100\n(10.030000) can0 181#R\n(10.040000) can0 181##100000000\n(10.05) can0 1";

    #[test]
    fn a_source_says_which_bytes_are_a_number() {
        let wanted = ["0x181.i32le[0]", "0x181.i16le[4]", "0x00000905.i32be[0]", "can1:0x181.u16le[0]"]
            .map(String::from);
        let log = log(LOG.as_bytes(), Some(&wanted)).unwrap();
        let values = |name: &str| {
            let all = log.topics.iter().flat_map(|t| t.fields.iter().map(move |f| (t.source(f), f)));
            let found: Vec<_> = all.filter(|(source, _)| source == name).collect();
            assert_eq!(found.len(), 1, "{name}");
            found[0].1.values.clone()
        };
        assert_eq!(values("0x181.i32le[0]")[..3], [10000.0, 10001.0, 10002.0]);
        assert_eq!(values("0x181.i16le[4]")[..3], [-1.0, -2.0, -3.0]);
        assert!(values("0x181.i16le[4]")[3].is_nan(), "a remote frame has no data");
        assert_eq!(values("0x00000905.i32be[0]"), [10000.0]);
        assert_eq!(values("can1:0x181.u16le[0]"), [1.0]);
        assert_eq!(log.losses.len(), 1, "{:?}", log.losses);
        assert!(log.losses[0].contains("line 8"), "{:?}", log.losses);
    }

    #[test]
    fn a_survey_shows_what_the_bytes_could_be() {
        let log = log(LOG.as_bytes(), None).unwrap();
        let topic = &log.topics[0];
        let names: Vec<&str> = topic.fields.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names.iter().filter(|n| n.starts_with("u8")).count(), 6);
        assert_eq!(names.iter().filter(|n| n.starts_with("i16le")).count(), 5);
        let own = topic.fields.iter().find(|f| f.name == "i16le[4]").unwrap();
        assert_eq!(own.range, Some((-3.0, -1.0)));
        let plain = "  can0  181   [4]  10 27 00 00\n";
        assert!(begins(plain.as_bytes()));
        let refused = super::log(plain.as_bytes(), None).unwrap_err();
        assert!(refused.to_string().contains("time stamp") && refused.hint().contains("-L"), "{refused}");
        assert!(begins(LOG.as_bytes()) && !begins(b"time_s,thrust_n\n0,1\n"));
    }

    /// The same frames as every way of candump to print them has it.
    #[test]
    fn every_kind_of_stamp_and_the_direction_are_read() {
        let frames = |line: &dyn Fn(u32) -> String| {
            let text: String = (0..200).map(|k| line(k) + "\n").collect();
            assert!(begins(text.as_bytes()), "{text}");
            let wanted = ["0x181.u8[0]".to_owned()];
            let log = log(text.as_bytes(), Some(&wanted)).unwrap();
            assert!(log.losses.is_empty(), "{:?}", log.losses);
            let topic = &log.topics[0];
            assert_eq!(topic.fields[0].values.len(), 200);
            assert_eq!(topic.fields[0].values[199], 199.0);
            (topic.stamps_s.iter().map(|stamp_s| stamp_s - topic.stamps_s[0]).collect::<Vec<_>>(), log.notes)
        };
        // Two steps in turn: 10 and 30 ms.
        let at_us = |k: u32| 20_000 * k - 10_000 * (k % 2);
        let data = |k: u32| format!("can0  181   [2]  {k:02X} 00");
        let (plain, notes) = frames(&|k| {
            format!("(176000000{}.{:06}) {}", at_us(k) / 1_000_000, at_us(k) % 1_000_000, data(k))
        });
        assert!(notes.is_empty(), "{notes:?}");
        let same = |other: &[f64]| {
            for (a, b) in plain.iter().zip(other) {
                assert!((a - b).abs() < 1e-5, "{a} {b}");
            }
        };
        let step_us = |k: u32| if k == 0 { 0 } else { at_us(k) - at_us(k - 1) };
        let (steps, notes) = frames(&|k| format!(" (000.{:06})  {}", step_us(k), data(k)));
        same(&steps);
        assert!(notes[0].contains("-t d"), "{notes:?}");
        let (zero, notes) =
            frames(&|k| format!(" (00{}.{:06})  {}", at_us(k) / 1_000_000, at_us(k) % 1_000_000, data(k)));
        same(&zero);
        assert!(notes.is_empty(), "{notes:?}");
        let (dates, _) = frames(&|k| {
            format!(" (2025-10-09 08:53:2{}.{:06})  {}", at_us(k) / 1_000_000, at_us(k) % 1_000_000, data(k))
        });
        same(&dates);
        let (extra, _) = frames(&|k| {
            format!(" (00{}.{:06})  {}", at_us(k) / 1_000_000, at_us(k) % 1_000_000, data(k))
                .replace("can0  ", "can0  RX - -  ")
        });
        same(&extra);
    }
}
