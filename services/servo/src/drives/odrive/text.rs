//! Lines of the ODrive's ASCII protocol: `words*check`, the check being the exclusive or of all characters before the
//! asterisk, in decimal.

/// Longest answer; what is longer is none.
const LINE_MAX: usize = 256;

fn check(words: &[u8]) -> u8 {
    words.iter().fold(0, |sum, byte| sum ^ byte)
}

/// Appends a line with its check sum.
pub fn line(words: &str, out: &mut Vec<u8>) {
    out.extend_from_slice(words.as_bytes());
    out.extend_from_slice(format!("*{}\n", check(words.as_bytes())).as_bytes());
}

/// Finds the sound lines in a stream of bytes, however it is split.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    held: Vec<u8>,
}

impl Lines {
    /// Forgets what is held.
    pub fn clear(&mut self) {
        self.held.clear();
    }

    /// Takes bytes; the words of the lines that end in them. A line whose check sum is wrong or missing is an empty one,
    /// so that it is known that there was one.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<String> {
        let mut found = Vec::new();
        for byte in bytes {
            match byte {
                b'\r' => (),
                b'\n' => {
                    let line = std::mem::take(&mut self.held);
                    if !line.is_empty() {
                        found.push(words(&line).unwrap_or_default());
                    }
                }
                byte if self.held.len() < LINE_MAX => self.held.push(*byte),
                _ => self.held.clear(),
            }
        }
        found
    }
}

fn words(line: &[u8]) -> Option<String> {
    let at = line.iter().rposition(|byte| *byte == b'*')?;
    let (words, sum) = (line.get(..at)?, line.get(at + 1..)?);
    let sum: u8 = std::str::from_utf8(sum).ok()?.trim().parse().ok()?;
    (sum == check(words)).then(|| String::from_utf8_lossy(words).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The example of the documentation.
    #[test]
    fn the_documented_line_is_made() {
        let mut out = Vec::new();
        line("r vbus_voltage ", &mut out);
        assert_eq!(String::from_utf8(out).unwrap(), "r vbus_voltage *93\n");
    }

    proptest! {
        #[test]
        fn lines_survive_splitting(texts in prop::collection::vec("[a-z0-9 .-]{1,40}", 1..6), chunk in 1usize..20) {
            let mut bytes = Vec::new();
            texts.iter().for_each(|text| line(text, &mut bytes));
            let mut lines = Lines::default();
            let found: Vec<String> = bytes.chunks(chunk).flat_map(|bytes| lines.take(bytes)).collect();
            let texts: Vec<String> = texts.iter().map(|text| text.trim().to_owned()).collect();
            prop_assert_eq!(found, texts);
        }

        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut lines = Lines::default();
            for words in lines.take(&bytes) {
                prop_assert!(words.len() <= 3 * LINE_MAX);
            }
        }
    }
}
