//! Lines of the fdcanusb protocol: `can send ID HEX`, `rcv ID HEX FLAGS`, with ` *XX` behind them where check sums are used:
//! CRC-8 with the polynomial 0x97 from zero over everything before the asterisk (crate `crc`).

use crc::{Algorithm, Crc};

const CRC8: Algorithm<u8> =
    Algorithm { width: 8, poly: 0x97, init: 0, refin: false, refout: false, xorout: 0, check: 0, residue: 0 };
const CRC: Crc<u8> = Crc::<u8>::new(&CRC8);
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

/// The frame in a received line: identifier and data. `checked` says that the far end uses check sums, and is set by the
/// first one: from then on a line without is none.
pub fn receive(line: &str, checked: &mut bool) -> Option<(u32, Vec<u8>)> {
    let words = match line.trim_end().rsplit_once('*') {
        Some((words, sum)) => {
            (u8::from_str_radix(sum, 16) == Ok(CRC.checksum(words.as_bytes()))).then_some(())?;
            *checked = true;
            words
        }
        None if *checked => return None,
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
        assert_eq!(receive("OK", &mut false), None);
        let (id, data) = receive("rcv 100 2404000a005000000170ff230d181400", &mut false).unwrap();
        assert_eq!((id, data.len()), (0x100, 16));
        assert_eq!([CRC.checksum(&[1]), CRC.checksum(&[2]), CRC.checksum(&[0x0f])], [0x97, 0xb9, 0x96]);
    }

    proptest! {
        /// A frame comes back, with a check sum and without; once there was one, a line without it or with a wrong one is none.
        #[test]
        fn frames_come_back(data in prop::collection::vec(any::<u8>(), 1..64), at in any::<prop::sample::Index>()) {
            let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
            let plain = format!("rcv 100 {hex} ");
            let with_sum = format!("{plain}*{:02X}", CRC.checksum(plain.as_bytes()));
            let mut checked = false;
            prop_assert_eq!(receive(&plain, &mut checked), Some((0x100, data.clone())));
            prop_assert!(!checked);
            prop_assert_eq!(receive(&with_sum, &mut checked), Some((0x100, data)));
            prop_assert!(checked);
            prop_assert_eq!(receive(&plain, &mut checked), None);
            let at = at.index(plain.len());
            let mut changed = with_sum.into_bytes();
            changed[at] ^= 1;
            prop_assert_eq!(receive(&String::from_utf8_lossy(&changed), &mut checked), None);
        }

        #[test]
        fn any_line_is_endured(line in any::<String>(), checked: bool) {
            receive(&line, &mut { checked });
        }
    }
}
