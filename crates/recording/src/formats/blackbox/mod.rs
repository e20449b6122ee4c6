//! Betaflight and INAV blackbox, data version 2, from its public description (betaflight.com, "Blackbox Internals"): every
//! main frame with its numbers, in SI units where the format knows them.
//!
//! The crate `blackbox-log` (0.4.3) is not used: behind a whole frame it predicts from the frame before it as well, where the
//! firmware begins anew, so that motors and gyros are off by some counts until the next whole frame.

mod fields;
mod header;

use std::io::BufRead;

use super::stream::whole;
use crate::error::Problem;
use crate::log::{Gather, Log};
use fields::{Bytes, Frame, Kind};
use header::Header;

/// How each log within a file begins.
pub(super) const MAGIC: &[u8] = b"H Product:Blackbox";
const NAME: &str = "Betaflight blackbox";
/// Frames further apart are damage, us.
const APART_US: i64 = 10_000_000;

/// Every log of the file, one after the other: a board begins one whenever it is armed.
pub(super) fn log(input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let (data, torn) = whole(input);
    let starts: Vec<usize> =
        (0..data.len().saturating_sub(MAGIC.len() - 1)).filter(|at| data[*at..].starts_with(MAGIC)).collect();
    let mut gather = Gather::new(NAME, "seconds since the board started", wanted);
    let topic = gather.topic("main");
    let mut names = Vec::new();
    let mut refused = Vec::new();
    for (place, start) in starts.iter().enumerate() {
        let end = starts.get(place + 1).copied().unwrap_or(data.len());
        let which = format!("log {} of {} in the file", place + 1, starts.len());
        match Header::read(&data[*start..end]) {
            Ok((header, frames)) => take(&mut gather, topic, &mut names, &which, &header, frames),
            Err(why) => refused.push(format!("{which} is left out: {why}")),
        }
    }
    if gather.is_empty() {
        let message = refused.first().cloned().unwrap_or_else(|| "no whole frame is in it".into());
        return Err(Problem::Broken { format: NAME, message });
    }
    refused.into_iter().chain(torn).for_each(|why| gather.loss(why));
    Ok(gather.finish())
}

fn take(
    gather: &mut Gather<'_>,
    topic: usize,
    names: &mut Vec<String>,
    which: &str,
    header: &Header,
    data: &[u8],
) {
    // The logs of a file may differ in their fields. Counts of the loop are not kept: changed frames do not hold them.
    let places: Vec<Option<usize>> = (header.scales.iter().zip(&header.main.names))
        .map(|(scale, name)| match names.iter().position(|known| known == name) {
            _ if name == "loopIteration" => None,
            None => {
                names.push(name.clone());
                Some(gather.field(topic, name, scale.map(|(_, unit)| unit.to_owned())))
            }
            known => known,
        })
        .collect();
    let mut decoder = Decoder { header, bytes: Bytes::new(data), last: None, before: None };
    let (mut frames, mut passed, mut ended, mut last_us) = (0_u64, 0_usize, false, 0);
    while let Some(next) = decoder.next() {
        match next {
            Next::Main(values) => {
                last_us = values[header.time];
                gather.message(topic, last_us as f64 * 1e-6);
                for ((value, place), scale) in values.iter().zip(&places).zip(&header.scales) {
                    let Some(place) = place else { continue };
                    gather.set(topic, *place, *value as f64 * scale.map_or(1.0, |(factor, _)| factor));
                }
                frames += 1;
            }
            Next::Passed(bytes) => passed += bytes,
            Next::End => {
                ended = true;
                break;
            }
        }
    }
    if passed > 0 {
        gather.loss(format!("{which}: {passed} bytes are no frames and were passed over"));
    }
    if !ended {
        gather.loss(format!("{which} stops without its end, behind frame {frames}"));
    }
    gather.note(format!(
        "{which}: {}, {frames} frames to {:.3} s{}",
        header.firmware,
        last_us as f64 * 1e-6,
        header.told()
    ));
}

/// What comes next in a log.
enum Next {
    Main(Vec<i64>),
    /// So many bytes that are no frame.
    Passed(usize),
    End,
}

struct Decoder<'a> {
    header: &'a Header,
    bytes: Bytes<'a>,
    /// The frames that the next one is predicted from; none behind damage, up to the next whole frame.
    last: Option<Vec<i64>>,
    before: Option<Vec<i64>>,
}

impl Decoder<'_> {
    fn next(&mut self) -> Option<Next> {
        let mut passed = 0;
        loop {
            let start = self.bytes.at();
            if self.bytes.is_empty() {
                return (passed > 0).then_some(Next::Passed(passed));
            }
            let frame = self.frame();
            // A frame is believed if another, or the end, stands behind it.
            let follows =
                self.bytes.is_empty() || self.bytes.peek().is_some_and(|kind| b"IPSGHE".contains(&kind));
            match frame {
                Some(found) if follows || matches!(found, Found::End) => {
                    if passed > 0 {
                        // It is read again behind what was passed over.
                        self.bytes.go_to(start);
                        return Some(Next::Passed(passed));
                    }
                    match found {
                        Found::End => return Some(Next::End),
                        Found::Beside => {}
                        Found::Main { kind, values } => {
                            if let Some(values) = self.settle(kind, values) {
                                return Some(Next::Main(values));
                            }
                        }
                    }
                }
                None if self.bytes.ran_out() && self.last.is_some() && passed == 0 => {
                    // The last frame was cut off.
                    self.bytes.go_to_end();
                    return None;
                }
                _ => {
                    self.bytes.go_to(start + 1);
                    (self.last, self.before) = (None, None);
                    passed += 1;
                }
            }
        }
    }

    /// A whole frame begins anew; one that cannot be predicted is dropped.
    fn settle(&mut self, kind: Kind, values: Vec<i64>) -> Option<Vec<i64>> {
        let time = self.header.time;
        let late_us = self.last.as_ref().map_or(0, |last| values[time] - last[time]);
        match kind {
            Kind::Whole => self.before = Some(values.clone()),
            Kind::Change if self.last.is_some() && (0..APART_US).contains(&late_us) => {
                self.before = self.last.take();
            }
            Kind::Change => {
                (self.last, self.before) = (None, None);
                return None;
            }
        }
        self.last = Some(values.clone());
        Some(values)
    }

    /// One frame of any kind; none where there is none.
    fn frame(&mut self) -> Option<Found> {
        let header = self.header;
        let read = |frame: &Frame, bytes: &mut Bytes<'_>| frame.skip(bytes).map(|()| Found::Beside);
        match self.bytes.byte()? {
            b'I' => {
                let values = header.main.values(Kind::Whole, &mut self.bytes, header, None)?;
                Some(Found::Main { kind: Kind::Whole, values })
            }
            b'P' => {
                let history = self.last.as_deref().zip(self.before.as_deref());
                let values = header.main.values(Kind::Change, &mut self.bytes, header, history)?;
                Some(Found::Main { kind: Kind::Change, values })
            }
            b'S' => read(&header.slow, &mut self.bytes),
            b'G' => read(&header.gps, &mut self.bytes),
            b'H' => read(&header.home, &mut self.bytes),
            b'E' => self.event(),
            _ => None,
        }
    }

    fn event(&mut self) -> Option<Found> {
        let bytes = &mut self.bytes;
        match bytes.byte()? {
            // Beep, disarmed, IMU failure: a number.
            0 | 15 | 40 => drop(bytes.unsigned()?),
            // An adjustment under way: a whole number or a float.
            13 => {
                if bytes.byte()? < 128 {
                    bytes.signed()?;
                } else {
                    bytes.take(4)?;
                }
            }
            // Resumed, flight mode: two numbers.
            14 | 30 => drop((bytes.unsigned()?, bytes.unsigned()?)),
            255 => return (bytes.take(11)? == b"End of log\0").then_some(Found::End),
            _ => return None,
        }
        Some(Found::Beside)
    }
}

/// A frame as it is found.
enum Found {
    Main {
        kind: Kind,
        values: Vec<i64>,
    },
    /// Slow, position, home, or an event.
    Beside,
    End,
}
