//! What of a deployment other users of the machine can reach, see [`crate::ours`].

use std::fs;
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use super::error::TransportError;
use crate::ours;

/// As [`ours::ours_alone`].
pub(super) fn ours_alone(path: &Path) -> Result<(), TransportError> {
    Ok(ours::ours_alone(path)?)
}

/// As [`ours::nobody_else_may_replace`].
pub(super) fn nobody_else_may_replace(folder: &Path) -> Result<(), TransportError> {
    Ok(ours::nobody_else_may_replace(folder)?)
}

/// Makes what is ours in a folder of everybody's, under a prefix of ours, this user's alone. iceoryx2 opens one of its
/// objects to all, the segment that numbers its participants, and who writes there keeps every later one from starting.
pub(super) fn owner_only(folder: &Path, prefix: &str) -> Result<(), TransportError> {
    for (path, about) in objects(folder, prefix) {
        // What a stranger lays there is none that we use, and must not keep us from our own.
        if is_mine(&about) && about.mode() & 0o077 != 0 {
            closed(&path)?;
        }
    }
    Ok(())
}

/// As [`owner_only`], for whoever just made them and has no peers yet: in their place comes a copy that was never anybody
/// else's, so that who opened one in the moment between is left with what nobody reads any more. Strangers who were there
/// first are refused: we would have opened what they laid.
pub(super) fn owner_only_from_the_start(folder: &Path, prefix: &str) -> Result<(), TransportError> {
    for (path, about) in objects(folder, prefix) {
        if !is_mine(&about) {
            ours_alone(&path)?;
        }
        if about.mode() & 0o077 == 0 {
            continue;
        }
        closed(&path)?;
        let failed = |error| TransportError::File { path: path.clone(), error };
        let bytes = fs::read(&path).map_err(failed)?;
        let mut draft = path.clone().into_os_string();
        draft.push(".new");
        write_whole(&path, Path::new(&draft), &bytes)?;
    }
    Ok(())
}

/// What lies under a prefix; one that is removed this moment is nobody's.
pub(super) fn objects(folder: &Path, prefix: &str) -> impl Iterator<Item = (PathBuf, fs::Metadata)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .filter(move |entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()))
        .filter_map(|entry| Some((entry.path(), entry.metadata().ok()?)))
}

/// A file, and this user's.
pub(super) fn is_mine(about: &fs::Metadata) -> bool {
    about.is_file() && about.uid() == rustix::process::getuid().as_raw()
}

fn closed(path: &Path) -> Result<(), TransportError> {
    let failed = |error| TransportError::File { path: path.to_path_buf(), error };
    match fs::set_permissions(path, fs::Permissions::from_mode(0o600)) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        done => done.map_err(failed),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_opened_while_others_could_is_not_what_we_go_on_with() {
        let folder = tempfile::tempdir().unwrap();
        let segment = folder.path().join("kort_1_node.global_mgmt");
        let foreign = folder.path().join("other_segment");
        for path in [&segment, &foreign] {
            fs::write(path, "counts 1").unwrap();
            fs::set_permissions(path, fs::Permissions::from_mode(0o666)).unwrap();
        }
        let mode = |path: &Path| fs::metadata(path).unwrap().mode() & 0o777;
        let mut strangers = fs::OpenOptions::new().write(true).open(&segment).unwrap();
        owner_only_from_the_start(folder.path(), "kort_1_").unwrap();
        strangers.write_all(b"counts 9").unwrap();
        assert_eq!(fs::read_to_string(&segment).unwrap(), "counts 1");
        assert_eq!((mode(&segment), mode(&foreign)), (0o600, 0o666));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "no draft is left");
        // Whoever joins leaves it where it is, for its peers have it open.
        fs::set_permissions(&segment, fs::Permissions::from_mode(0o644)).unwrap();
        let inode = fs::metadata(&segment).unwrap().ino();
        owner_only(folder.path(), "kort_1_").unwrap();
        assert_eq!((mode(&segment), fs::metadata(&segment).unwrap().ino()), (0o600, inode));
        std::os::unix::fs::symlink(&foreign, folder.path().join("kort_1_link")).unwrap();
        owner_only(folder.path(), "kort_1_").unwrap();
        let refused = owner_only_from_the_start(folder.path(), "kort_1_");
        assert!(matches!(refused, Err(TransportError::Foreign { .. })), "{refused:?}");
        assert_eq!(mode(&foreign), 0o666);
    }
}
