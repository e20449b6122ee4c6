//! An instrument that prints lines of numbers on a serial port: a force cell's amplifier, a flow meter, a thermometer.
//!
//! A line is taken apart at commas, semicolons and white space, or by a regular expression whose groups are the columns
//! (crate `regex`, whose matching time is bounded; own parsing would be a worse language of the same kind). Each column's unit
//! must be given; a line in which any wanted column is no number is no reading. Instruments that speak only when asked are sent `ask`.

use std::path::PathBuf;

use kort_proto::signals::{SIGNALS, Signals};
use regex::Regex;

use super::Channel;
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
    /// Which column is which signal; columns count from one.
    pub channels: Vec<Channel<usize>>,
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
    fn read(&self, line: &str) -> Result<Signals, String> {
        let number = |text: Option<&str>| text.and_then(|text| text.trim().parse::<f64>().ok());
        let groups = match &self.instrument.pattern {
            Some(pattern) => Some(pattern.captures(line).ok_or("does not match `pattern`")?),
            None => None,
        };
        let fields: Vec<&str> = line
            .split(|c: char| c == ',' || c == ';' || c.is_whitespace())
            .filter(|field| !field.is_empty())
            .collect();
        let mut signals = Signals::UNKNOWN;
        for channel in &self.instrument.channels {
            let text = match &groups {
                Some(groups) => groups.get(channel.from).map(|group| group.as_str()),
                None => channel.from.checked_sub(1).and_then(|at| fields.get(at)).copied(),
            };
            let value = number(text).filter(|value| value.is_finite());
            let value = value.ok_or_else(|| format!("has no number in column {}", channel.from))?;
            if let Some(signal) = SIGNALS.get(channel.place) {
                (signal.set)(&mut signals, channel.si(value));
            }
        }
        Ok(signals)
    }
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

    fn force(pattern: Option<&str>, from: usize) -> Listening {
        Listening::new(SerialLine {
            port: PathBuf::new(),
            baud: 9600,
            pattern: pattern.map(|p| Regex::new(p).unwrap()),
            ask: String::new(),
            rate_hz: 10.0,
            channels: vec![Channel { from, place: place("thrust_n").unwrap(), scale: -9.80665, offset: 0.5 }],
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
