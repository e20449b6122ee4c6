//! Work that the service started in a process of its own: behind everything else on the machine, and not without it.

use std::process::ExitCode;

#[cfg(feature = "lab")]
use kort_proto::transport::idle;
#[cfg(feature = "lab")]
use rustix::process::nice;
use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};

use crate::{FAILED, fail};

/// Makes this process a job of its parent: it ends with it, and unless it commands a drive it runs only where nothing
/// else wants the processor.
///
/// # Errors
/// The parent is gone already.
#[cfg(feature = "lab")]
pub fn begin(parent: u32, drives: bool) -> Result<(), ExitCode> {
    follow(parent, Signal::KILL)?;
    if drives {
        return Ok(());
    }
    // Where the one is not permitted the other still helps.
    let _ = nice(19);
    if let Some(words) = idle() {
        eprintln!("warning: {words}");
    }
    Ok(())
}

/// Has this process get a signal when its parent ends.
///
/// # Errors
/// The parent is gone already.
pub fn follow(parent: u32, last: Signal) -> Result<(), ExitCode> {
    let _ = set_parent_process_death_signal(Some(last));
    // The parent may have ended before the line above.
    let theirs = i32::try_from(parent).ok().and_then(Pid::from_raw);
    if theirs.is_none() || getppid() != theirs {
        return Err(fail(FAILED, &format!("process {parent} did not start this one, or is gone")));
    }
    Ok(())
}
