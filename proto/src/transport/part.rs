//! Locks beside the root, which the kernel gives back with the process that holds them: who owns a deployment, and who plays
//! which part in it. Two of one part would command against each other: the younger is heard, and when it ends, nobody.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, flock};

use super::deployment::Deployment;
use super::error::TransportError;
use super::ours::ours_alone;

/// Whoever was killed this moment, or has done its last tick, is gone within this time: its successor waits for it.
const GONE_WITHIN: Duration = Duration::from_secs(1);
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A part in a deployment, held until this is dropped or its process ends, however it does.
#[derive(Debug)]
pub struct Part {
    _lock: fs::File,
}

impl Deployment {
    /// Takes a part (`gateway`, or `servo` and `controller` of a thruster) that nobody else may play here at the same time.
    ///
    /// # Errors
    /// [`TransportError::Taken`] names the process that plays it, [`TransportError::Foreign`] and [`TransportError::File`]
    /// say why the lock cannot be had.
    pub fn take_part(&self, role: &str, thruster: Option<&str>) -> Result<Part, TransportError> {
        let (name, part) = match thruster {
            Some(id) => (format!("{role}-{id}.lock"), format!("{role} of {id}")),
            None => (format!("{role}.lock"), role.to_owned()),
        };
        self.in_our_hands()?;
        let path = self.beside(&name);
        ours_alone(&path)?;
        let taken = |holder| TransportError::Taken { root: self.root().to_owned(), part, holder };
        locked(&path)?.map(|lock| Part { _lock: lock }).map_err(taken)
    }

    /// Is this the present generation, and does its owner live? What a killed one leaves stays where it is until the next
    /// clears it away.
    pub fn stands(&self, generation: u64) -> bool {
        self.generation() == Some(generation) && self.owner_lives()
    }

    /// Does somebody hold the owner's lock?
    pub(super) fn owner_lives(&self) -> bool {
        let mut options = fs::OpenOptions::new();
        match options.read(true).custom_flags(libc::O_NOFOLLOW).open(self.beside("lock")) {
            // Given back at once: an owner that comes this moment tries again.
            Ok(lock) => flock(&lock, FlockOperation::NonBlockingLockShared).is_err(),
            // Where no file can be opened, whoever opens the next one says so.
            Err(error) => error.kind() != std::io::ErrorKind::NotFound,
        }
    }
}

/// Takes the lock at this path and writes down who has it; what its holder wrote if it is taken.
pub(super) fn locked(path: &Path) -> Result<Result<fs::File, String>, TransportError> {
    let failed = |error| TransportError::File { path: path.to_owned(), error };
    let mut options = fs::OpenOptions::new();
    options.create(true).truncate(false).write(true).read(true).mode(0o600);
    // A link that somebody laid here would have us write elsewhere.
    let mut lock = options.custom_flags(libc::O_NOFOLLOW).open(path).map_err(failed)?;
    let end = Instant::now() + GONE_WITHIN;
    while flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
        if Instant::now() >= end {
            let mut holder = String::new();
            let _ = lock.read_to_string(&mut holder);
            return Ok(Err(if holder.is_empty() { "process unknown".into() } else { holder }));
        }
        std::thread::sleep(LOOK_EVERY);
    }
    // Only words for whoever comes second: a disk that does not take them keeps nobody from their part.
    let _ = lock.set_len(0).and_then(|()| write!(lock, "process {}", std::process::id()));
    Ok(Ok(lock))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_played_by_one_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let deployment = Deployment::new(Some(&folder.path().join("not/there/shm")));
        let gateway = deployment.take_part("gateway", None).unwrap();
        let refused = deployment.take_part("gateway", None).unwrap_err().to_string();
        let holder = format!("the gateway already runs here (process {})", std::process::id());
        assert!(refused.contains(&holder) && refused.contains("hint:"), "{refused}");
        let _one = deployment.take_part("controller", Some("t1")).unwrap();
        let _other = deployment.take_part("controller", Some("t2")).unwrap();
        assert!(deployment.take_part("controller", Some("t1")).unwrap_err().to_string().contains("of t1"));
        drop(gateway);
        deployment.take_part("gateway", None).unwrap();
    }

    /// One that is about to end, or was killed and is not gone yet, keeps no successor from starting.
    #[test]
    fn a_successor_waits_for_one_that_is_about_to_go() {
        let folder = tempfile::tempdir().unwrap();
        let deployment = Deployment::new(Some(&folder.path().join("shm")));
        let first = deployment.take_part("gateway", None).unwrap();
        let goes = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            drop(first);
        });
        deployment.take_part("gateway", None).unwrap();
        goes.join().unwrap();
    }

    #[test]
    fn a_generation_stands_no_longer_than_its_owner() {
        let folder = tempfile::tempdir().unwrap();
        let deployment = Deployment::new(Some(&folder.path().join("shm")));
        fs::write(deployment.beside("generation"), "7 1").unwrap();
        assert!(!deployment.stands(7), "nobody ever owned it");
        assert!(deployment.wait_for_generation(Duration::ZERO).is_err());
        let lock = locked(&deployment.beside("lock")).unwrap().unwrap();
        assert!(deployment.stands(7) && !deployment.stands(8));
        assert_eq!(deployment.wait_for_generation(Duration::ZERO).unwrap(), 7);
        drop(lock);
        assert!(!deployment.stands(7), "its owner is gone");
    }
}
