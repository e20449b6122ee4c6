//! Frames of MAVLink 2, from the serialization page of the MAVLink guide: start, length, flags, sequence, sender, message, payload without
//! its last zeros, check sum over all but the start, seeded behind with a byte that stands for the message's fields.

/// The seeds of the messages spoken here, as the generated headers of MAVLink print them (`…_CRC`).
const SEEDS: [(u32, u8); 13] = [
    (0, 50),
    (1, 124),
    (20, 214),
    (22, 220),
    (36, 222),
    (76, 152),
    (77, 143),
    (111, 34),
    (148, 178),
    (253, 83),
    (290, 251),
    (291, 10),
    (11030, 144),
];

/// A message that came: who says it, what it is, its payload with the zeros that were left out (up to a whole one's length).
pub struct Message {
    pub from: (u8, u8),
    pub id: u32,
    pub payload: Vec<u8>,
}

impl Message {
    pub fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes([self.u8(at), self.u8(at + 1), self.u8(at + 2), self.u8(at + 3)])
    }

    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.u8(at), self.u8(at + 1)])
    }

    pub fn u8(&self, at: usize) -> u8 {
        self.payload.get(at).copied().unwrap_or(0)
    }
}

/// The check sum that MAVLink calls X.25: polynomial 0x1021 turned round, from all ones.
fn check(bytes: impl Iterator<Item = u8>) -> u16 {
    let mut rest = 0xffffu16;
    for byte in bytes {
        rest ^= u16::from(byte);
        for _ in 0..8 {
            rest = if rest & 1 == 1 { rest >> 1 ^ 0x8408 } else { rest >> 1 };
        }
    }
    rest
}

fn seed(id: u32) -> Option<u8> {
    SEEDS.iter().find(|(known, _)| *known == id).map(|(_, seed)| *seed)
}

/// A frame of system 1's autopilot.
pub fn pack(sequence: u8, id: u32, payload: &[u8]) -> Vec<u8> {
    let used = payload.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
    let [a, b, c, _] = id.to_le_bytes();
    let mut frame = vec![0xfd, used as u8, 0, 0, sequence, 1, 1, a, b, c];
    frame.extend(&payload[..used]);
    let sum = check(frame[1..].iter().copied().chain(seed(id)));
    frame.extend(sum.to_le_bytes());
    frame
}

/// The messages in these bytes; what is left of them begins a frame.
pub fn unpack(held: &mut Vec<u8>) -> Vec<Message> {
    let mut found = Vec::new();
    while let Some(start) = held.iter().position(|byte| *byte == 0xfd) {
        held.drain(..start);
        let Some(end) = held.get(1).map(|length| usize::from(*length) + 10) else { return found };
        if held.len() < end + 2 {
            return found;
        }
        let id = u32::from_le_bytes([held[7], held[8], held[9], 0]);
        let sum = check(held[1..end].iter().copied().chain(seed(id)));
        if seed(id).is_some() && held[2] == 0 && sum.to_le_bytes() == held[end..end + 2] {
            let payload = held[10..end].to_vec();
            found.push(Message { from: (held[5], held[6]), id, payload });
            held.drain(..end + 2);
        } else {
            held.drain(..1);
        }
    }
    held.clear();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value that catalogues of CRCs give for this one (MCRF4XX).
    #[test]
    fn the_check_sum_is_the_catalogued_one() {
        assert_eq!(check(b"123456789".iter().copied()), 0x6f91);
    }

    #[test]
    fn a_frame_is_found_behind_noise() {
        let mut held = vec![3, 0xfd, 1, 2];
        held.extend(pack(7, 0, &[19, 0, 0, 0, 12, 3, 81, 4, 3]));
        let found = unpack(&mut held);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].id, found[0].u8(4), found[0].from), (0, 12, (1, 1)));
    }
}
