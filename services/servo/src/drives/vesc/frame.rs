//! Frames of the VESC protocol: start, length, payload, CRC-16, stop. The cyclic check is XMODEM's
//! (polynomial 0x1021 from zero) over the payload, from the crate `crc`.

use crc::{CRC_16_XMODEM, Crc};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);
/// Length in one byte.
const SHORT: u8 = 2;
/// Length in two bytes.
const LONG: u8 = 3;
const STOP: u8 = 3;
/// Longest payload of the firmware.
pub const PAYLOAD_MAX: usize = 512;

/// Appends a payload as a frame.
pub fn frame(payload: &[u8], out: &mut Vec<u8>) {
    match u8::try_from(payload.len()) {
        Ok(length) => out.extend([SHORT, length]),
        Err(_) => {
            out.push(LONG);
            out.extend((payload.len().min(PAYLOAD_MAX) as u16).to_be_bytes());
        }
    }
    let payload = payload.get(..PAYLOAD_MAX).unwrap_or(payload);
    out.extend(payload);
    out.extend(CRC.checksum(payload).to_be_bytes());
    out.push(STOP);
}

/// Finds frames in a stream of bytes, however it is split; what is no frame is passed over byte by byte.
#[derive(Clone, Debug)]
pub struct Deframer {
    held: Vec<u8>,
    /// Longest payload expected: a noise byte that looks like the start of a longer frame holds nothing up.
    pub longest: usize,
}

/// What stands at the beginning of the held bytes.
enum Begin {
    /// A frame of so many bytes with its payload at this place.
    Whole(usize, std::ops::Range<usize>),
    /// It may become a frame.
    Unfinished,
    /// It cannot.
    Nothing,
}

impl Default for Deframer {
    fn default() -> Self {
        Self { held: Vec::new(), longest: PAYLOAD_MAX }
    }
}

impl Deframer {
    /// Takes bytes; the payloads of the sound frames that end in them.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        self.held.extend_from_slice(bytes);
        let mut at = 0;
        while let Some(rest) = self.held.get(at..).filter(|rest| !rest.is_empty()) {
            match begin(rest, self.longest) {
                Begin::Whole(length, place) => {
                    found.push(rest.get(place).unwrap_or_default().to_vec());
                    at += length;
                }
                Begin::Unfinished => break,
                Begin::Nothing => at += 1,
            }
        }
        self.held.drain(..at.min(self.held.len()));
        found
    }
}

fn begin(bytes: &[u8], longest: usize) -> Begin {
    let (head, length) = match bytes {
        [SHORT, length, ..] => (2, usize::from(*length)),
        [LONG, high, low, ..] => (3, usize::from(u16::from_be_bytes([*high, *low]))),
        [SHORT | LONG] | [LONG, _] => return Begin::Unfinished,
        _ => return Begin::Nothing,
    };
    // A long frame never carries what fits a short one.
    if length == 0 || length > longest || (head == 3 && length < 255) {
        return Begin::Nothing;
    }
    let (end, whole) = (head + length, head + length + 3);
    let Some(frame) = bytes.get(..whole) else { return Begin::Unfinished };
    match (frame.get(head..end), frame.get(end..)) {
        (Some(payload), Some([high, low, STOP])) if CRC.checksum(payload).to_be_bytes() == [*high, *low] => {
            Begin::Whole(whole, head..end)
        }
        _ => Begin::Nothing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(bytes: &[u8], chunk: usize) -> Vec<Vec<u8>> {
        let mut deframer = Deframer::default();
        bytes.chunks(chunk).flat_map(|bytes| deframer.take(bytes)).collect()
    }

    /// The request for the values as the vendors' documents print it: 02 01 04 40 84 03.
    #[test]
    fn the_documented_frame_is_made() {
        let mut out = Vec::new();
        frame(&[4], &mut out);
        assert_eq!(out, [0x02, 0x01, 0x04, 0x40, 0x84, 0x03]);
    }

    proptest! {
        /// A stream of frames with noise between them comes out the same however it is split. Noise without the two
        /// start bytes cannot swallow a frame.
        #[test]
        fn frames_survive_splitting_and_noise(
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 1..400), 1..5),
            noise in prop::collection::vec(4u8.., 0..20),
            chunk in 1usize..50,
        ) {
            let mut bytes = Vec::new();
            for payload in &payloads {
                bytes.extend(&noise);
                frame(payload, &mut bytes);
            }
            prop_assert_eq!(read(&bytes, chunk), payloads);
        }

        /// A frame with any one byte changed is not taken for what it was.
        #[test]
        fn a_changed_byte_is_noticed(payload in prop::collection::vec(any::<u8>(), 1..60), at in 0usize..100, by in 1u8..) {
            let mut bytes = Vec::new();
            frame(&payload, &mut bytes);
            let at = at % bytes.len();
            bytes[at] ^= by;
            prop_assert!(!read(&bytes, 7).contains(&payload));
        }

        /// Any bytes at all: no panic, and nothing held grows without bound.
        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..2000), chunk in 1usize..300) {
            let mut deframer = Deframer::default();
            for bytes in bytes.chunks(chunk) {
                deframer.take(bytes);
                prop_assert!(deframer.held.len() <= PAYLOAD_MAX + 6);
            }
        }
    }
}
