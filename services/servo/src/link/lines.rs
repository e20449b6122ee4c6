//! Lines of text in a stream of bytes.

/// Longest line: what goes on beyond it is cut off, so that a device that prints no end of line fills no memory.
const LONGEST: usize = 1024;

/// Gathers lines, however the stream is split.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    held: Vec<u8>,
}

impl Lines {
    /// Takes bytes; the lines that end in them, blank ones left out. What is no text is replaced by marks (U+FFFD) that
    /// are neither digits nor words of any protocol.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<String> {
        let mut lines = Vec::new();
        for byte in bytes {
            match byte {
                b'\n' | b'\r' => {
                    let line = std::mem::take(&mut self.held);
                    lines.push(String::from_utf8_lossy(&line).into_owned());
                }
                byte if self.held.len() < LONGEST => self.held.push(*byte),
                _ => (),
            }
        }
        lines.retain(|line| !line.trim().is_empty());
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_endless_line_is_cut_and_the_next_one_is_whole() {
        let mut lines = Lines::default();
        let mut bytes = vec![b'x'; 3 * LONGEST];
        bytes.extend(b"\r\n1 2\n");
        assert_eq!(lines.take(&bytes), ["x".repeat(LONGEST), "1 2".to_owned()]);
    }

    proptest! {
        #[test]
        fn lines_survive_splitting(texts in prop::collection::vec("[a-z0-9*.-]{1,40}", 1..6), chunk in 1usize..20) {
            let bytes: Vec<u8> = texts.iter().flat_map(|text| format!("{text}\r\n").into_bytes()).collect();
            let mut lines = Lines::default();
            let found: Vec<String> = bytes.chunks(chunk).flat_map(|bytes| lines.take(bytes)).collect();
            prop_assert_eq!(found, texts);
        }

        #[test]
        fn any_bytes_are_endured(bytes in prop::collection::vec(any::<u8>(), 0..3000)) {
            let mut lines = Lines::default();
            for line in lines.take(&bytes) {
                prop_assert!(!line.trim().is_empty() && line.chars().count() <= LONGEST);
            }
            prop_assert!(lines.held.len() <= LONGEST);
        }
    }
}
