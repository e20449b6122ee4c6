//! An instrument that prints lines of numbers on a serial port: a force cell's amplifier, a flow meter, a thermometer.
//!
//! A line is taken apart at its separators ([`columns`]), or by a regular expression whose groups are the columns
//! (crate `regex`, whose matching time is bounded; own parsing would be a worse language of the same kind). Each column's unit
//! must be given; a line in which any wanted column is no number, or one that cannot be, is no reading. Nor is one, where
//! separators part it, in which another unit follows the number: the instrument was switched at its front. Instruments that
//! speak only when asked are sent `ask`.

use std::path::PathBuf;

use kort_proto::signals::{SIGNALS, Signals};
use regex::Regex;

use super::Channel;
use super::units::printed;
use crate::link::{Ages, Heard, Lines, Protocol};

/// Lines without a reading before the reason is said: the first one after opening is often torn.
const BAD_LINES: u32 = 3;

/// An instrument as the configuration describes it.
#[derive(Clone, Debug)]
pub struct SerialLine {
    /// The device.
    pub port: PathBuf,
    /// Bits a second.
    pub baud: u32,
    /// How a line is taken apart; at separators without.
    pub pattern: Option<Regex>,
    /// Sent to have a line printed; empty for an instrument that prints by itself.
    pub ask: String,
    /// How often it is asked, Hz.
    pub rate_hz: f64,
    /// Which column is which signal.
    pub channels: Vec<Channel<Column>>,
}

/// A column of a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its place, from one.
    pub number: usize,
    /// The unit that may follow it; none where the scale makes of it what it will: then the first that does.
    pub unit: Option<&'static str>,
}

/// Listening to an instrument.
pub struct Listening {
    instrument: SerialLine,
    lines: Lines,
    known: bool,
    bad: u32,
}

impl Listening {
    /// Before the first line.
    pub fn new(instrument: SerialLine) -> Self {
        Self { instrument, lines: Lines::default(), known: false, bad: 0 }
    }

    /// The reading in a line, or which column is none.
    fn read(&mut self, line: &str) -> Result<Signals, String> {
        let groups = match &self.instrument.pattern {
            Some(pattern) => Some(pattern.captures(line).ok_or("does not match `pattern`")?),
            None => None,
        };
        let fields = if groups.is_none() { columns(line)? } else { Vec::new() };
        let mut signals = Signals::UNKNOWN;
        for channel in &mut self.instrument.channels {
            let at = channel.from.number;
            let text = match &groups {
                Some(groups) => groups.get(at).map(|group| group.as_str()),
                None => at.checked_sub(1).and_then(|at| fields.get(at)).map(String::as_str),
            };
            let value = text.and_then(number).ok_or_else(|| format!("has no number in column {at}"))?;
            let Some(signal) = SIGNALS.get(channel.place) else { continue };
            if let Some(unit) = fields.get(at).and_then(|word| printed(word, signal.unit)) {
                let expected = *channel.from.unit.get_or_insert(unit);
                if unit != expected {
                    return Err(format!("has {unit} after column {at}, and {expected} is expected"));
                }
            }
            let si = channel.si(value);
            (signal.set)(&mut signals, si.map_err(|words| format!("in column {at} {words}"))?);
        }
        Ok(signals)
    }
}

/// The number in a text that is nothing else: its decimal sign is a point, or a single comma.
fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let plain = if is_with_comma(text) { text.replace(',', ".") } else { text.to_owned() };
    plain.parse::<f64>().ok().filter(|value| value.is_finite())
}

/// One comma and no point: it may be the decimal sign.
fn is_with_comma(text: &str) -> bool {
    let between_digits = |(left, right): (&str, &str)| {
        left.ends_with(|c: char| c.is_ascii_digit()) && right.starts_with(|c: char| c.is_ascii_digit())
    };
    !text.contains('.') && text.matches(',').count() == 1 && text.split_once(',').is_some_and(between_digits)
}

/// The columns of a line. Semicolon, tab and blank separate, and so does a comma beside one of them. A comma within what is left is
/// a decimal one where something else separates numbers; where only commas stand they separate.
///
/// # Errors
/// A comma that may be either, in words.
fn columns(line: &str) -> Result<Vec<String>, &'static str> {
    const EITHER: &str = "has commas that may be decimal signs or separate: give `pattern`";
    let separates = |c: char| c == ';' || c.is_whitespace();
    let parts: Vec<&str> = line.split(separates).filter(|part| !part.is_empty()).collect();
    let bare = |part: &&str| part.trim_matches(',').to_owned();
    let fields = || parts.iter().map(bare).filter(|part| !part.is_empty());
    let with_comma: Vec<String> = fields().filter(|field| field.contains(',')).collect();
    if with_comma.is_empty() {
        return Ok(fields().collect());
    }
    let at_commas = || {
        Ok(line.split(|c| c == ',' || separates(c)).filter(|f| !f.is_empty()).map(str::to_owned).collect())
    };
    if parts.len() == 1 {
        return at_commas();
    }
    let decimal = with_comma.iter().filter(|field| is_with_comma(field)).count();
    let stands_beside = parts.iter().any(|part| part.starts_with(',') || part.ends_with(','));
    let strong = line.trim().contains([';', '\t']);
    let numbers = fields().filter(|field| number(field).is_some()).count();
    if decimal == with_comma.len() && !stands_beside && (strong || numbers > 1) {
        return Ok(fields().map(|field| field.replace(',', ".")).collect());
    }
    // With a point, or a second comma, it is none of a number's.
    if decimal == 0 && !strong { at_commas() } else { Err(EITHER) }
}

impl Protocol for Listening {
    fn begin(&mut self) {
        *self = Self::new(self.instrument.clone());
    }

    fn ask(&mut self, out: &mut Vec<u8>, _: &mut dyn FnMut(Heard)) {
        out.extend(self.instrument.ask.as_bytes());
    }

    fn tell(&mut self, _: Option<f64>, _: bool, out: &mut Vec<u8>) {
        out.extend(self.instrument.ask.as_bytes());
    }

    fn ages(&self) -> Ages {
        Ages::Unknown
    }

    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard)) {
        for line in self.lines.take(bytes) {
            match self.read(&line) {
                Ok(signals) => {
                    self.bad = 0;
                    if !self.known {
                        self.known = true;
                        heard(Heard::Guarded(format!("prints `{}`", line.trim())));
                    }
                    heard(Heard::Reading(signals));
                }
                Err(words) => {
                    self.bad = self.bad.saturating_add(1);
                    if self.bad == BAD_LINES {
                        self.known = false;
                        heard(Heard::Unguarded(format!(
                            "the line `{}` {words}\nhint: compare `signals` and `pattern` with what it prints; baud rate?",
                            line.trim()
                        )));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::place;
    use proptest::prelude::*;

    fn force(pattern: Option<&str>, number: usize) -> Listening {
        Listening::new(SerialLine {
            port: PathBuf::new(),
            baud: 9600,
            pattern: pattern.map(|p| Regex::new(p).unwrap()),
            ask: String::new(),
            rate_hz: 10.0,
            channels: vec![Channel {
                from: Column { number, unit: Some("kgf") },
                place: place("thrust_n").unwrap(),
                scale: -9.80665,
                offset: 0.5,
                most: 1000.0,
            }],
        })
    }

    fn thrusts(listening: &mut Listening, chunks: &[&[u8]]) -> Vec<f64> {
        let mut found = Vec::new();
        for chunk in chunks {
            listening.hear(chunk, &mut |heard| {
                if let Heard::Reading(signals) = heard {
                    found.push(signals.thrust_n);
                }
            });
        }
        found
    }

    #[test]
    fn columns_and_groups_are_read_with_sign_scale_and_offset() {
        let expected = -2.5 * 9.80665 + 0.5;
        assert_eq!(thrusts(&mut force(None, 2), &[b"12.0, 2", b".5;x\r\n"]), [expected]);
        let pattern = r"F=([-+.\d]+) kg";
        assert_eq!(thrusts(&mut force(Some(pattern), 1), &[b"t=1 F=2.5 kg\n"]), [expected]);
        assert!(thrusts(&mut force(None, 2), &[b"12.0\n12.0,err\n,,\n12,nan\n12,inf\n"]).is_empty());
    }

    /// Where something else separates a comma is decimal; where only commas stand they separate; else it is asked for.
    #[test]
    fn a_comma_is_decimal_or_separates_and_is_never_guessed() {
        let of = |line: &str| columns(line).map(|columns| columns.join("|"));
        for (line, read) in [
            ("12,3; 4,2\r", "12.3|4.2"),
            ("12,3\t4,2\tkgf", "12.3|4.2|kgf"),
            ("12,3 4,2 kgf", "12.3|4.2|kgf"),
            ("-0,5;7;x", "-0.5|7|x"),
            ("12,3", "12|3"),
            ("12.0,2.5", "12.0|2.5"),
            ("12.3, 0.42 kgf", "12.3|0.42|kgf"),
            ("12, 4; x", "12|4|x"),
            ("12:00:01,12.3,4.2 N", "12:00:01|12.3|4.2|N"),
            (",,", ""),
        ] {
            assert_eq!(of(line), Ok(read.to_owned()), "{line}");
        }
        for line in ["12,3 kgf", "12,3, 4,2", "1,234.5; 3", "12,3; 4.2,5"] {
            assert!(of(line).is_err_and(|words| words.contains("`pattern`")), "{line}: {:?}", of(line));
        }
        let expected = -4.2 * 9.80665 + 0.5;
        assert_eq!(thrusts(&mut force(None, 2), &[b"12,3; 4,2\r\n"]), [expected]);
        assert_eq!(thrusts(&mut force(Some(r"F=([-+,\d]+)"), 1), &[b"F=4,2 kg\n"]), [expected], "one number");
    }

    /// A switch of units on the instrument's front is a factor of two, or ten.
    #[test]
    fn another_unit_after_the_number_is_no_reading() {
        let expected = -2.5 * 9.80665 + 0.5;
        assert_eq!(thrusts(&mut force(None, 2), &[b"1 2.5 kg\n1 2.5\n1 2.5 kgf ok\n"]), [expected; 3]);
        assert!(thrusts(&mut force(None, 2), &[b"1 2.5 lbf\n1 2.5 N\n"]).is_empty());
        let mut any = force(None, 2);
        any.instrument.channels[0].from.unit = None;
        assert_eq!(thrusts(&mut any, &[b"1 2.5 N\n1 2.5 lb\n1 2.5 N\n"]).len(), 2, "the first it was");
    }

    #[test]
    fn a_number_that_cannot_be_is_no_reading_and_said() {
        let mut force = force(None, 1);
        assert!(thrusts(&mut force, &[b"1e300\n-9e9\n"]).is_empty());
        let mut words = Vec::new();
        force.hear(b"102.1\n", &mut |heard| words.push(heard));
        let [Heard::Unguarded(words)] = words.as_slice() else { panic!("{words:?}") };
        assert!(words.contains("thrust_n = -1.0008e3 N, beyond the 1.0000e3"), "{words}");
    }

    #[test]
    fn lines_that_are_not_understood_are_said_with_a_hint() {
        let mut words = Vec::new();
        force(None, 2).hear(b"OVERLOAD\nOVERLOAD\nOVERLOAD\nOVERLOAD\n", &mut |heard| words.push(heard));
        let [Heard::Unguarded(words)] = words.as_slice() else { panic!("{words:?}") };
        assert!(
            words.contains("OVERLOAD") && words.contains("column 2") && words.contains("hint:"),
            "{words}"
        );
    }

    proptest! {
        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..3000)) {
            let mut listening = force(Some(r"([-+.\d]+)"), 1);
            for value in thrusts(&mut listening, &[&bytes]) {
                prop_assert!(value.is_finite());
            }
        }
    }
}
