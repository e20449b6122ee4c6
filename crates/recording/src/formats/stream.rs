//! Bytes of a log with the place they come from: a log that ends in the middle of a record is a torn one, not a broken
//! program.

use std::io::{self, BufRead};

/// A reader that knows how far it is.
pub(super) struct Stream<R> {
    input: R,
    at: u64,
    /// Taken and put back.
    back: Vec<u8>,
}

impl<R: BufRead> Stream<R> {
    pub fn new(input: R) -> Self {
        Self { input, at: 0, back: Vec::new() }
    }

    /// Bytes taken so far.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Fills the buffer, or says how many bytes there were.
    ///
    /// # Errors
    /// The reader's own; an end is none.
    pub fn fill(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = self.back.len().min(buffer.len());
        buffer[..filled].iter_mut().zip(self.back.drain(..filled)).for_each(|(to, from)| *to = from);
        while filled < buffer.len() {
            match self.input.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        self.at += filled as u64;
        Ok(filled)
    }

    /// Takes so many bytes into the buffer; false at the end.
    ///
    /// # Errors
    /// The reader's own.
    pub fn take(&mut self, buffer: &mut Vec<u8>, count: usize) -> io::Result<bool> {
        buffer.resize(count, 0);
        Ok(self.fill(buffer)? == count)
    }

    /// Passes over bytes; how many there were.
    ///
    /// # Errors
    /// The reader's own.
    pub fn skip(&mut self, count: u64) -> io::Result<u64> {
        let back = self.back.len().min(count as usize);
        self.back.drain(..back);
        let left = count - back as u64;
        let passed = back as u64 + io::copy(&mut io::Read::take(&mut self.input, left), &mut io::sink())?;
        self.at += passed;
        Ok(passed)
    }

    /// Bytes that were taken lie ahead again.
    pub fn put_back(&mut self, bytes: &[u8]) {
        self.back.splice(0..0, bytes.iter().copied());
        self.at -= bytes.len() as u64;
    }

    /// Passes over bytes until so many that lie ahead are what is looked for; how many lie before them, and whether they came.
    ///
    /// # Errors
    /// The reader's own.
    pub fn seek(&mut self, width: usize, is_it: impl Fn(&[u8]) -> bool) -> io::Result<(u64, bool)> {
        let mut ahead = vec![0; width];
        let mut passed = self.fill(&mut ahead)? as u64;
        if passed < width as u64 {
            return Ok((passed, false));
        }
        while !is_it(&ahead) {
            let mut byte = [0];
            if self.fill(&mut byte)? == 0 {
                return Ok((passed, false));
            }
            ahead.rotate_left(1);
            ahead[width - 1] = byte[0];
            passed += 1;
        }
        self.put_back(&ahead);
        Ok((passed - width as u64, true))
    }
}

/// So many bytes from a place on, as an array.
pub(super) fn bytes<const N: usize>(data: &[u8], at: usize) -> Option<[u8; N]> {
    data.get(at..at.checked_add(N)?)?.try_into().ok()
}
