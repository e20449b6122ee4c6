//! The key of a set of measured recordings: `answers.toml`.

use serde::Deserialize;
use thiserror::Error;
use toml::Table;

/// Why a key cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{set}/answers.toml: `{field}` is {found}; allowed: {allowed}\nhint: {hint}")]
pub struct KeyError {
    /// The set.
    pub set: String,
    /// Field.
    pub field: String,
    /// What stands there.
    pub found: String,
    /// What may stand there.
    pub allowed: String,
    /// What to do.
    pub hint: String,
}

const SCHEMA: &str = "kort.measured-answers/1";

/// One effect that is there.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Present {
    /// Id, of the catalogue or proposed.
    pub effect: String,
    /// Sizes, the unit in the key.
    #[serde(default)]
    pub size: Table,
}

/// What holds for some recordings. Keys that only explain (`note`, `whose`, …) are left aside.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Group {
    /// Names or patterns with `*`.
    pub recordings: Vec<String>,
    /// Rig file; `rig.toml` if none is named.
    pub rig: Option<String>,
    /// What is there.
    #[serde(default)]
    pub present: Vec<Present>,
    /// What is not.
    #[serde(default)]
    pub absent: Vec<String>,
    /// What these recordings cannot tell.
    #[serde(default)]
    pub cannot_tell: Vec<String>,
    /// Best error without what is present, % of full scale.
    pub error_pct_fs_without: Option<f64>,
    /// And with it.
    pub error_pct_fs_with: Option<f64>,
}

/// A whole key.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Groups, in the file's order; they overlap and add up.
    pub groups: Vec<Group>,
    /// Acceptable names of smaller tools: neither right nor wrong.
    pub reduced: Vec<String>,
    /// Names that are known to be wrong.
    pub wrong: Vec<String>,
}

/// What the key says of one recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// What is there.
    pub present: Vec<Present>,
    /// What is not.
    pub absent: Vec<String>,
    /// What it cannot tell.
    pub cannot_tell: Vec<String>,
    /// Acceptable names.
    pub reduced: Vec<String>,
    /// Best errors without and with what is present, % of full scale.
    pub error_pct_fs: (Option<f64>, Option<f64>),
}

impl Key {
    /// Reads one; `set` is for messages.
    ///
    /// # Errors
    /// Not TOML, another schema, or a group without recordings.
    pub fn read(set: &str, text: &str) -> Result<Self, KeyError> {
        let error = |field: &str, found: String, allowed: &str, hint: &str| KeyError {
            set: set.into(),
            field: field.into(),
            found,
            allowed: allowed.into(),
            hint: hint.into(),
        };
        #[derive(Deserialize)]
        struct File {
            schema: String,
            #[serde(default, rename = "group")]
            groups: Vec<Group>,
            #[serde(default)]
            reduced: Table,
        }
        let file: File = toml::from_str(text).map_err(|e| {
            error(
                "the file",
                e.to_string(),
                "a key as docs/measured-recordings.md describes",
                "mend the line named",
            )
        })?;
        if file.schema != SCHEMA {
            return Err(error("schema", format!("{:?}", file.schema), SCHEMA, "this version reads no other"));
        }
        if file.groups.is_empty() {
            return Err(error(
                "group",
                "empty".into(),
                "at least one",
                "write [[group]] with recordings and present",
            ));
        }
        let wrong = file.reduced.get("wrong").and_then(toml::Value::as_array).cloned().unwrap_or_default();
        let wrong: Vec<String> = wrong.iter().filter_map(toml::Value::as_str).map(Into::into).collect();
        let reduced = file.reduced.keys().filter(|key| *key != "wrong").cloned().collect();
        Ok(Key { groups: file.groups, reduced, wrong })
    }

    /// Groups that speak of a recording.
    fn speaking(&self, recording: &str) -> impl Iterator<Item = &Group> {
        self.groups
            .iter()
            .filter(move |group| group.recordings.iter().any(|pattern| matches(pattern, recording)))
    }

    /// Name of the rig file of a recording.
    pub fn rig(&self, recording: &str) -> &str {
        self.speaking(recording).find_map(|group| group.rig.as_deref()).unwrap_or("rig.toml")
    }

    /// Whether any group speaks of a recording.
    pub fn knows(&self, recording: &str) -> bool {
        self.speaking(recording).next().is_some()
    }

    /// What all groups together say of a recording. What one group calls present another may call
    /// untellable for a part of it: present wins; and sizes of the first group that gives them stand.
    pub fn of(&self, recording: &str) -> Answer {
        let mut answer = Answer { reduced: self.reduced.clone(), ..Answer::default() };
        for group in self.speaking(recording) {
            for present in &group.present {
                if answer.present.iter().all(|other| other.effect != present.effect) {
                    answer.present.push(present.clone());
                }
            }
            answer.absent.extend(group.absent.iter().cloned());
            answer.cannot_tell.extend(group.cannot_tell.iter().cloned());
            let (without, with) = &mut answer.error_pct_fs;
            *without = without.or(group.error_pct_fs_without);
            *with = with.or(group.error_pct_fs_with);
        }
        answer.absent.extend(self.wrong.iter().cloned());
        let here = |id: &String| answer.present.iter().any(|present| present.effect == *id);
        answer.absent.retain(|id| !here(id) && !answer.cannot_tell.contains(id));
        answer.absent.sort_unstable();
        answer.absent.dedup();
        answer
    }
}

/// A name fits a pattern in which `*` stands for anything.
fn matches(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((before, after)) => {
            let Some(rest) = name.strip_prefix(before) else { return false };
            rest.char_indices().map(|(at, _)| &rest[at..]).chain([""]).any(|rest| matches(after, rest))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = r#"
schema = "kort.measured-answers/1"
set = "x"
[known]
anything = 3
[[group]]
recordings = ["run_*.csv.gz"]
error_pct_fs_without = 5.0
absent = ["windage_drag"]
cannot_tell = ["viscous_friction"]
[[group.present]]
effect = "coulomb_friction"
catalogue = true
size = { coulomb_current_a = 0.074 }
note = "words"
[[group]]
recordings = ["run_2.csv.gz"]
rig = "rig-2.toml"
present = []
cannot_tell = ["windage_drag"]
[reduced]
gear_load_friction = { verdict = "half right" }
wrong = ["thermal_drift_kt"]
"#;

    #[test]
    fn groups_add_up() {
        let key = Key::read("x", KEY).unwrap();
        let one = key.of("run_1.csv.gz");
        assert_eq!(one.present[0].effect, "coulomb_friction");
        assert_eq!(one.absent, ["thermal_drift_kt", "windage_drag"]);
        assert_eq!(
            (one.reduced.as_slice(), one.error_pct_fs.0),
            (&["gear_load_friction".to_string()][..], Some(5.0))
        );
        let two = key.of("run_2.csv.gz");
        assert_eq!(two.absent, ["thermal_drift_kt"], "what cannot be told is not called absent");
        assert_eq!((key.rig("run_1.csv.gz"), key.rig("run_2.csv.gz")), ("rig.toml", "rig-2.toml"));
        assert!(!key.knows("other.csv.gz"));
    }

    #[test]
    fn patterns_match_whole_names() {
        assert!(matches("xl330_kp*_*.csv.gz", "xl330_kp100_sin_sin.csv.gz"));
        assert!(matches("*", "anything") && matches("a*", "a") && !matches("a*b", "abc"));
        assert!(!matches("run", "run.csv"));
    }

    #[test]
    fn a_key_of_another_schema_is_refused_with_its_name() {
        let error = Key::read("bench", &KEY.replace("answers/1", "answers/9")).unwrap_err().to_string();
        assert!(error.contains("bench/answers.toml: `schema`") && error.contains("hint:"), "{error}");
    }
}
