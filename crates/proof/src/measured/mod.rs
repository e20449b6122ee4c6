//! Recordings that others measured, with an open key beside them (`answers.toml`).
//!
//! - [`key`] reads a key: what is present, absent, not to be told, of which size;
//! - [`compare`] holds a report against it;
//! - [`sizes`] knows which of our parameters a size in a key means;
//! - [`table`] counts and writes the table of `docs/measured-recordings.md`.

pub mod compare;
pub mod key;
pub mod sizes;
pub mod table;

use crate::{Diagnosis, File};

pub use compare::Compared;
pub use key::{Key, KeyError};
pub use table::Measured;

/// One folder: its key and its files.
#[derive(Clone, Debug, PartialEq)]
pub struct Set {
    /// Name of the folder.
    pub name: String,
    /// The key.
    pub key: Key,
    /// Recordings.
    pub recordings: Vec<File>,
    /// Rig files by name.
    pub rigs: Vec<(String, String)>,
}

impl Set {
    /// Text of the rig file that a recording of this set is diagnosed with.
    ///
    /// # Errors
    /// The key names a rig file that is not in the folder.
    pub fn rig(&self, recording: &str) -> Result<&str, KeyError> {
        let wanted = self.key.rig(recording);
        self.rigs.iter().find(|(name, _)| name == wanted).map(|(_, text)| text.as_str()).ok_or_else(|| {
            KeyError {
                set: self.name.clone(),
                field: "rig".into(),
                found: wanted.into(),
                allowed: format!(
                    "one of {}",
                    self.rigs.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
                ),
                hint: "a group without `rig` uses rig.toml".into(),
            }
        })
    }

    /// Diagnoses one recording and holds the report against the key.
    ///
    /// # Errors
    /// The key cannot be used.
    pub fn prove(
        &self,
        recording: &File,
        catalogue: &[&str],
        diagnosis: &dyn Diagnosis,
    ) -> Result<Compared, KeyError> {
        let rig = self.rig(&recording.name)?;
        let report = diagnosis.diagnose(std::slice::from_ref(recording), rig);
        Ok(compare::compare(&self.name, &recording.name, &self.key.of(&recording.name), report, catalogue))
    }
}
