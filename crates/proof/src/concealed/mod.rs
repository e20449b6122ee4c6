//! Concealment in real data: an exact change is made to a measured recording, so that its answer is
//! known while noise and structure stay real. It must be found on top of what the recording itself
//! holds: the diagnosis of the unchanged recording is taken before.
//!
//! A change of a sensor is made to its column. A change of what acts between drive and motion is made
//! to the recorded command, by the inverse: the response stays what was measured, and the changed
//! command is one that *through the hidden effect* drives the machine just as it was driven. To add a
//! change: a file with its `CHANGE`, and a line in [`ALL`].

mod columns;
mod dead_band;
mod delayed_command;
mod dry_friction;
mod eccentricity;
mod forgotten_inflow;
mod forgotten_supply;
mod late_clock;
mod late_speed;
mod late_thrust;
mod load_comes_on;
mod mirrored;
mod spliced_load;
mod throttle_curve;
mod thrust_gain;
mod thrust_zero;
mod torque_zero;
mod unsigned_speed;

use std::fmt::Write;
use std::io::Cursor;

use kort_recording::Recording;
use kort_recording::formats::Format;
use serde::Serialize;
use serde_json::Value;

use crate::measure::{Bar, Measure};
use crate::measured::Set;
use crate::report::Report;
use crate::{Diagnosis, File};

/// What a change hides.
#[derive(Clone, Debug, PartialEq)]
pub struct Made {
    /// What was done, with its size, in words.
    pub what: String,
    /// What a report should say.
    pub expects: Expected,
}

/// What a report should say of a change.
#[derive(Clone, Debug, PartialEq)]
pub enum Expected {
    /// One of these ids; the first is the change's own name.
    Named(Vec<&'static str>),
    /// Physics without a name, on one of these paths; or one of these ids.
    Nameless(&'static [&'static str], &'static [&'static str]),
    /// Nothing else than of the unchanged recording.
    TheSame,
}

/// A change. It is given the recording and another of the same rig, and changes the first; nothing
/// where the recording cannot have it.
pub struct Change {
    /// Name.
    pub name: &'static str,
    /// Makes it.
    pub make: fn(&mut Recording, &Recording) -> Option<Made>,
}

/// Every change.
pub const ALL: &[&Change] = &[
    &delayed_command::CHANGE,
    &late_speed::CHANGE,
    &late_thrust::CHANGE,
    &late_clock::CHANGE,
    &thrust_zero::CHANGE,
    &thrust_gain::CHANGE,
    &torque_zero::CHANGE,
    &dry_friction::CHANGE,
    &dead_band::CHANGE,
    &throttle_curve::CHANGE,
    &eccentricity::CHANGE,
    &unsigned_speed::CHANGE,
    &forgotten_supply::CHANGE,
    &forgotten_inflow::CHANGE,
    &load_comes_on::CHANGE,
    &spliced_load::CHANGE,
    &mirrored::CHANGE,
];

/// One change, diagnosed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Concealed {
    /// Folder.
    pub set: String,
    /// File.
    pub recording: String,
    /// Change.
    pub change: String,
    /// What was done.
    pub what: String,
    /// Ids that name it; empty where it has no name or nothing should change.
    pub expects: Vec<&'static str>,
    /// The unchanged recording holds one of them already: not counted.
    pub already_there: bool,
    /// It is a finding (or what has no name is flagged on its path, or nothing changed).
    pub found: bool,
    /// It is a finding or named as a rival of one.
    pub listed: bool,
    /// Findings above 0.9 that neither the change nor the unchanged recording accounts for.
    pub sure_and_wrong: Vec<String>,
    /// Verdict.
    pub verdict: String,
    /// Findings with their probability.
    pub findings: Vec<(String, f64)>,
    /// Time of the diagnosis, s.
    pub seconds: f64,
}

/// Hides every change that a recording can have, and diagnoses each. `base` is the report on the
/// unchanged recording.
///
/// # Errors
/// The recording cannot be read.
pub fn conceal(
    set: &Set,
    recording: &File,
    base: &Value,
    chosen: &[&'static Change],
    diagnosis: &dyn Diagnosis,
) -> Result<Vec<Concealed>, String> {
    let rig = set.rig(&recording.name).map_err(|error| error.to_string())?;
    let decode =
        |file: &File| Recording::decode(&file.name, file.bytes.as_slice(), None).map_err(|e| e.to_string());
    let whole = decode(recording)?;
    // Another run of the same rig, or the same one where there is no other.
    let other = set
        .recordings
        .iter()
        .find(|file| file.name != recording.name && set.key.rig(&file.name) == set.key.rig(&recording.name))
        .map_or_else(|| Ok(whole.clone()), decode)?;
    let mut list = Vec::new();
    for change in chosen {
        let mut changed = whole.clone();
        let Some(made) = (change.make)(&mut changed, &other) else { continue };
        let file = encode(&changed, &recording.name)?;
        let report = diagnosis.diagnose(&[file], rig);
        let answer =
            report.unwrap_or_else(|message| serde_json::json!({ "verdict": "error", "summary": message }));
        list.push(judge(&set.name, &recording.name, change.name, &made, base, &answer));
    }
    Ok(list)
}

/// A changed recording as a file.
fn encode(recording: &Recording, name: &str) -> Result<File, String> {
    let mut bytes = Cursor::new(Vec::new());
    recording.write(Format::Csv, &mut bytes).map_err(|error| error.to_string())?;
    let name = format!("{}.csv", name.trim_end_matches(".gz").trim_end_matches(".csv"));
    Ok(File { name, bytes: bytes.into_inner() })
}

/// Holds the report on a changed recording against the change and the report on the unchanged one.
fn judge(set: &str, recording: &str, change: &str, made: &Made, base: &Value, changed: &Value) -> Concealed {
    let (before, after) = (Report(base), Report(changed));
    let (old, new) = (before.findings(), after.findings());
    let was = |id: &str| old.iter().any(|named| named.effect == id);
    let is = |id: &str| new.iter().any(|named| named.effect == id);
    let names: Vec<&'static str> = match &made.expects {
        Expected::Named(names) => names.clone(),
        Expected::Nameless(_, names) => names.to_vec(),
        Expected::TheSame => Vec::new(),
    };
    let named = names.iter().any(|id| is(id) && !was(id));
    let candidates = after.candidates();
    let (found, listed) = match &made.expects {
        Expected::Named(_) => (named, named || names.iter().any(|id| candidates.contains(id) && !was(id))),
        Expected::Nameless(paths, _) => {
            let flagged =
                after.flags_nameless() && after.nameless_path().is_some_and(|path| paths.contains(&path));
            (named || flagged, named || flagged)
        }
        Expected::TheSame => {
            let same = old.len() == new.len() && old.iter().all(|named| is(named.effect));
            (same && before.verdict() == after.verdict(), same)
        }
    };
    Concealed {
        set: set.into(),
        recording: recording.into(),
        change: change.into(),
        what: made.what.clone(),
        // What the recording holds already cannot be told from what was added.
        already_there: names.iter().any(|id| was(id)),
        found,
        listed,
        sure_and_wrong: new
            .iter()
            .filter(|named| named.probability > 0.9 && !was(named.effect) && !names.contains(&named.effect))
            .map(|named| named.effect.to_owned())
            .collect(),
        expects: names,
        verdict: after.verdict().into(),
        findings: new.iter().map(|named| (named.effect.to_owned(), named.probability)).collect(),
        seconds: after.seconds(),
    }
}

/// Counts; nothing over no changes.
pub fn measures(list: &[Concealed]) -> Vec<Measure> {
    if list.is_empty() {
        return Vec::new();
    }
    let counted = || list.iter().filter(|one| !one.already_there);
    vec![
        Measure::share(
            "concealed_found",
            "changes hidden in measured recordings that are found",
            None,
            counted().map(|one| one.found),
        ),
        Measure::share(
            "concealed_found_or_listed",
            "changes hidden in measured recordings that are found or listed",
            Some(Bar::AtLeast(0.8)),
            counted().map(|one| one.listed),
        ),
        Measure::share(
            "concealed_wrong",
            "changed recordings with a new finding above 0.9 that is wrong",
            Some(Bar::AtMost(0.02)),
            counted().map(|one| !one.sure_and_wrong.is_empty()),
        ),
    ]
}

/// The table of changes in Markdown; nothing over no changes.
pub fn markdown(list: &[Concealed]) -> String {
    if list.is_empty() {
        return String::new();
    }
    let mut out =
        "\n| recording | hidden | found | verdict, findings |\n| --- | --- | --- | --- |\n".to_owned();
    for one in list {
        let findings: Vec<String> = one.findings.iter().map(|(id, p)| format!("`{id}` {p:.2}")).collect();
        let found = match one {
            Concealed { already_there: true, .. } => "(held already)",
            Concealed { found: true, .. } => "yes",
            Concealed { listed: true, .. } => "listed",
            _ => "no",
        };
        let recording = one.recording.trim_end_matches(".gz").trim_end_matches(".csv");
        let _ = writeln!(
            out,
            "| {}/{recording} | {} | {found} | {}: {} |",
            one.set,
            one.what,
            one.verdict,
            findings.join(", ")
        );
    }
    out
}

#[cfg(test)]
mod tests;
