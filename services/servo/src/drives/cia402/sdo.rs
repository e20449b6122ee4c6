//! Single objects of the drive's dictionary, read and written: SDO, up to four bytes in a frame.
//!
//! The crate `canopen-rs` was passed over: its client takes any answer for the one to its question, and its decoder refuses those that
//! leave the size out, which old drives do; what remains is less than its table of types. `zencan-client` and `oze-canopen` are made for an async
//! runtime.

/// What is asked of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Job {
    /// Its value, of this many bytes.
    Read(u8),
    /// This value, of so many bytes, lowest first.
    Write(u32, u8),
}

/// What the drive answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The value read.
    Value(u32),
    /// It was written.
    Written,
    /// Neither, for this reason.
    Aborted(u32),
}

/// A question, as the data of its frame.
pub fn request(index: u16, sub: u8, job: Job) -> [u8; 8] {
    let [low, high] = index.to_le_bytes();
    let (command, value) = match job {
        Job::Read(_) => (0x40, 0),
        // Expedited, with the number of bytes that are not used.
        Job::Write(value, bytes) => (0x23 | (4 - bytes.clamp(1, 4)) << 2, value),
    };
    let [a, b, c, d] = value.to_le_bytes();
    [command, low, high, sub, a, b, c, d]
}

/// The object that an answer is about, and the answer; none for a frame that is not the answer to a question of this module.
pub fn answer(data: &[u8]) -> Option<(u16, u8, Answer)> {
    let [command, low, high, sub, value @ ..] = *<&[u8; 8]>::try_from(data).ok()?;
    let value = u32::from_le_bytes(value);
    let answer = match command {
        0x60 => Answer::Written,
        0x80 => Answer::Aborted(value),
        // Expedited, with the size told.
        0x43 | 0x47 | 0x4b | 0x4f => Answer::Value(value & u32::MAX >> (8 * (command >> 2 & 3))),
        0x42 => Answer::Value(value),
        _ => return None,
    };
    Some((u16::from_le_bytes([low, high]), sub, answer))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A CODESYS master's own frame, from a log that was published: node 127's heartbeat, 300 ms.
    #[test]
    fn frames_are_those_that_others_send() {
        let write = request(0x1016, 1, Job::Write(0x007f_012c, 4));
        assert_eq!(write, [0x23, 0x16, 0x10, 0x01, 0x2c, 0x01, 0x7f, 0x00]);
        assert_eq!(answer(&[0x60, 0x16, 0x10, 1, 0, 0, 0, 0]), Some((0x1016, 1, Answer::Written)));
        assert_eq!(request(0x6060, 0, Job::Write(10, 1))[0], 0x2f);
        assert_eq!(request(0x6040, 0, Job::Write(6, 2))[0], 0x2b);
        // What stands behind a short value is none of it; an old drive tells no size.
        assert_eq!(
            answer(&[0x4b, 0x41, 0x60, 0, 0x37, 0x02, 9, 9]),
            Some((0x6041, 0, Answer::Value(0x0237)))
        );
        assert_eq!(
            answer(&[0x42, 0x41, 0x60, 0, 0x37, 0x02, 0, 0]),
            Some((0x6041, 0, Answer::Value(0x0237)))
        );
        let refused = answer(&[0x80, 0x07, 0x60, 0, 0, 0, 0x02, 0x06]);
        assert_eq!(refused, Some((0x6007, 0, Answer::Aborted(0x0602_0000))));
        // The start of a longer value, and half a frame.
        assert_eq!(answer(&[0x41, 0x08, 0x10, 0, 20, 0, 0, 0]), None);
        assert_eq!(answer(&[0x60, 0x16]), None);
    }
}
