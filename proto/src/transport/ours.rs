//! Files and folders that other users of the machine can reach: what they laid there is neither believed nor written to.

use std::fs;
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use super::error::TransportError;

/// A file or folder of the deployment, if it is there already, must be this user's, and nobody else may write it.
pub(super) fn ours_alone(path: &Path) -> Result<(), TransportError> {
    let Ok(about) = fs::symlink_metadata(path) else { return Ok(()) };
    let foreign = |why: String| Err(TransportError::Foreign { path: path.to_path_buf(), why });
    if about.file_type().is_symlink() {
        return foreign("is a link".into());
    }
    let me = rustix::process::getuid().as_raw();
    if about.uid() != me {
        return foreign(format!("belongs to user {}, this is user {me}", about.uid()));
    }
    if about.mode() & 0o022 != 0 {
        return foreign(format!("may be written by others (mode {:o})", about.mode() & 0o7777));
    }
    Ok(())
}

/// The folder that holds root and lock: where others may write, they must not be able to replace what is ours.
pub(super) fn nobody_else_may_replace(folder: &Path) -> Result<(), TransportError> {
    let Ok(about) = fs::metadata(folder) else { return Ok(()) };
    let others_write = about.mode() & 0o002 != 0;
    let sticky = about.mode() & 0o1000 != 0;
    let owner = about.uid();
    let me = rustix::process::getuid().as_raw();
    if (others_write && !sticky) || (owner != me && owner != 0) {
        return Err(TransportError::Foreign {
            path: folder.to_path_buf(),
            why: format!(
                "user {owner} or others may replace what is in it (mode {:o})",
                about.mode() & 0o7777
            ),
        });
    }
    Ok(())
}

/// Writes a file whole or not at all, by way of a draft beside it. Neither may be anybody else's, and a link is not
/// followed, whenever it was laid.
pub(super) fn write_whole(path: &Path, draft: &Path, bytes: &[u8]) -> Result<(), TransportError> {
    ours_alone(path)?;
    ours_alone(draft)?;
    let write = || {
        // What an earlier process left of its own. Somebody else's, laid this instant, stays and is in the way.
        let _ = fs::remove_file(draft);
        let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(draft)?;
        file.write_all(bytes)?;
        fs::rename(draft, path)
    };
    write().map_err(|error| TransportError::File { path: path.to_path_buf(), error })
}
