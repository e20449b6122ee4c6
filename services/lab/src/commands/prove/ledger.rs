//! The ledger of used seeds, as a file.

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use kort_proof::Stamp;
use kort_proof::ledger::{Ledger, entry};

use crate::failure::{Failure, read_text};

/// A ledger and where it stands.
pub struct File {
    /// What it holds.
    pub seeds: Ledger,
    path: PathBuf,
    there: bool,
}

/// Opens one; where there is no such file, no seed was used and none will be entered.
///
/// # Errors
/// It is there and cannot be read.
pub fn open(path: &Path) -> Result<File, Failure> {
    let there = path.exists();
    let seeds = if there {
        Ledger::read(&read_text(path)?).map_err(|error| Failure::in_file(path, error))?
    } else {
        Ledger::default()
    };
    Ok(File { seeds, path: path.to_owned(), there })
}

impl File {
    /// Enters seeds before they are looked at.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn enter(&self, seeds: &Range<u64>, stamp: &Stamp, what: &str) -> Result<(), Failure> {
        if !self.there {
            eprintln!("{} is not there: the seeds are entered nowhere", self.path.display());
            return Ok(());
        }
        let file = std::fs::OpenOptions::new().append(true).open(&self.path);
        let written = file.and_then(|mut file| file.write_all(entry(seeds, stamp, what).as_bytes()));
        written.map_err(|error| Failure::unwritten(&self.path, error))
    }
}
