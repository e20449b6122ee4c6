//! Files and folders that other users of the machine can reach: what they laid there is neither believed nor written to.

use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Why a file or folder is not believed: somebody else could have written it.
#[derive(Debug, PartialEq, Eq)]
pub struct Foreign {
    /// The file or folder.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

fn foreign(path: &Path, why: String) -> Result<(), Foreign> {
    Err(Foreign { path: path.to_path_buf(), why })
}

fn me() -> u32 {
    rustix::process::getuid().as_raw()
}

/// A file or folder, if it is there already, must be this user's, and nobody else may write it.
///
/// # Errors
/// [`Foreign`] says why it is not.
pub fn ours_alone(path: &Path) -> Result<(), Foreign> {
    let Ok(about) = fs::symlink_metadata(path) else { return Ok(()) };
    if about.file_type().is_symlink() {
        return foreign(path, "is a link".into());
    }
    if about.uid() != me() {
        return foreign(path, format!("belongs to user {}, this is user {}", about.uid(), me()));
    }
    only_its_owner_writes(path, &about)
}

/// The same for what the deployment's owner may have put where it suits them: root's is as good as ours, and so is what a
/// link of either leads to.
///
/// # Errors
/// [`Foreign`] says why somebody else could have written it.
pub fn ours_or_roots(path: &Path) -> Result<(), Foreign> {
    let of_whom = |about: &fs::Metadata, what: &str| match about.uid() {
        owner if owner == me() || owner == 0 => Ok(()),
        owner => foreign(path, format!("{what} user {owner}, this is user {}", me())),
    };
    let Ok(about) = fs::symlink_metadata(path) else { return Ok(()) };
    of_whom(&about, if about.file_type().is_symlink() { "is a link of" } else { "belongs to" })?;
    let Ok(about) = fs::metadata(path) else { return Ok(()) };
    of_whom(&about, "belongs to")?;
    only_its_owner_writes(path, &about)
}

fn only_its_owner_writes(path: &Path, about: &fs::Metadata) -> Result<(), Foreign> {
    if about.mode() & 0o022 != 0 {
        return foreign(path, format!("may be written by others (mode {:o})", about.mode() & 0o7777));
    }
    Ok(())
}

/// The folder that something of ours lies in: where others may write, they must not be able to replace what is ours.
///
/// # Errors
/// [`Foreign`] says who could.
pub fn nobody_else_may_replace(folder: &Path) -> Result<(), Foreign> {
    let link = fs::symlink_metadata(folder).ok().filter(|about| about.file_type().is_symlink());
    if let Some(owner) = link.map(|about| about.uid()).filter(|owner| *owner != me() && *owner != 0) {
        return foreign(folder, format!("is a link of user {owner}, this is user {}", me()));
    }
    let Ok(about) = fs::metadata(folder) else { return Ok(()) };
    let (mode, owner) = (about.mode(), about.uid());
    let others_write = mode & 0o002 != 0;
    let sticky = mode & 0o1000 != 0;
    if (others_write && !sticky) || (owner != me() && owner != 0) {
        let why = format!("user {owner} or others may replace what is in it (mode {:o})", mode & 0o7777);
        return foreign(folder, why);
    }
    Ok(())
}

/// Something of ours and the folder it lies in.
///
/// # Errors
/// As [`ours_or_roots`] and [`nobody_else_may_replace`].
pub fn in_our_hands(path: &Path) -> Result<(), Foreign> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    // Outermost first: it is what is to be mended.
    folder.map_or(Ok(()), nobody_else_may_replace)?;
    ours_or_roots(path)
}

/// Makes a folder, and those above it, which only this user may write, whatever its umask leaves to others.
///
/// # Errors
/// The system refuses.
pub fn make_folder(folder: &Path) -> io::Result<()> {
    fs::DirBuilder::new().recursive(true).mode(0o755).create(folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};

    #[test]
    fn what_others_could_write_or_replace_is_not_in_our_hands() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state");
        let file = state.join("tokens.toml");
        let mode = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
        assert_eq!(in_our_hands(&file), Ok(()), "nothing is there yet");
        make_folder(&state).unwrap();
        fs::write(&file, "").unwrap();
        mode(&file, 0o600);
        assert_eq!(in_our_hands(&file), Ok(()));
        for (path, bad, good) in [(&file, 0o666, 0o600), (&file, 0o620, 0o640), (&state, 0o777, 0o1777)] {
            mode(path, bad);
            assert_eq!(in_our_hands(&file).unwrap_err().path, *path, "{bad:o}");
            mode(path, good);
            assert_eq!(in_our_hands(&file), Ok(()), "{good:o}");
        }
        // One's own link to one's own file is one's own doing; what a stranger may write it does not make any better.
        let link = state.join("link");
        symlink(&file, &link).unwrap();
        assert_eq!(in_our_hands(&link), Ok(()));
        assert_eq!(ours_alone(&link).unwrap_err().why, "is a link");
        mode(&file, 0o666);
        assert!(in_our_hands(&link).is_err());
        if rustix::process::geteuid().is_root() {
            mode(&file, 0o600);
            std::os::unix::fs::lchown(&link, Some(65534), None).unwrap();
            assert!(in_our_hands(&link).unwrap_err().why.starts_with("is a link of user 65534"));
        }
    }
}
