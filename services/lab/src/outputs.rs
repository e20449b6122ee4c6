//! What a command reads and what it writes, looked at before it begins: no hour of work is lost for a folder that is not
//! there, and nothing that somebody measured or stated is written over.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use kort_recording::{ColumnMap, logs_in};

use crate::failure::Failure;
use crate::files;

/// The files of a command line.
#[derive(Debug, Default)]
pub struct Named {
    /// What each is, and where.
    read: Vec<(&'static str, PathBuf)>,
    /// The option that names each, where, and the ending that it must have.
    written: Vec<(&'static str, PathBuf, Option<&'static str>)>,
}

impl Named {
    /// A file that is read, or a folder of logs.
    pub fn reads(mut self, what: &'static str, path: &Path) -> Self {
        let inside = if path.is_dir() { logs_in(path) } else { vec![path.to_owned()] };
        self.read.extend(inside.into_iter().map(|path| (what, path)));
        self
    }

    /// A rig description, by path or name.
    pub fn reads_rig(self, wanted: Option<&Path>) -> Self {
        match wanted.and_then(files::rig_file) {
            Some(path) => self.reads("rig description", &path),
            None => self,
        }
    }

    /// A column map, by path or name.
    pub fn reads_map(self, wanted: Option<&str>) -> Self {
        match wanted.and_then(ColumnMap::file) {
            Some(path) => self.reads("column map", &path),
            None => self,
        }
    }

    /// A file that is written, if it is.
    pub fn writes(mut self, option: &'static str, path: Option<&Path>) -> Self {
        self.written.extend(path.map(|path| (option, path.to_owned(), None)));
        self
    }

    /// A TOML file that is written, if it is: under another ending nothing would read it.
    pub fn writes_toml(mut self, option: &'static str, path: Option<&Path>) -> Self {
        self.written.extend(path.map(|path| (option, path.to_owned(), Some("toml"))));
        self
    }

    /// Says what is wrong with the files that are to be written.
    ///
    /// # Errors
    /// One is read too, is named twice, has an ending that is not its own, or cannot be written.
    pub fn check(&self) -> Result<(), Failure> {
        for (at, (option, path, ending)) in self.written.iter().enumerate() {
            let shown = path.display();
            if let Some((what, _)) = self.read.iter().find(|(_, read)| same(read, path)) {
                return Err(Failure::input(format!(
                    "{option} {shown}: this is the {what} that is read, and would be written over\nhint: name another file after {option}"
                )));
            }
            if let Some((other, ..)) = self.written[..at].iter().find(|(_, other, _)| same(other, path)) {
                return Err(Failure::input(format!(
                    "{option} {shown}: {other} writes to the same file\nhint: name two files"
                )));
            }
            if let Some(ending) = ending.filter(|ending| !ends(path, ending)) {
                return Err(Failure::input(format!(
                    "{option} {shown}: what is written is TOML, and the name must end in .{ending}\nhint: {option} {}",
                    path.with_extension(ending).display()
                )));
            }
            writable(option, path)?;
        }
        Ok(())
    }
}

/// Whether two paths are one file: by another spelling, or by a link of whatever kind.
fn same(a: &Path, b: &Path) -> bool {
    match (a.metadata(), b.metadata()) {
        // To devices and pipes two may write.
        (Ok(a), Ok(b)) => a.is_file() && (a.dev(), a.ino()) == (b.dev(), b.ino()),
        (Err(_), Err(_)) => place(a) == place(b),
        _ => false,
    }
}

/// Links that lead one to the next before this is taken for a circle.
const LINKS: usize = 40;

/// Where a file that is not there yet will be, whatever the spelling; a link to it leads there too.
fn place(path: &Path) -> PathBuf {
    let mut path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for _ in 0..LINKS {
        match (path.parent(), path.read_link()) {
            (Some(folder), Ok(target)) => path = folder.join(target),
            _ => break,
        }
    }
    match (path.parent().map(Path::canonicalize), path.file_name()) {
        (Some(Ok(folder)), Some(name)) => folder.join(name),
        _ => path,
    }
}

/// Whether it ends so, or is a device or a pipe, which has no ending.
fn ends(path: &Path, ending: &str) -> bool {
    let is_other = |found: Metadata| !found.is_file() && !found.is_dir();
    path.metadata().is_ok_and(is_other)
        || path.extension().is_some_and(|found| found.to_string_lossy().eq_ignore_ascii_case(ending))
}

/// Whether a file can be written: what is there already stays, and nothing new is left behind by a run that fails.
fn writable(option: &str, path: &Path) -> Result<(), Failure> {
    let cannot = |why: &dyn std::fmt::Display| {
        Failure::input(format!(
            "{option} {}: cannot be written: {why}\nhint: check that the folder exists and may be written",
            path.display()
        ))
    };
    let there = path.metadata();
    if there.as_ref().is_ok_and(Metadata::is_dir) {
        return Err(cannot(&"it is a folder"));
    }
    // Opening a pipe would wait for its reader.
    if there.as_ref().is_ok_and(|found| !found.is_file()) {
        return Ok(());
    }
    let opened = std::fs::OpenOptions::new().append(true).create(true).open(path);
    opened.map_err(|error| cannot(&error))?;
    if there.is_ok() {
        return Ok(());
    }
    // Behind a link it is the target that was made; the link was there before.
    let made = path.canonicalize();
    made.and_then(std::fs::remove_file).map_err(|error| cannot(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_not_written_over_whatever_it_is_called() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("run.csv"), "time_s\n").unwrap();
        std::os::unix::fs::symlink(at("run.csv"), at("link.html")).unwrap();
        std::fs::hard_link(at("run.csv"), at("hard.html")).unwrap();
        for written in ["run.csv", "link.html", "hard.html", "../run.csv"] {
            let written = match written.strip_prefix("../") {
                Some(name) => folder.path().join(".").join(name),
                None => at(written),
            };
            let named = Named::default().reads("recording", folder.path()).writes("--html", Some(&written));
            let said = named.check().unwrap_err();
            assert!(said.code() == 2 && said.to_string().contains("recording that is read"), "{said}");
        }
        let twice =
            Named::default().writes("-o", Some(&at("new.toml"))).writes("--html", Some(&at("new.toml")));
        assert!(twice.check().unwrap_err().to_string().contains("-o writes to the same file"));
        // Neither is there yet: one name may be spelt in many ways.
        std::fs::create_dir(at("sub")).unwrap();
        std::os::unix::fs::symlink("p.md", at("latest.md")).unwrap();
        for other in ["./p.md", "sub/../p.md", "latest.md"] {
            let named =
                Named::default().writes("--html", Some(&at("p.md"))).writes("--markdown", Some(&at(other)));
            let said = named.check().unwrap_err().to_string();
            assert!(said.contains("--html writes to the same file"), "{other}: {said}");
        }
        assert!(!at("p.md").exists());
    }

    #[test]
    fn what_cannot_be_written_is_said_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        for (path, words) in
            [(folder.path().to_owned(), "folder"), (folder.path().join("no/page.html"), "No such file")]
        {
            let said = Named::default().writes("--html", Some(&path)).check().unwrap_err();
            assert!(said.code() == 2 && said.to_string().contains(words), "{said}");
        }
        let new = folder.path().join("fitted.txt");
        let said = Named::default().writes_toml("-o", Some(&new)).check().unwrap_err().to_string();
        assert!(said.contains(".toml\nhint: ") && said.contains("fitted.toml"), "{said}");
        assert_eq!(Named::default().writes("-o", Some(&new)).check(), Ok(()));
        assert_eq!(Named::default().writes_toml("-o", Some(Path::new("/dev/null"))).check(), Ok(()));
        assert!(!new.exists());
        // A link to what is not there yet stays, and so does a file that somebody left empty.
        let (link, empty) = (folder.path().join("latest.toml"), folder.path().join("empty.toml"));
        std::os::unix::fs::symlink(&new, &link).unwrap();
        std::fs::write(&empty, "").unwrap();
        for path in [&link, &empty] {
            assert_eq!(Named::default().writes_toml("-o", Some(path)).check(), Ok(()));
        }
        assert!(link.is_symlink() && !new.exists() && empty.exists());
    }
}
