//! The rig description that a running controller is to go on with: a file beside the shared memory, because a text
//! of any length is no message. Its revision goes with the request, so that no other text is taken for it.

use std::fs;
use std::path::PathBuf;

use super::deployment::Deployment;
use super::error::TransportError;
use super::ours::{ours_alone, write_whole};

impl Deployment {
    /// Lays down the text for a thruster's controller, whole or not at all.
    ///
    /// # Errors
    /// [`TransportError::Foreign`] if somebody else could write there, [`TransportError::File`] if the disk refuses.
    pub fn put_rig(&self, thruster: &str, text: &str) -> Result<(), TransportError> {
        let (path, draft) = (self.rig_file(thruster), self.beside(&format!("rig.{thruster}.new")));
        write_whole(&path, &draft, text.as_bytes())
    }

    /// The text that was laid down last.
    ///
    /// # Errors
    /// As [`Self::put_rig`], and if none was.
    pub fn take_rig(&self, thruster: &str) -> Result<String, TransportError> {
        let path = self.rig_file(thruster);
        ours_alone(&path)?;
        fs::read_to_string(&path).map_err(|error| TransportError::File { path, error })
    }

    fn rig_file(&self, thruster: &str) -> PathBuf {
        self.beside(&format!("rig.{thruster}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_comes_back_whole_and_a_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let deployment = Deployment::new(Some(&folder.path().join("shm")));
        assert!(matches!(deployment.take_rig("t1"), Err(TransportError::File { .. })));
        for text in ["[rig]\nname = \"one\"\n", "another"] {
            deployment.put_rig("t1", text).unwrap();
            assert_eq!(deployment.take_rig("t1").unwrap(), text);
        }
        std::os::unix::fs::symlink("/etc/hostname", folder.path().join("shm.rig.t2")).unwrap();
        assert!(matches!(deployment.take_rig("t2"), Err(TransportError::Foreign { .. })));
        assert!(matches!(deployment.put_rig("t2", "x"), Err(TransportError::Foreign { .. })));
    }
}
