//! Frames of MAVLink 2 in a stream of bytes. Check sum, its seed by message, and fields are the crate `mavlink`'s; its readers wait for
//! a port, which nothing here may, so frames are found here.

use mavlink::consts::MAX_FRAME_SIZE;
use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData};

/// Begin of a frame of MAVLink 2.
const STX: u8 = 0xfd;
/// Bytes before the payload, and the check sum behind it.
const HEAD: usize = 10;
const CHECK: usize = 2;
/// Bytes behind the check sum of a signed frame. Signatures are not looked at.
const SIGNATURE: usize = 13;
/// The one flag that a reader may know here: a signature follows.
const SIGNED: u8 = 1;

/// Appends a message as a frame.
pub fn frame<D: MessageData>(header: MavHeader, data: &D, out: &mut Vec<u8>) {
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.serialize_message_data(header, data);
    out.extend_from_slice(raw.raw_bytes());
}

/// Finds frames in a stream of bytes, however it is split; what is no frame is passed over byte by byte.
#[derive(Clone, Debug, Default)]
pub struct Deframer {
    held: Vec<u8>,
}

/// What stands at the beginning of the held bytes.
enum Begin {
    /// A frame of so many bytes.
    Whole(usize, Box<MAVLinkV2MessageRaw>),
    /// It may become a frame.
    Unfinished,
    /// It cannot.
    Nothing,
}

impl Deframer {
    /// Takes bytes; the sound frames that end in them.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<MAVLinkV2MessageRaw> {
        let mut found = Vec::new();
        self.held.extend_from_slice(bytes);
        let mut at = 0;
        while let Some(rest) = self.held.get(at..).filter(|rest| !rest.is_empty()) {
            match begin(rest) {
                Begin::Whole(length, raw) => {
                    found.push(*raw);
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

fn begin(bytes: &[u8]) -> Begin {
    let (length, flags) = match bytes {
        [STX, length, flags, ..] => (usize::from(*length), *flags),
        [STX] | [STX, _] => return Begin::Unfinished,
        _ => return Begin::Nothing,
    };
    // A frame with a flag that is not known must not be read.
    if flags & !SIGNED != 0 {
        return Begin::Nothing;
    }
    let sound = HEAD + length + CHECK;
    let whole = sound + if flags == SIGNED { SIGNATURE } else { 0 };
    let Some(frame) = bytes.get(..whole) else { return Begin::Unfinished };
    let mut buffer = [0; MAX_FRAME_SIZE];
    for (byte, read) in buffer.iter_mut().zip(frame) {
        *byte = *read;
    }
    let raw = MAVLinkV2MessageRaw::from_bytes_unparsed(buffer);
    if raw.has_valid_crc::<MavMessage>() { Begin::Whole(whole, Box::new(raw)) } else { Begin::Nothing }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, STATUSTEXT_DATA};
    use proptest::prelude::*;

    const HEADER: MavHeader = MavHeader { system_id: 1, component_id: 1, sequence: 0 };

    fn read(bytes: &[u8], chunk: usize) -> Vec<u32> {
        let mut deframer = Deframer::default();
        let frames = bytes.chunks(chunk).flat_map(|bytes| deframer.take(bytes));
        frames.map(|raw| raw.message_id()).collect()
    }

    proptest! {
        /// Frames survive any splitting, and noise between them that does not begin one.
        #[test]
        fn frames_are_found_whole(
            texts in prop::collection::vec("[ -~]{0,50}", 1..5),
            noise in prop::collection::vec(0u8..STX, 0..20),
            chunk in 1usize..50,
        ) {
            let mut bytes = Vec::new();
            for text in &texts {
                bytes.extend(&noise);
                frame(HEADER, &STATUSTEXT_DATA { text: text.as_str().into(), ..Default::default() }, &mut bytes);
            }
            prop_assert_eq!(read(&bytes, chunk), vec![253; texts.len()]);
        }

        /// A frame with any one byte changed is not read.
        #[test]
        fn a_changed_byte_is_noticed(mode in 1u32.., at in 0usize..100, by in 1u8..) {
            let mut bytes = Vec::new();
            frame(HEADER, &HEARTBEAT_DATA { custom_mode: mode, mavlink_version: 3, ..Default::default() }, &mut bytes);
            let at = at % bytes.len();
            bytes[at] ^= by;
            // Another frame behind it ends what the changed byte may have made wait.
            frame(HEADER, &STATUSTEXT_DATA { text: "x".repeat(50).as_str().into(), ..Default::default() }, &mut bytes);
            prop_assert!(!read(&bytes, 7).contains(&0));
        }

        /// Any bytes at all: no panic, and nothing held grows without bound.
        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..2000), chunk in 1usize..300) {
            let mut deframer = Deframer::default();
            for bytes in bytes.chunks(chunk) {
                deframer.take(bytes);
                prop_assert!(deframer.held.len() <= HEAD + 255 + CHECK + SIGNATURE);
            }
        }
    }
}
