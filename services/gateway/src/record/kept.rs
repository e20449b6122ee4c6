//! What becomes of recordings that are there: they are tagged and deleted.

use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use kort_proto::events::EventKind;

use super::{ENDING, Recorder, RecordingInfo, RecordingState, is_name, may};
use crate::problem::{Kind, Problem};
use crate::thruster::lock;
use crate::token::Identity;

/// Tags that a recording may have.
pub const TAGS_MAX: usize = 16;
/// Length of a tag at most, bytes.
const TAG_BYTES_MAX: usize = 32;

/// May a recording have these tags? Those that stand twice are kept once.
pub fn check_tags(tags: Vec<String>) -> Result<Vec<String>, Problem> {
    if tags.len() > TAGS_MAX {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("tags has {} entries; at most {TAGS_MAX} are allowed", tags.len()),
        ));
    }
    let mut kept: Vec<String> = Vec::new();
    for tag in tags {
        if !is_name(&tag) || tag.len() > TAG_BYTES_MAX {
            return Err(Problem::new(Kind::OutOfRange, format!("tags: {tag:?} is not allowed"))
                .hint("1 to 32 letters, digits, dots, underscores or hyphens; the first a letter or digit"));
        }
        if !kept.contains(&tag) {
            kept.push(tag);
        }
    }
    Ok(kept)
}

impl Recorder {
    /// Gives a recording other tags, also while it runs.
    pub fn tag(&self, name: &str, who: &Identity, tags: Vec<String>) -> Result<RecordingInfo, Problem> {
        let _one_at_a_time = lock(&self.starting);
        loop {
            self.reap();
            let infos: Vec<_> = lock(&self.running).iter().map(|running| running.info.clone()).collect();
            let Some(shared) = infos.into_iter().find(|info| lock(info).name == name) else { break };
            let mut info = lock(&shared);
            // Its thread writes them with the next flush; one that is about to end is waited for.
            if info.state == RecordingState::Recording {
                may(who, &info.owner, name)?;
                info.tags = tags;
                return Ok(self.sized(info.clone()));
            }
            drop(info);
            std::thread::sleep(Duration::from_millis(5));
        }
        let mut info = self.known(name)?;
        may(who, &info.owner, name)?;
        if info.state == RecordingState::Gone {
            return Err(self.absent(name));
        }
        info.tags = tags;
        self.note_info(&info);
        Ok(info)
    }

    /// Stops a recording that runs, and returns it; deletes one that is done.
    pub fn remove(&self, name: &str, who: &Identity) -> Result<Option<RecordingInfo>, Problem> {
        let one_at_a_time = lock(&self.starting);
        if self.runs(name) {
            drop(one_at_a_time);
            return self.stop(name, who).map(Some);
        }
        let info = self.known(name)?;
        may(who, &info.owner, name)?;
        for ending in [ENDING, "csv", "json"] {
            match fs::remove_file(self.file(name, ending)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(self.failed(name, &error));
                }
                _ => (),
            }
        }
        lock(&self.unwritten).remove(name);
        self.tell(
            EventKind::RecordingDeleted,
            &info,
            &who.name,
            format!("{} deleted recording {name}", who.name),
        );
        Ok(None)
    }

    /// Why nothing of this name can be fetched, as the list has it.
    pub fn absent(&self, name: &str) -> Problem {
        match self.known(name) {
            Err(unknown) => unknown,
            Ok(info) => {
                let why = info.cause.unwrap_or_else(|| "its file is not there".into());
                Problem::new(Kind::UnknownRecording, format!("recording {name:?} cannot be fetched: {why}"))
                    .hint("DELETE /v1/recordings/{name} takes it off the list")
            }
        }
    }

    /// With what lies on the disk of it. One that runs without its file ends with the next look of its own thread.
    pub(super) fn sized(&self, mut info: RecordingInfo) -> RecordingInfo {
        let about = fs::metadata(self.file(&info.name, ENDING));
        let gone = about.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::NotFound);
        if gone && info.state != RecordingState::Recording {
            let words = format!("its file {}.{ENDING} is not there: moved or removed by hand", info.name);
            info.state = RecordingState::Gone;
            info.cause = Some(info.cause.map_or(words.clone(), |cause| format!("{cause}; {words}")));
        }
        info.bytes = about.map(|about| (ENDING.to_owned(), about.len())).into_iter().collect();
        info
    }

    fn known(&self, name: &str) -> Result<RecordingInfo, Problem> {
        self.list().into_iter().find(|info| info.name == name).ok_or_else(|| {
            Problem::new(Kind::UnknownRecording, format!("there is no recording {name:?}"))
                .hint("GET /v1/recordings lists them")
        })
    }
}

/// Writes `NAME.json`, at once or not at all. On a full disk it is written over where it lies: its block has room for
/// that, and how a recording ended must outlive this process.
pub fn write_info(folder: &Path, info: &RecordingInfo) -> io::Result<()> {
    let (draft, file) =
        (folder.join(format!(".{}.draft", info.name)), folder.join(format!("{}.json", info.name)));
    let text = serde_json::to_vec_pretty(info)?;
    let replaced = fs::write(&draft, &text).and_then(|()| fs::rename(&draft, &file));
    replaced.or_else(|error| {
        let _ = fs::remove_file(&draft);
        let mut there = fs::OpenOptions::new().write(true).open(&file).map_err(|_| error)?;
        there.write_all(&text)?;
        there.set_len(text.len() as u64)
    })
}
