//! Bytes of a log with the place they come from: a log that ends in the middle of a record is a torn one, not a broken
//! program. Where its reader fails, as that of a gzip file that was cut off, the log ends too, and why is kept.

use std::io::{self, BufRead, Read};

/// A reader that knows how far it is.
pub(super) struct Stream<R> {
    input: R,
    at: u64,
    torn: Option<io::Error>,
    /// Taken and put back.
    back: Vec<u8>,
}

/// Everything up to the end, or to where the reader fails; what that loses.
pub(super) fn whole(mut input: impl Read) -> (Vec<u8>, Option<String>) {
    let mut data = Vec::new();
    let torn = input.read_to_end(&mut data).err();
    (data, torn.as_ref().map(torn_off))
}

/// What a reader that fails loses.
pub(super) fn torn_off(why: &io::Error) -> String {
    format!("the file ends in the middle of its data ({why}); what followed is lost")
}

impl<R: BufRead> Stream<R> {
    pub fn new(input: R) -> Self {
        Self { input, at: 0, torn: None, back: Vec::new() }
    }

    /// What is lost since the reader failed.
    pub fn torn(&self) -> Option<String> {
        self.torn.as_ref().map(torn_off)
    }

    /// Bytes taken so far.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Fills the buffer, or says how many bytes there were.
    pub fn fill(&mut self, buffer: &mut [u8]) -> usize {
        let mut filled = self.back.len().min(buffer.len());
        buffer[..filled].iter_mut().zip(self.back.drain(..filled)).for_each(|(to, from)| *to = from);
        while filled < buffer.len() && self.torn.is_none() {
            match self.input.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => self.torn = Some(e),
            }
        }
        self.at += filled as u64;
        filled
    }

    /// Takes so many bytes into the buffer; false at the end.
    pub fn take(&mut self, buffer: &mut Vec<u8>, count: usize) -> bool {
        buffer.resize(count, 0);
        self.fill(buffer) == count
    }

    /// Passes over bytes; how many there were.
    pub fn skip(&mut self, count: u64) -> u64 {
        let (mut passed, mut buffer) = (0, [0; 4096]);
        while passed < count {
            let next = buffer.len().min((count - passed) as usize);
            let filled = self.fill(&mut buffer[..next]);
            passed += filled as u64;
            if filled < next {
                break;
            }
        }
        passed
    }

    /// Bytes that were taken lie ahead again.
    pub fn put_back(&mut self, bytes: &[u8]) {
        self.back.splice(0..0, bytes.iter().copied());
        self.at -= bytes.len() as u64;
    }

    /// Passes over bytes until so many that lie ahead are what is looked for; how many lie before them, and whether they came.
    pub fn seek(&mut self, width: usize, is_it: impl Fn(&[u8]) -> bool) -> (u64, bool) {
        let mut ahead = vec![0; width];
        let mut passed = self.fill(&mut ahead) as u64;
        if passed < width as u64 {
            return (passed, false);
        }
        while !is_it(&ahead) {
            let mut byte = [0];
            if self.fill(&mut byte) == 0 {
                return (passed, false);
            }
            ahead.rotate_left(1);
            ahead[width - 1] = byte[0];
            passed += 1;
        }
        self.put_back(&ahead);
        (passed - width as u64, true)
    }
}

/// So many bytes from a place on, as an array.
pub(super) fn bytes<const N: usize>(data: &[u8], at: usize) -> Option<[u8; N]> {
    data.get(at..at.checked_add(N)?)?.try_into().ok()
}
