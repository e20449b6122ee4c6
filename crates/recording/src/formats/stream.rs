//! Bytes of a log with the place they come from: a log that ends in the middle of a record is a torn one, not a broken
//! program.

use std::io::{self, BufRead};

/// A reader that knows how far it is.
pub(super) struct Stream<R> {
    input: R,
    at: u64,
}

impl<R: BufRead> Stream<R> {
    pub fn new(input: R) -> Self {
        Self { input, at: 0 }
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
        let mut filled = 0;
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
        let passed = io::copy(&mut io::Read::take(&mut self.input, count), &mut io::sink())?;
        self.at += passed;
        Ok(passed)
    }

    /// Passes over bytes until the pattern has gone by; how many lie before it, and whether it came.
    ///
    /// # Errors
    /// The reader's own.
    pub fn seek(&mut self, pattern: &[u8]) -> io::Result<(u64, bool)> {
        let mut last = Vec::with_capacity(pattern.len());
        let mut passed = 0_u64;
        loop {
            let mut byte = [0];
            if self.fill(&mut byte)? == 0 {
                return Ok((passed, false));
            }
            passed += 1;
            if last.len() == pattern.len() {
                last.remove(0);
            }
            last.push(byte[0]);
            if last == pattern {
                return Ok((passed - pattern.len() as u64, true));
            }
        }
    }
}

/// So many bytes from a place on, as an array.
pub(super) fn bytes<const N: usize>(data: &[u8], at: usize) -> Option<[u8; N]> {
    data.get(at..at.checked_add(N)?)?.try_into().ok()
}
