//! The revisions of one thruster's rig description, all of them, on disk: `REVISION.toml` each, and `book.json` with
//! what was put in force when, by whom, and what stood before it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use kort_proto::revision;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::thruster::lock;

/// Where an entry of the deployment's own rig description comes from.
pub const DEPLOYMENT: &str = "deployment";

/// A revision that was put in force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Entry {
    /// Counts up from 1.
    #[schema(minimum = 1, example = 2)]
    pub number: u32,
    /// The beginning of the text's SHA-256: what recordings and the state name it by.
    #[schema(pattern = "^[0-9a-f]{16}$", example = "8f3a0c94d1b2e675")]
    pub revision: String,
    /// Name of the rig that it describes.
    pub name: String,
    /// Where it comes from: `deployment`, `file`, `diagnosis ID`, `fit ID`, or `revision N`.
    #[schema(example = "diagnosis t1-20260101T120000Z")]
    pub source: String,
    /// Who put it in force: name of the token, `local` where none is asked for.
    pub who: String,
    /// When, RFC 3339.
    pub time: String,
    /// What whoever did it wrote about it.
    #[serde(default)]
    pub note: Option<String>,
    /// Number of the one that was in force before: rollback goes back to it. Null for the first.
    #[serde(default)]
    pub before: Option<u32>,
}

/// What an entry says of its making.
#[derive(Clone, Debug)]
pub struct Making {
    /// As [`Entry::source`].
    pub source: String,
    /// As [`Entry::who`].
    pub who: String,
    /// As [`Entry::note`].
    pub note: Option<String>,
}

/// Everything in `book.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Pages {
    current: u32,
    entries: Vec<Entry>,
}

/// An entry with its text.
pub type Revision = (Entry, Arc<str>);

/// The book of one thruster.
#[derive(Debug)]
pub struct Book {
    folder: PathBuf,
    shelf: Mutex<Shelf>,
}

/// Every revision, and the place of the one in force; never empty once the book is open.
#[derive(Clone, Debug)]
struct Shelf {
    revisions: Vec<Revision>,
    current: usize,
}

impl Book {
    /// Opens the book in this folder. Where the deployment's own text is another than when it was entered last, it is
    /// entered anew: what somebody wrote into the configuration is in force from the next start on.
    ///
    /// # Errors
    /// The folder cannot be read or written.
    pub fn open(folder: &Path, deployed: &str, name: &str) -> io::Result<Book> {
        fs::create_dir_all(folder)?;
        let Pages { current, entries } = read_pages(folder)?;
        let revisions: Vec<Revision> =
            entries.into_iter().filter_map(|entry| Some((entry.clone(), text_of(folder, &entry)?))).collect();
        let place = revisions.iter().position(|(entry, _)| entry.number == current);
        let shelf = Shelf { current: place.unwrap_or(0), revisions };
        let last = shelf.revisions.iter().rfind(|(entry, _)| entry.source == DEPLOYMENT);
        let known = place.is_some() && last.is_some_and(|(_, text)| **text == *deployed);
        let book = Book { folder: folder.to_owned(), shelf: Mutex::new(shelf) };
        if !known {
            let making = Making { source: DEPLOYMENT.into(), who: "gateway".into(), note: None };
            book.keep(deployed)?;
            book.enter(deployed, name, making)?;
        }
        Ok(book)
    }

    /// The revision in force.
    pub fn current(&self) -> Revision {
        let shelf = lock(&self.shelf);
        shelf.revisions[shelf.current].clone()
    }

    /// The revision of a number.
    pub fn revision(&self, number: u32) -> Option<Revision> {
        lock(&self.shelf).revisions.iter().find(|(entry, _)| entry.number == number).cloned()
    }

    /// Every entry, oldest first, and the number of the one in force.
    pub fn entries(&self) -> (Vec<Entry>, u32) {
        let shelf = lock(&self.shelf);
        let entries = shelf.revisions.iter().map(|(entry, _)| entry.clone()).collect();
        (entries, shelf.revisions[shelf.current].0.number)
    }

    /// Keeps a text on disk; it is in force only once it is entered.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(&self, text: &str) -> io::Result<()> {
        write_whole(&self.folder, &format!("{}.toml", revision::name(revision::of(text))), text.as_bytes())
    }

    /// Enters a kept text as the one in force.
    ///
    /// # Errors
    /// The disk refuses; the book is as before then.
    pub fn enter(&self, text: &str, name: &str, making: Making) -> io::Result<Entry> {
        let mut shelf = lock(&self.shelf);
        let entry = Entry {
            number: shelf.revisions.last().map_or(1, |(last, _)| last.number + 1),
            revision: revision::name(revision::of(text)),
            name: name.to_owned(),
            source: making.source,
            who: making.who,
            time: humantime::format_rfc3339_millis(SystemTime::now()).to_string(),
            note: making.note,
            before: shelf.revisions.get(shelf.current).map(|(entry, _)| entry.number),
        };
        let mut next = shelf.clone();
        next.revisions.push((entry.clone(), Arc::from(text)));
        next.current = next.revisions.len() - 1;
        self.write(&next)?;
        *shelf = next;
        Ok(entry)
    }

    /// Puts an entry in force again.
    ///
    /// # Errors
    /// The disk refuses; the book is as before then.
    pub fn turn_to(&self, number: u32) -> io::Result<Entry> {
        let mut shelf = lock(&self.shelf);
        let mut next = shelf.clone();
        next.current = shelf.revisions.iter().position(|(e, _)| e.number == number).unwrap_or(shelf.current);
        self.write(&next)?;
        *shelf = next;
        Ok(shelf.revisions[shelf.current].0.clone())
    }

    fn write(&self, shelf: &Shelf) -> io::Result<()> {
        let entries: Vec<Entry> = shelf.revisions.iter().map(|(entry, _)| entry.clone()).collect();
        let pages = Pages { current: shelf.revisions[shelf.current].0.number, entries };
        write_whole(&self.folder, "book.json", &serde_json::to_vec_pretty(&pages)?)
    }
}

/// The text of an entry, unless it is gone or was edited.
fn text_of(folder: &Path, entry: &Entry) -> Option<Arc<str>> {
    let text = fs::read_to_string(folder.join(format!("{}.toml", entry.revision))).ok();
    let text = text.filter(|text| revision::name(revision::of(text)) == entry.revision);
    if text.is_none() {
        tracing::error!(
            "{}: revision {} of the rig is gone or changed; it is left out\nhint: the texts there are kept, not edited",
            folder.display(),
            entry.number
        );
    }
    text.map(Arc::from)
}

/// A book that cannot be read is put aside, aloud: a thruster is not to stand still for it.
fn read_pages(folder: &Path) -> io::Result<Pages> {
    let file = folder.join("book.json");
    let text = match fs::read(&file) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Pages::default()),
        Err(error) => return Err(error),
    };
    serde_json::from_slice(&text).or_else(|error| {
        let aside = folder.join("book.unreadable.json");
        tracing::error!("{}: {error}; put aside as {}", file.display(), aside.display());
        fs::rename(&file, aside)?;
        Ok(Pages::default())
    })
}

/// Writes a file whole or not at all.
pub fn write_whole(folder: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
    let draft = folder.join(format!(".{name}.draft"));
    fs::write(&draft, bytes)
        .and_then(|()| fs::rename(&draft, folder.join(name)))
        .inspect_err(|_| drop(fs::remove_file(&draft)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn making(source: &str) -> Making {
        Making { source: source.into(), who: "bench".into(), note: None }
    }

    #[test]
    fn every_revision_is_kept_over_restarts_and_the_way_back_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let book = Book::open(folder.path(), "one", "stand").unwrap();
        assert_eq!((book.current().0.number, book.current().0.before), (1, None));
        for (text, number) in [("two", 2), ("three", 3)] {
            book.keep(text).unwrap();
            assert_eq!(book.enter(text, "stand", making("file")).unwrap().number, number);
        }
        book.turn_to(2).unwrap();
        let book = Book::open(folder.path(), "one", "stand").unwrap();
        let (current, text) = book.current();
        assert_eq!((current.number, current.before, &*text), (2, Some(1), "two"));
        let (entries, in_force) = book.entries();
        assert_eq!((entries.len(), in_force), (3, 2));
        assert_eq!(&*book.revision(3).unwrap().1, "three");
    }

    #[test]
    fn a_rig_that_is_deployed_anew_is_in_force() {
        let folder = tempfile::tempdir().unwrap();
        let book = Book::open(folder.path(), "one", "stand").unwrap();
        book.keep("found").unwrap();
        book.enter("found", "stand", making("diagnosis t1-x")).unwrap();
        let book = Book::open(folder.path(), "another", "stand").unwrap();
        let (current, text) = book.current();
        assert_eq!((current.source.as_str(), current.before, &*text), (DEPLOYMENT, Some(2), "another"));
    }

    #[test]
    fn what_is_damaged_is_left_out_and_the_deployment_is_in_force() {
        let folder = tempfile::tempdir().unwrap();
        let book = Book::open(folder.path(), "one", "stand").unwrap();
        book.keep("two").unwrap();
        let two = book.enter("two", "stand", making("file")).unwrap();
        fs::write(folder.path().join(format!("{}.toml", two.revision)), "edited").unwrap();
        let book = Book::open(folder.path(), "one", "stand").unwrap();
        assert_eq!(&*book.current().1, "one");
        fs::write(folder.path().join("book.json"), "{").unwrap();
        let book = Book::open(folder.path(), "one", "stand").unwrap();
        assert_eq!((book.entries().0.len(), &*book.current().1), (1, "one"));
        assert!(folder.path().join("book.unreadable.json").is_file());
    }
}
