//! The fields of a frame: how each is written, and what it is predicted from.

use std::collections::HashMap;

use super::header::Header;

/// A main frame that stands for itself, or one that says what has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Whole,
    Change,
}

/// What is added to what stands in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predict {
    Nothing,
    Last,
    Line,
    Average,
    ThrottleMin,
    FirstMotor,
    Increment,
    Home,
    Middle,
    Supply,
    LastTime,
    MotorMin,
}

/// How values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coding {
    Signed,
    Unsigned,
    Negative14,
    Several8,
    Three32,
    Four16,
    Absent,
    ThreeVariable,
}

/// The fields of one kind of frame.
#[derive(Default)]
pub(super) struct Frame {
    pub names: Vec<String>,
    whole: Vec<(Predict, Coding)>,
    change: Vec<(Predict, Coding)>,
}

impl Frame {
    /// From the lines `Field X name`, `Field X predictor` and `Field X encoding`.
    ///
    /// # Errors
    /// What is missing or not known.
    pub fn read(lines: &HashMap<String, String>, whole: &str, change: &str) -> Result<Self, String> {
        let list = |kind: &str, what: &str| -> Result<Vec<String>, String> {
            let line = format!("Field {kind} {what}");
            let text = lines.get(&line).ok_or_else(|| format!("its header has no line {line:?}"))?;
            Ok(text.split(',').map(|word| word.trim().to_owned()).collect())
        };
        let names = list(whole, "name")?;
        let fields = |kind: &str| -> Result<Vec<(Predict, Coding)>, String> {
            let (predictors, codings) = (list(kind, "predictor")?, list(kind, "encoding")?);
            if predictors.len() != names.len() || codings.len() != names.len() {
                return Err(format!(
                    "its frames {kind} have {} names and {} encodings",
                    names.len(),
                    codings.len()
                ));
            }
            predictors.iter().zip(&codings).map(|(p, c)| Ok((predict(p)?, coding(c)?))).collect()
        };
        Ok(Self { whole: fields(whole)?, change: fields(change)?, names })
    }

    /// Is any field predicted from this?
    pub fn predicts(&self, what: Predict) -> bool {
        self.whole.iter().chain(&self.change).any(|(predict, _)| *predict == what)
    }

    /// Passes over a frame.
    pub fn skip(&self, bytes: &mut Bytes<'_>) -> Option<()> {
        if self.whole.is_empty() { None } else { raw(&self.whole, bytes).map(drop) }
    }

    /// The values of a main frame; none where bytes are missing. `history` are the last frame and the one before; without
    /// it a changed frame is only passed over, and its values mean nothing.
    pub fn values(
        &self,
        kind: Kind,
        bytes: &mut Bytes<'_>,
        header: &Header,
        history: Option<(&[i64], &[i64])>,
    ) -> Option<Vec<i64>> {
        let fields = if kind == Kind::Whole { &self.whole } else { &self.change };
        let mut values = raw(fields, bytes)?;
        for place in 0..values.len() {
            let (last, before) = history.map_or((0, 0), |(last, before)| (last[place], before[place]));
            let predicted = match fields[place].0 {
                Predict::Nothing | Predict::Home => 0,
                Predict::Last | Predict::LastTime => last,
                Predict::Line => 2 * last - before,
                Predict::Average => (last + before) / 2,
                Predict::ThrottleMin => header.throttle_min,
                Predict::FirstMotor => header.motor.map_or(0, |motor| values[motor]),
                // Frames that were left out on purpose are not counted: the time says when it was.
                Predict::Increment => last + 1,
                Predict::Middle => 1500,
                Predict::Supply => header.supply,
                Predict::MotorMin => header.motor_min,
            };
            // Counters of 32 bits: nothing lies further out but in a broken frame.
            values[place] = values[place].saturating_add(predicted).clamp(-(1 << 33), 1 << 33);
        }
        Some(values)
    }
}

fn predict(text: &str) -> Result<Predict, String> {
    Ok(match text {
        "0" => Predict::Nothing,
        "1" => Predict::Last,
        "2" => Predict::Line,
        "3" => Predict::Average,
        "4" => Predict::ThrottleMin,
        "5" => Predict::FirstMotor,
        "6" => Predict::Increment,
        "7" => Predict::Home,
        "8" => Predict::Middle,
        "9" => Predict::Supply,
        "10" => Predict::LastTime,
        "11" => Predict::MotorMin,
        other => return Err(format!("it has a predictor {other:?} that is not known")),
    })
}

fn coding(text: &str) -> Result<Coding, String> {
    Ok(match text {
        "0" => Coding::Signed,
        "1" => Coding::Unsigned,
        "3" => Coding::Negative14,
        "6" => Coding::Several8,
        "7" => Coding::Three32,
        "8" => Coding::Four16,
        "9" => Coding::Absent,
        "10" => Coding::ThreeVariable,
        other => return Err(format!("it has an encoding {other:?} that is not known")),
    })
}

/// What stands in the file, before anything is added. Some codings hold several fields at once.
fn raw(fields: &[(Predict, Coding)], bytes: &mut Bytes<'_>) -> Option<Vec<i64>> {
    let mut values = Vec::with_capacity(fields.len());
    while let Some((predict, coding)) = fields.get(values.len()) {
        if *predict == Predict::Increment {
            values.push(0);
            continue;
        }
        match coding {
            Coding::Signed => values.push(bytes.signed()?),
            Coding::Unsigned => values.push(bytes.unsigned()?),
            Coding::Negative14 => values.push(-extend(bytes.unsigned()?, 14)),
            Coding::Absent => values.push(0),
            Coding::Several8 => {
                let rest = &fields[values.len()..];
                let count = rest.iter().take(8).take_while(|(_, coding)| *coding == Coding::Several8).count();
                let mask = if count == 1 { 1 } else { bytes.byte()? };
                for bit in 0..count {
                    values.push(if mask >> bit & 1 == 1 { bytes.signed()? } else { 0 });
                }
            }
            Coding::Three32 => values.extend(bytes.three(false)?),
            Coding::ThreeVariable => values.extend(bytes.three(true)?),
            Coding::Four16 => values.extend(bytes.four()?),
        }
    }
    // The last coding may hold more than there are fields.
    values.truncate(fields.len());
    Some(values)
}

/// A number of so many bits, two's complement.
fn extend(value: i64, bits: u32) -> i64 {
    let shift = 64 - bits;
    value << shift >> shift
}

/// The bytes of a log, and how far it is read.
pub(super) struct Bytes<'a> {
    data: &'a [u8],
    at: usize,
    ran_out: bool,
}

impl<'a> Bytes<'a> {
    pub fn new(data: &'a [u8]) -> Self {
        Self { data, at: 0, ran_out: false }
    }

    pub fn at(&self) -> usize {
        self.at
    }

    pub fn go_to(&mut self, at: usize) {
        (self.at, self.ran_out) = (at, false);
    }

    pub fn go_to_end(&mut self) {
        self.at = self.data.len();
    }

    pub fn is_empty(&self) -> bool {
        self.at >= self.data.len()
    }

    /// Was more asked for than there is?
    pub fn ran_out(&self) -> bool {
        self.ran_out
    }

    pub fn peek(&self) -> Option<u8> {
        self.data.get(self.at).copied()
    }

    pub fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|one| one[0])
    }

    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let part = self.data.get(self.at..self.at + count);
        self.ran_out |= part.is_none();
        self.at += part.map_or(0, |part| part.len());
        part
    }

    /// Seven bits a byte, the low ones first.
    pub fn unsigned(&mut self) -> Option<i64> {
        let mut value = 0_u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f).wrapping_shl(shift);
            if byte < 128 {
                return Some(i64::from(value));
            }
        }
        None
    }

    /// The same with the sign as the lowest bit.
    pub fn signed(&mut self) -> Option<i64> {
        let value = self.unsigned()?;
        Some(value >> 1 ^ -(value & 1))
    }

    /// Three numbers as long as a tag says; `variable` is the newer way, which parts the middle ones unevenly.
    fn three(&mut self, variable: bool) -> Option<[i64; 3]> {
        let lead = i64::from(self.byte()?);
        Some(match (lead >> 6, variable) {
            (0, _) => [lead >> 4, lead >> 2, lead].map(|bits| extend(bits, 2)),
            (1, false) => {
                let next = i64::from(self.byte()?);
                [lead, next >> 4, next].map(|bits| extend(bits, 4))
            }
            (1, true) => {
                let next = i64::from(self.byte()?);
                [extend(lead >> 1, 5), extend(lead << 4 & 0x10 | next >> 4, 5), extend(next, 4)]
            }
            (2, false) => {
                let (next, last) = (i64::from(self.byte()?), i64::from(self.byte()?));
                [lead, next, last].map(|bits| extend(bits, 6))
            }
            (2, true) => {
                let (next, last) = (i64::from(self.byte()?), i64::from(self.byte()?));
                [extend(lead << 2 | next >> 6, 8), extend(next << 1 | last >> 7, 7), extend(last, 7)]
            }
            _ => {
                let mut values = [0; 3];
                for (place, value) in values.iter_mut().enumerate() {
                    let count = (lead >> (2 * place) & 3) as usize + 1;
                    let little =
                        self.take(count)?.iter().rev().fold(0, |sum, byte| sum << 8 | i64::from(*byte));
                    *value = extend(little, 8 * count as u32);
                }
                values
            }
        })
    }

    /// Four numbers of 0, 4, 8 or 16 bits, half bytes packed.
    fn four(&mut self) -> Option<[i64; 4]> {
        let tag = self.byte()?;
        let mut half: Option<i64> = None;
        let mut values = [0; 4];
        for (place, value) in values.iter_mut().enumerate() {
            let halves = match tag >> (2 * place) & 3 {
                0 => continue,
                1 => 1,
                2 => 2,
                _ => 4,
            };
            let mut bits = 0;
            for _ in 0..halves {
                let next = match half.take() {
                    Some(low) => low,
                    None => {
                        let byte = i64::from(self.byte()?);
                        half = Some(byte & 0xf);
                        byte >> 4
                    }
                };
                bits = bits << 4 | next;
            }
            *value = extend(bits, 4 * halves);
        }
        Some(values)
    }
}
