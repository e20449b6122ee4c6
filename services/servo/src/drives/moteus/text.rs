//! Lines of the fdcanusb protocol: `can send ID HEX`, `rcv ID HEX FLAGS`, with ` *XX` behind them where check sums are used:
//! CRC-8 with the polynomial 0x97 from zero over everything before the asterisk (crate `crc`).

use crc::{Algorithm, Crc};

const CRC8: Algorithm<u8> =
    Algorithm { width: 8, poly: 0x97, init: 0, refin: false, refout: false, xorout: 0, check: 0, residue: 0 };
const CRC: Crc<u8> = Crc::<u8>::new(&CRC8);
/// Longest line; what is longer is none.
const LINE_MAX: usize = 512;
/// Lengths of a CAN-FD frame, and what fills it up: NOP.
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
const NOP: u8 = 0x50;

/// Appends a frame as a line.
pub fn send(id: u16, data: &[u8], check: bool, out: &mut Vec<u8>) {
    let length = LENGTHS.into_iter().find(|length| *length >= data.len()).unwrap_or(data.len());
    let filled = data.iter().copied().chain(std::iter::repeat(NOP)).take(length);
    let hex: String = filled.map(|byte| format!("{byte:02x}")).collect();
    let line = format!("can send {id:04x} {hex} ");
    let line = if check { format!("{line}*{:02X}", CRC.checksum(line.as_bytes())) } else { line };
    out.extend_from_slice(line.trim_end().as_bytes());
    out.push(b'\n');
}

/// Finds the frames received in a stream of bytes, however it is split.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    held: Vec<u8>,
    /// The far end uses check sums: from the first one on, a line without is none.
    pub checked: bool,
}

impl Lines {
    /// Forgets everything.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Takes bytes; identifier and data of the frames whose lines end in them.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<(u32, Vec<u8>)> {
        let mut found = Vec::new();
        for byte in bytes {
            match byte {
                b'\n' | b'\r' => {
                    let line = std::mem::take(&mut self.held);
                    found.extend(self.frame(&line));
                }
                byte if self.held.len() < LINE_MAX => self.held.push(*byte),
                _ => self.held.clear(),
            }
        }
        found
    }

    fn frame(&mut self, line: &[u8]) -> Option<(u32, Vec<u8>)> {
        let line = std::str::from_utf8(line).ok()?.trim_end();
        let words = match line.rsplit_once('*') {
            Some((words, sum)) => {
                (u8::from_str_radix(sum, 16) == Ok(CRC.checksum(words.as_bytes()))).then_some(())?;
                self.checked = true;
                words
            }
            None if self.checked => return None,
            None => line,
        };
        let mut words = words.split_whitespace();
        let (Some("rcv"), Some(id), Some(hex)) = (words.next(), words.next(), words.next()) else {
            return None;
        };
        let digits = hex.as_bytes();
        if !digits.len().is_multiple_of(2) {
            return None;
        }
        let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
        let data: Option<Vec<u8>> = digits.chunks(2).map(byte).collect();
        Some((u32::from_str_radix(id, 16).ok()?, data?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The line and the answer that the documentation prints, and its check sum's table.
    #[test]
    fn the_documented_lines_are_made_and_read() {
        let mut out = Vec::new();
        let data =
            [0x01, 0x00, 0x0a, 0x07, 0x20, 0x60, 0x00, 0x20, 0x01, 0x50, 0xff, 0x14, 0x04, 0x00, 0x13, 0x0d];
        send(0x8001, &data, false, &mut out);
        assert_eq!(String::from_utf8(out).unwrap(), "can send 8001 01000a07206000200150ff140400130d\n");
        let read = Lines::default().take(b"OK\nrcv 100 2404000a005000000170ff230d181400\n");
        assert_eq!(read.len(), 1);
        assert_eq!((read[0].0, read[0].1.len()), (0x100, 16));
        assert_eq!([CRC.checksum(&[1]), CRC.checksum(&[2]), CRC.checksum(&[0x0f])], [0x97, 0xb9, 0x96]);
    }

    proptest! {
        #[test]
        fn frames_survive_splitting(datas in prop::collection::vec(prop::collection::vec(any::<u8>(), 1..64), 1..5), chunk in 1usize..40, checked: bool) {
            let mut bytes = Vec::new();
            for data in &datas {
                let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
                let line = format!("rcv 100 {hex} ");
                let sum = if checked { format!("*{:02X}", CRC.checksum(line.as_bytes())) } else { String::new() };
                bytes.extend(format!("OK\r\n{line}{sum}\r\n").bytes());
            }
            let mut lines = Lines::default();
            let found: Vec<Vec<u8>> = bytes.chunks(chunk).flat_map(|b| lines.take(b)).map(|(_, data)| data).collect();
            prop_assert_eq!(found, datas);
        }

        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut lines = Lines::default();
            lines.take(&bytes);
            prop_assert!(lines.held.len() <= LINE_MAX);
        }
    }
}
