//! The engine of `kort prove`. It hands recordings and rig files to a diagnosis, opens the answers
//! afterwards, and counts. Reports are read as the JSON that `kort diagnose --json` prints; no
//! equation and no diagnosis code is known here.
//!
//! - [`blind`]: cases of the truth simulation, sealed; [`score`] opens one, [`tally`] counts all;
//! - [`measured`]: recordings that others measured, with an open key beside them;
//! - [`concealed`]: exact changes hidden in measured recordings;
//! - [`calibrate`]: every probability that was stated, with what became of it, in folds;
//! - [`temper`]: how far costs count as odds, fitted on some cases and tested on those left out;
//! - [`trust`]: how sure a name may be that no other comes near, by what leaving it out costs;
//! - [`ledger`]: seeds that were used, so that none is used twice.

pub mod blind;
pub mod calibrate;
pub mod concealed;
pub mod ledger;
pub mod measure;
pub mod measured;
pub mod report;
pub mod score;
pub mod tally;
pub mod temper;
pub mod trust;

use serde_json::Value;

/// One recording as a file: name and bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct File {
    /// Name for messages; its end tells the format.
    pub name: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// What a run of the proof was made with.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamp {
    /// Commit, with `+` behind it where the tree has changes; `unknown` outside a checkout.
    pub commit: String,
    /// Hash of the diagnosis constants; `none` where there is no such file.
    pub constants: String,
}

/// A diagnosis to be proved.
pub trait Diagnosis: Sync {
    /// The report (JSON of `kort diagnose`) on recordings of one rig, with the `seconds` it took.
    ///
    /// # Errors
    /// The recording or the rig is refused: the message a user would see.
    fn diagnose(&self, recordings: &[File], rig_toml: &str) -> Result<Value, String>;
}
