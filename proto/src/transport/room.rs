//! Room in `/dev/shm`. A page there is taken when it is first written, and a process that writes where no page is
//! left ends by SIGBUS: by then nobody can answer for it. So whoever opens a port sees first that there is room for it,
//! and takes every page right away; what a full `/dev/shm` refuses, it refuses at the start, in words. iceoryx2 has no
//! option for it (its `zero_memory` would do the same, but is not to be reached from a service's builder).

use std::fs::{self, File};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::fs::{FallocateFlags, fallocate, statvfs};
use rustix::io::Errno;

use super::error::TransportError;

/// Where shared memory lies.
pub const SHM: &str = "/dev/shm";
/// What the services of one thruster and its peers take (7.5 MB), with as much again for the successors of killed
/// processes, KiB.
const THRUSTER_KIB: u64 = 16_384;
/// Files they are.
const THRUSTER_FILES: u64 = 200;
/// What a port takes beside its samples, and two for those that open one at the same time, KiB.
const PORT_KIB: u64 = 128;
/// Files that a port takes at most: its samples, and a connection with each of its peers.
const PORT_FILES: u64 = 16;

/// Is there room for the services of this many thrusters?
pub fn room_for_thrusters(thrusters: u64) -> Result<(), TransportError> {
    room(THRUSTER_KIB * thrusters, THRUSTER_FILES * thrusters)
}

/// Is there room for a port with samples of so many bytes?
pub fn room_for(bytes: u64) -> Result<(), TransportError> {
    room(bytes.div_ceil(1024) + PORT_KIB, PORT_FILES)
}

/// Where it cannot be said, there is.
fn room(needed_kib: u64, needed_files: u64) -> Result<(), TransportError> {
    let Ok(shm) = statvfs(SHM) else { return Ok(()) };
    let free_kib = shm.f_bavail.saturating_mul(shm.f_frsize) / 1024;
    // A file system that counts no files says zero of zero.
    let free_files = if shm.f_files == 0 { u64::MAX } else { shm.f_favail };
    if free_kib < needed_kib || free_files < needed_files {
        return Err(TransportError::Room { free_kib, free_files, needed_kib, needed_files });
    }
    Ok(())
}

/// Takes every page of the objects whose names begin so. Contents stay as they are, so peers may be using them.
pub fn reserve(prefix: &str) -> Result<(), TransportError> {
    reserve_in(Path::new(SHM), prefix)
}

fn reserve_in(folder: &Path, prefix: &str) -> Result<(), TransportError> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|e| e.file_name().as_encoded_bytes().starts_with(prefix.as_bytes())) {
        // One that is just being made, or removed, is its maker's to reserve.
        let Ok(file) = File::options().read(true).write(true).open(entry.path()) else { continue };
        let Ok(about) = file.metadata() else { continue };
        let taken = about.blocks() * 512;
        if taken >= about.len() {
            continue;
        }
        let done = rustix::io::retry_on_intr(|| fallocate(&file, FallocateFlags::KEEP_SIZE, 0, about.len()));
        // A file system that takes pages in another way has nothing to reserve.
        if matches!(done, Err(Errno::NOSPC | Errno::NOMEM)) {
            room((about.len() - taken).div_ceil(1024), 1)?;
            return Err(TransportError::iceoryx(
                format!("{}: reserving {} bytes", entry.path().display(), about.len()),
                done,
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_taken_and_contents_stay() {
        let folder = tempfile::tempdir_in(SHM).unwrap();
        let file = folder.path().join("kort_1_samples");
        let foreign = folder.path().join("other");
        for path in [&file, &foreign] {
            fs::write(path, "begin").unwrap();
            File::options().write(true).open(path).unwrap().set_len(1 << 20).unwrap();
        }
        reserve_in(folder.path(), "kort_1_").unwrap();
        assert_eq!(fs::metadata(&file).unwrap().blocks() * 512, 1 << 20);
        assert_eq!(&fs::read(&file).unwrap()[..8], b"begin\0\0\0");
        assert!(fs::metadata(&foreign).unwrap().blocks() * 512 < 1 << 20, "another's is left alone");
    }

    #[test]
    fn more_than_there_is_is_refused_in_words() {
        let error = room_for(1 << 60).unwrap_err();
        assert!(matches!(error, TransportError::Room { .. }), "{error}");
        assert!(error.to_string().contains("hint:"), "{error}");
    }
}
