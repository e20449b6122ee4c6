//! CAN frames in a stream of bytes: lines of an adapter on a serial port (slcan, after Lawicel), or the records in which
//! Linux's raw sockets carry them. Frames of eight bytes and eleven bits of identifier; others on the bus are not read.
//!
//! Own text rather than the crate `slcan`, which owns its serial port and waits for it. A line of an adapter carries no check sum: on
//! USB, and on the bus itself, the wire has one; a bare UART between has none.

use super::Lines;

/// Bytes of a frame as a raw socket reads and writes it: identifier (4), length (1), padding (3), data (8).
pub const RECORD: usize = 16;
/// An adapter's answer to what it does not take.
const BELL: char = '\u{7}';

/// One frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Identifier, eleven bits; the lower one wins the bus.
    pub id: u16,
    length: u8,
    data: [u8; 8],
}

impl Frame {
    /// A frame with the first eight bytes of `data`.
    pub fn new(id: u16, data: &[u8]) -> Self {
        let mut frame = Self { id: id & 0x7ff, length: data.len().min(8) as u8, data: [0; 8] };
        frame.data.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        frame
    }

    /// Its data.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or_default()
    }
}

/// How frames become bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// Lines of an adapter.
    Slcan,
    /// Records of a raw socket.
    Socket,
}

impl Carrier {
    /// Appends a frame.
    pub fn send(self, frame: &Frame, out: &mut Vec<u8>) {
        let digit = |n: u8| char::from_digit(u32::from(n & 15), 16).unwrap_or('0').to_ascii_uppercase() as u8;
        match self {
            Self::Slcan => {
                let [high, low] = frame.id.to_be_bytes();
                out.extend([b't', digit(high), digit(low >> 4), digit(low), digit(frame.length)]);
                out.extend(frame.data().iter().flat_map(|byte| [digit(byte >> 4), digit(*byte)]));
                out.push(b'\r');
            }
            Self::Socket => {
                out.extend(u32::from(frame.id).to_ne_bytes());
                out.extend([frame.length, 0, 0, 0]);
                out.extend(frame.data);
            }
        }
    }
}

/// Gathers frames, however the stream is split.
#[derive(Clone, Debug)]
pub struct Frames {
    carrier: Carrier,
    lines: Lines,
    held: Vec<u8>,
}

impl Frames {
    /// Nothing gathered yet.
    pub fn new(carrier: Carrier) -> Self {
        Self { carrier, lines: Lines::default(), held: Vec::with_capacity(RECORD) }
    }

    /// Takes bytes; the frames that end in them. What is none is left out.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Frame> {
        match self.carrier {
            Carrier::Slcan => self.lines.take(bytes).iter().filter_map(|line| from_line(line)).collect(),
            Carrier::Socket => {
                self.held.extend_from_slice(bytes);
                let (records, rest) = self.held.as_chunks::<RECORD>();
                let frames = records.iter().filter_map(from_record).collect();
                self.held = rest.to_vec();
                frames
            }
        }
    }
}

/// `tiiildd…`, with two bytes of time behind it where the adapter was told so.
fn from_line(line: &str) -> Option<Frame> {
    let words = line.rsplit(BELL).next()?.strip_prefix('t')?;
    let hex = |from: usize, to: usize| {
        let digits = words.get(from..to).filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()))?;
        u16::from_str_radix(digits, 16).ok()
    };
    let (id, length) = (hex(0, 3)?, usize::from(hex(3, 4)?));
    let end = 4 + 2 * length;
    if id > 0x7ff || length > 8 || !(words.len() == end || words.len() == end + 4) {
        return None;
    }
    let mut data = [0; 8];
    for (n, byte) in data.iter_mut().take(length).enumerate() {
        *byte = hex(4 + 2 * n, 6 + 2 * n)? as u8;
    }
    Some(Frame { id, length: length as u8, data })
}

/// The upper bits of the identifier mark what is no frame of this kind: longer ones, questions, errors.
fn from_record(record: &[u8; RECORD]) -> Option<Frame> {
    let [a, b, c, d, length, _, _, _, data @ ..] = *record;
    let id = u16::try_from(u32::from_ne_bytes([a, b, c, d])).ok().filter(|id| *id <= 0x7ff)?;
    (length <= 8).then_some(Frame { id, length, data })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The examples of the Lawicel protocol's description.
    #[test]
    fn a_line_is_the_documented_one() {
        let mut out = Vec::new();
        Carrier::Slcan.send(&Frame::new(0x100, &[]), &mut out);
        Carrier::Slcan.send(&Frame::new(0x55a, &[0x11, 0xab]), &mut out);
        assert_eq!(String::from_utf8(out).unwrap(), "t1000\rt55A211AB\r");
        assert_eq!(from_line("t10021133"), Some(Frame::new(0x100, &[0x11, 0x33])));
        // With a time stamp, and behind an answer to something else.
        assert_eq!(from_line("\u{7}t100211334FD2"), Some(Frame::new(0x100, &[0x11, 0x33])));
        for other in ["z", "t1009", "t10021", "t8000", "T000001001FF", "t1001+1", "r1002", "t100211331"] {
            assert_eq!(from_line(other), None, "{other}");
        }
    }

    /// What `linux/can.h` marks in the identifier: longer ones, remote frames, errors.
    #[test]
    fn other_records_are_left_out() {
        for id in [0x8000_0123_u32, 0x4000_0123, 0x2000_0004, 0x800] {
            let mut bytes = id.to_ne_bytes().to_vec();
            bytes.extend([2, 0, 0, 0, 1, 2, 0, 0, 0, 0, 0, 0]);
            assert_eq!(Frames::new(Carrier::Socket).take(&bytes), [], "{id:#x}");
        }
    }

    proptest! {
        #[test]
        fn frames_survive_splitting(
            frames in prop::collection::vec((0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8)), 1..6),
            chunk in 1usize..40,
        ) {
            let frames: Vec<Frame> = frames.iter().map(|(id, data)| Frame::new(*id, data)).collect();
            for carrier in [Carrier::Slcan, Carrier::Socket] {
                let mut bytes = Vec::new();
                frames.iter().for_each(|frame| carrier.send(frame, &mut bytes));
                let mut gathered = Frames::new(carrier);
                let found: Vec<Frame> = bytes.chunks(chunk).flat_map(|bytes| gathered.take(bytes)).collect();
                prop_assert_eq!(&found, &frames);
            }
        }

        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..500)) {
            for carrier in [Carrier::Slcan, Carrier::Socket] {
                for frame in Frames::new(carrier).take(&bytes) {
                    prop_assert!(frame.id < 0x800 && frame.data().len() <= 8);
                }
            }
        }
    }
}
