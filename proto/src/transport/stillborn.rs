//! Shared memory whose maker was killed before it had a length. iceoryx2 (0.10.0) makes an object and gives it its
//! length in two steps, and whoever opens it waits between them without an end (`open_impl` of its
//! `dynamic_storage/posix_shared_memory.rs`, the arm for `MappingSizeIsZero`): the supervisor of a killed child would
//! never look again. Once the object is gone, who waits sees that there is none.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::error::TransportError;
use super::ours::{is_mine, objects};
use super::room::SHM;

/// Its maker, if it lives, is done between two looks: it is microseconds from the one step to the other.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Removes them, on a thread of its own since its owner may be the one who waits. Ends when it is dropped.
pub(super) struct Remover {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Remover {
    /// Begins to look at what lies under a prefix.
    pub(super) fn start(prefix: String) -> Result<Self, TransportError> {
        let (stop, stopped) = channel();
        let thread = std::thread::Builder::new()
            .name("stillborn".into())
            .spawn(move || look(&prefix, &stopped))
            .map_err(|error| TransportError::File { path: SHM.into(), error })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Remover {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn look(prefix: &str, stopped: &Receiver<()>) {
    let mut seen = BTreeSet::new();
    while stopped.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
        seen = remove_seen(Path::new(SHM), prefix, &seen);
    }
}

/// Removes what had no length at the last look (`seen`, by inode) and has none now; returns what had none for the first time.
fn remove_seen(folder: &Path, prefix: &str, seen: &BTreeSet<u64>) -> BTreeSet<u64> {
    let mut now = BTreeSet::new();
    for (path, about) in objects(folder, prefix).filter(|(_, about)| is_mine(about) && about.len() == 0) {
        if seen.contains(&about.ino()) {
            let _ = fs::remove_file(path);
        } else {
            now.insert(about.ino());
        }
    }
    now
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_length_at_two_looks_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, content) in
            [("kort_1_dead", ""), ("kort_1_slow", ""), ("kort_1_alive", "x"), ("kort_2_", "")]
        {
            fs::write(at(name), content).unwrap();
        }
        let seen = remove_seen(folder.path(), "kort_1_", &BTreeSet::new());
        assert!(at("kort_1_dead").exists(), "its maker may be at it");
        fs::write(at("kort_1_slow"), "x").unwrap();
        fs::write(at("kort_1_next"), "").unwrap();
        let seen = remove_seen(folder.path(), "kort_1_", &seen);
        assert!(!at("kort_1_dead").exists() && at("kort_1_slow").exists() && at("kort_1_alive").exists());
        assert!(at("kort_2_").exists(), "another deployment's");
        assert!(at("kort_1_next").exists());
        remove_seen(folder.path(), "kort_1_", &seen);
        assert!(!at("kort_1_next").exists());
    }
}
