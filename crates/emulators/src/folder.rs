//! A device that the kernel shows as files, in a folder that looks like sysfs.
//!
//! What is written into a file in place, as a whole line, reaches the device; what the device shows is put under its name in one
//! piece, so that whoever opens it reads the old text or the new one, as in sysfs. Mischief is that of files: unplugged, they are
//! gone; silent or stale, they stay as they are; garbage and truncated, they hold no number. The others are of wires, and nothing here.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use kort_proto::transport::{monotonic_ns, realtime};

use crate::bench::{Bench, Mischief, PRIORITY, STEP, Shared, Truth, lock};

/// Where files are kept in memory, as those of the kernel are: on a disk that others write to, a writing may take longer than
/// a watchdog waits.
const IN_MEMORY: &str = "/dev/shm";

/// A device behind files.
pub trait InFiles: Send {
    /// Every file that it has, with its text.
    fn files(&self) -> Vec<(&'static str, String)>;

    /// Those of them that take something.
    fn takes(&self) -> &'static [&'static str];

    /// This was written into one of those.
    fn hear(&mut self, now_s: f64, file: &str, text: &str);

    /// Lives on to this instant.
    fn live(&mut self, now_s: f64);

    /// Its supply was cut and came back.
    fn restart(&mut self);

    /// It has a fault of its own from now on; zero: none.
    fn report(&mut self, code: u32);

    /// What is true at its motor.
    fn truth(&self) -> Truth;
}

impl Bench {
    /// Starts a device behind files, below the folder that [`Bench::port`] names.
    ///
    /// # Errors
    /// No folder is to be had.
    pub fn start_in_folder(device: impl InFiles + 'static) -> std::io::Result<Self> {
        let folder = tempfile::tempdir_in(IN_MEMORY).or_else(|_| tempfile::tempdir())?;
        let root = folder.path().join("sys");
        let files = Folder { root: root.clone(), shown: BTreeMap::new() };
        Self::serve(folder, root, move |shared| serve(device, files, &shared))
    }
}

fn serve(mut device: impl InFiles, mut folder: Folder, shared: &Arc<Mutex<Shared>>) {
    // As for a device on a wire.
    let _ = realtime(PRIORITY, false);
    let (began, mut dice) = (Instant::now(), 1);
    loop {
        std::thread::sleep(STEP);
        let (heard_ns, now_s) = (monotonic_ns(), began.elapsed().as_secs_f64());
        let Some(asked) = lock(shared).asked() else { return };
        if asked.restart {
            device.restart();
        }
        if let Some(code) = asked.report {
            device.report(code);
        }
        let mut heard = 0;
        for file in device.takes() {
            if let Some(text) = folder.taken(file) {
                heard += text.len();
                device.hear(now_s, file, text.trim());
            }
        }
        device.live(now_s);
        match asked.mischief {
            Mischief::Unplugged => folder.remove(),
            Mischief::Silent | Mischief::Stale if !folder.shown.is_empty() => (),
            mischief => {
                for (file, text) in device.files() {
                    // What kort wrote stays as it was written.
                    if !(device.takes().contains(&file) && folder.shown.contains_key(file)) {
                        folder.show(file, spoiled(text, mischief, &mut dice));
                    }
                }
            }
        }
        lock(shared).lived(heard_ns, device.truth(), heard as u64);
    }
}

/// A text as this mischief leaves it.
fn spoiled(text: String, mischief: Mischief, dice: &mut u32) -> Vec<u8> {
    let mut text = text.into_bytes();
    match mischief {
        Mischief::Garbage => text.iter_mut().for_each(|byte| {
            *dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // No digit, whatever it is.
            *byte = 0x80 | (*dice >> 24) as u8;
        }),
        Mischief::Truncated => text.clear(),
        _ => (),
    }
    text
}

/// Files below a folder.
struct Folder {
    root: PathBuf,
    /// What each holds.
    shown: BTreeMap<&'static str, Vec<u8>>,
}

impl Folder {
    /// What was written into a file since it was asked last: whole lines only, and the same again is nothing.
    fn taken(&mut self, file: &'static str) -> Option<String> {
        let text = std::fs::read(self.root.join(file)).ok().filter(|text| text.ends_with(b"\n"))?;
        let shown = self.shown.get_mut(file).filter(|shown| **shown != text)?;
        shown.clone_from(&text);
        String::from_utf8(text).ok()
    }

    fn show(&mut self, file: &'static str, text: Vec<u8>) {
        if self.shown.get(file) == Some(&text) {
            return;
        }
        let (path, new) = (self.root.join(file), self.root.join("new"));
        let put = |path: &Path| -> std::io::Result<()> {
            if let Some(parent) = path.parent() {
                std::fs::create_dir_all(parent)?;
            }
            std::fs::write(&new, &text)?;
            std::fs::rename(&new, path)
        };
        if put(&path).is_ok() {
            self.shown.insert(file, text);
        }
    }

    fn remove(&mut self) {
        if !self.shown.is_empty() {
            let _ = std::fs::remove_dir_all(&self.root);
            self.shown.clear();
        }
    }
}
