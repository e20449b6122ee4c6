//! An output that ends like a whole MCAP file whenever it is looked at, and is written on all the same.
//!
//! Readers that go by a file's end (Python's `make_reader`, Foxglove) refuse one without. So behind each piece stands
//! the shortest end there is, "end of data" and a footer without an index, and the next piece is written over it.

use std::io::{self, ErrorKind, Seek, SeekFrom, Write};

/// Written in pieces of this size at most, bytes.
const PIECE_BYTES: usize = 128 * 1024;

/// "End of data" without a checksum (13 bytes), a footer that names no summary (29), and the magic.
const END: [u8; 50] = {
    let mut end = [0; 50];
    (end[0], end[1]) = (mcap::records::op::DATA_END, 4);
    (end[13], end[14]) = (mcap::records::op::FOOTER, 20);
    let mut i = 0;
    while i < mcap::MAGIC.len() {
        end[42 + i] = mcap::MAGIC[i];
        i += 1;
    }
    end
};

/// Kind of a record that is nobody's business; MCAP leaves those from here on to whoever writes.
const PRIVATE: u8 = 0x80;

/// The output.
#[derive(Debug)]
pub struct Ended<W: Write + Seek> {
    output: W,
    /// What the writer said since the last piece.
    piece: Vec<u8>,
    /// Where it goes.
    at: u64,
    /// Why the output refused; nothing is written after that, for a gap would make the rest unreadable.
    refused: Option<ErrorKind>,
}

impl<W: Write + Seek> Ended<W> {
    /// Goes on where the output stands.
    pub(super) fn new(mut output: W) -> io::Result<Self> {
        let at = output.stream_position()?;
        Ok(Self { output, piece: Vec::new(), at, refused: None })
    }

    fn put(&mut self) -> io::Result<()> {
        if let Some(refused) = self.refused {
            return Err(refused.into());
        }
        let said = self.piece.len();
        // A piece that is the writer's own end, with its index, gets none of ours; the magic alone is a beginning.
        if !self.piece.ends_with(mcap::MAGIC) || self.at + said as u64 == mcap::MAGIC.len() as u64 {
            self.piece.extend_from_slice(&END);
        }
        let done = self.over(self.at);
        self.piece.clear();
        match &done {
            Ok(()) => self.at += said as u64,
            Err(error) => {
                self.refused = Some(error.kind());
                let _ = self.end_before_the_torn();
            }
        }
        done
    }

    /// Part of a piece stands where the end was. Its room is ours still: it is declared a record of no known kind,
    /// which readers pass over, and its last bytes are the end.
    fn end_before_the_torn(&mut self) -> io::Result<()> {
        let length = self.output.seek(SeekFrom::End(0))?;
        let (head, end) = (1 + size_of::<u64>() as u64, END.len() as u64);
        match length.saturating_sub(self.at).checked_sub(head + end) {
            Some(torn) => {
                self.piece.push(PRIVATE);
                self.piece.extend_from_slice(&torn.to_le_bytes());
                self.over(self.at)?;
                self.piece.clear();
                self.piece.extend_from_slice(&END);
                self.over(length - end)
            }
            None => {
                self.piece.extend_from_slice(&END);
                self.over(self.at)
            }
        }
    }

    fn over(&mut self, at: u64) -> io::Result<()> {
        self.output.seek(SeekFrom::Start(at))?;
        self.output.write_all(&self.piece)?;
        self.output.flush()
    }
}

impl<W: Write + Seek> Write for Ended<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(refused) = self.refused {
            return Err(refused.into());
        }
        self.piece.extend_from_slice(bytes);
        if self.piece.len() > PIECE_BYTES {
            self.put()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.piece.is_empty() { Ok(()) } else { self.put() }
    }
}

/// `mcap::Writer` asks where it is, and keeps to one direction here.
impl<W: Write + Seek> Seek for Ended<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.at + self.piece.len() as u64),
            _ => Err(ErrorKind::Unsupported.into()),
        }
    }
}
