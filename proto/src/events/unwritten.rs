//! Lines of the event log that the disk did not take, kept until it does.

use std::collections::VecDeque;
use std::io::{self, Write};

/// Most lines that are kept: a plain choice, some hundreds of kilobytes.
const KEPT: usize = 1000;

/// What is to be written, oldest first.
#[derive(Debug, Default)]
pub(super) struct Unwritten {
    lines: VecDeque<Vec<u8>>,
    /// How many were dropped for want of room.
    pub(super) lost: u64,
}

impl Unwritten {
    /// Keeps a line; of too many the oldest goes.
    pub(super) fn keep(&mut self, line: Vec<u8>) {
        if self.lines.len() >= KEPT {
            self.lines.pop_front();
            self.lost += 1;
        }
        self.lines.push_back(line);
    }

    /// Nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Writes what waits, as far as it goes, to a file that ends within a line where `torn`.
    pub(super) fn write_to(&mut self, file: &mut impl Write, mut torn: bool) -> io::Result<()> {
        while let Some(line) = self.lines.front() {
            // In one piece: somebody else may append too.
            let whole = if torn { [b"\n", line.as_slice()].concat() } else { line.clone() };
            file.write_all(&whole)?;
            torn = false;
            self.lines.pop_front();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk with room for so many bytes.
    struct Disk(Vec<u8>, usize);

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let room = self.1.saturating_sub(self.0.len()).min(bytes.len());
            self.0.extend(&bytes[..room]);
            if room == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(room) }
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_a_full_disk_did_not_take_is_written_when_there_is_room() {
        let (mut waiting, mut disk) = (Unwritten::default(), Disk(Vec::new(), 10));
        for line in ["first\n", "second\n", "third\n"] {
            waiting.keep(line.into());
        }
        assert!(waiting.write_to(&mut disk, false).is_err());
        assert!(!waiting.is_empty());
        disk.1 = 1000;
        waiting.write_to(&mut disk, true).unwrap();
        assert!(waiting.is_empty());
        assert_eq!(String::from_utf8(disk.0).unwrap(), "first\nseco\nsecond\nthird\n");
    }

    #[test]
    fn of_too_many_the_oldest_are_lost_and_counted() {
        let mut waiting = Unwritten::default();
        for n in 0..KEPT + 3 {
            waiting.keep(format!("{n}\n").into());
        }
        let mut disk = Disk(Vec::new(), usize::MAX);
        waiting.write_to(&mut disk, false).unwrap();
        assert!(disk.0.starts_with(b"3\n"));
        assert_eq!(waiting.lost, 3);
    }
}
