//! Files that a process may have open: iceoryx2 reports a lack of them as one of shared memory.

use rustix::process::{Resource, getrlimit, setrlimit};

use super::error::TransportError;

/// Files that one process opens for its own, and for each thruster.
const OPEN_FILES: (u64, u64) = (96, 64);
/// So few left are none: what was tried gave back those it had.
const FEW: u64 = 16;

/// Lets this process open as many files as the system permits, and refuses to go on with too few.
pub fn allow_files(thrusters: u64) -> Result<(), TransportError> {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum.map(|most| most.min(1 << 16)).max(limit.current);
    let _ = setrlimit(Resource::Nofile, limit);
    let needed = OPEN_FILES.0 + OPEN_FILES.1 * thrusters;
    match getrlimit(Resource::Nofile).current {
        Some(limit) if limit < needed => Err(TransportError::OpenFiles { limit, needed }),
        _ => Ok(()),
    }
}

/// Why something failed just now, where that is for want of open files.
pub fn none_left() -> Option<TransportError> {
    let limit = getrlimit(Resource::Nofile).current?;
    // The folder itself is a file too: one that cannot be opened says it all.
    let open = std::fs::read_dir("/proc/self/fd").map_or(limit, |open| open.count() as u64);
    (open + FEW > limit).then_some(TransportError::OpenFiles { limit, needed: open + OPEN_FILES.1 })
}
