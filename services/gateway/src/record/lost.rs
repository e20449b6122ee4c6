//! A recording of which the file beside it does not say what it is: a disk that was full, or a power cut, left that empty.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::SystemTime;

use super::{ENDING, RecordingInfo, RecordingState, is_word};

/// What is known of the recording of a `NAME.json`; none for any other file.
pub fn known_of(path: &Path) -> Option<RecordingInfo> {
    let name = path.file_name()?.to_str()?.strip_suffix(".json").filter(|name| is_word(name))?;
    // One that was deleted meanwhile, or that cannot be read, is not damaged.
    let text = fs::read(path).ok()?;
    match serde_json::from_slice(&text) {
        Ok(info) => Some(info),
        // Without a recording beside it, it is a file of somebody else's.
        Err(error) => {
            let recorded = path.with_file_name(format!("{name}.{ENDING}")).is_file();
            recorded.then(|| of_the_file(path, name, &error.to_string()))
        }
    }
}

/// What its own file tells, and what is lost: so it is shown, fetched and deleted as any other.
fn of_the_file(json: &Path, name: &str, why: &str) -> RecordingInfo {
    let about = fs::metadata(json.with_file_name(format!("{name}.{ENDING}"))).or_else(|_| fs::metadata(json));
    let written = about.and_then(|about| about.created().or_else(|_| about.modified()));
    RecordingInfo {
        name: name.to_owned(),
        thruster: String::new(),
        set: None,
        owner: String::new(),
        tags: Vec::new(),
        state: RecordingState::Torn,
        cause: Some(format!(
            "{name}.json is empty or damaged ({why}): thruster, owner, tags, rate, rows and duration are lost, and \
             `started` is when the file was made; what the file {name}.{ENDING} holds can be fetched"
        )),
        started: humantime::format_rfc3339_millis(written.unwrap_or(SystemTime::UNIX_EPOCH)).to_string(),
        rate_hz: 0.0,
        rows: 0,
        duration_s: 0.0,
        lost_samples: 0,
        bytes: BTreeMap::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Recorder;
    use crate::settings::RecordingLimits;
    use crate::token::Identity;

    #[test]
    fn a_recording_that_lost_what_is_known_of_it_is_listed_with_a_note_and_can_be_deleted() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        for (name, text) in [("empty", ""), ("torn", "{\"name\": \"torn\", \"thru")] {
            fs::write(file(&format!("{name}.json")), text).unwrap();
            fs::write(file(&format!("{name}.mcap")), "rows").unwrap();
        }
        fs::write(file("no recording.json"), "").unwrap();
        // Somebody else's report, and folders that are called as files of a recording.
        fs::write(file("x-report.json"), "{\"verdict\": 1}").unwrap();
        fs::create_dir(file("folder.json")).unwrap();
        fs::write(file("folder.mcap"), "rows").unwrap();
        fs::write(file("other.json"), "").unwrap();
        fs::create_dir(file("other.mcap")).unwrap();
        let recorder = Recorder::open(folder.path(), RecordingLimits::default()).unwrap();
        let list = recorder.list();
        assert_eq!(list.len(), 2, "{list:?}");
        for info in list {
            let cause = info.cause.clone().unwrap();
            assert!(cause.contains("damaged") && info.bytes["mcap"] == 4, "{cause}");
            assert!(recorder.find(&info.name).is_some());
            assert!(recorder.remove(&info.name, &Identity::local()).unwrap().is_none());
            assert!(!file(&format!("{}.mcap", info.name)).exists());
        }
        assert!(recorder.list().is_empty());
    }
}
