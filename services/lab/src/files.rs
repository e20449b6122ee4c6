//! What a user hands in: rigs, recordings and scenarios, by path or by the name of a shipped one.

use std::path::{Path, PathBuf};

use kort_recording::{ColumnMap, Recording};
use kort_thruster::rig::Rig;
use rust_embed::Embed;

use crate::failure::{Failure, read_text};
use crate::progress;

/// Rigs built in, so that the program needs no folder beside it.
#[derive(Embed)]
#[folder = "../../config/thrusters"]
struct Rigs;

/// Scenarios built in, those of `kort simulate` and of `kort soak` alike.
#[derive(Embed)]
#[folder = "../../config/scenarios"]
struct Scenarios;

/// Controllers built in, which scenarios name.
#[derive(Embed)]
#[folder = "../../config/controllers"]
struct Controllers;

/// The text of a controller built in, by its name.
pub fn controller_text(name: &str) -> Option<String> {
    let file = Controllers::get(&format!("{name}.toml"))?;
    Some(String::from_utf8_lossy(&file.data).into_owned())
}

/// Scenarios of `kort soak` have this before their name.
pub const SOAK: &str = "soak-";

/// Names of what is built in, without ending.
fn names<E: Embed>() -> Vec<String> {
    let mut names: Vec<String> =
        E::iter().filter_map(|file| file.strip_suffix(".toml").map(str::to_owned)).collect();
    names.sort();
    names
}

/// Names of the rigs built in.
pub fn rigs() -> Vec<String> {
    names::<Rigs>()
}

/// Names of the scenarios of `kort soak` built in.
pub fn soak_scenarios() -> Vec<String> {
    names::<Scenarios>().into_iter().filter(|name| name.starts_with(SOAK)).collect()
}

/// Recordings built in, for replays.
const RECORDINGS: &[(&str, &[u8])] =
    &[("vortex-auv-pool-heave-1", include_bytes!("../../../tests/recordings/vortex-auv-pool-heave-1.csv"))];

/// Folders in which what is named without a path is looked for before what is built in.
const RIGS: &str = "config/thrusters";
const SCENARIOS: &str = "config/scenarios";

/// The file meant: a path, or in `folder` a name.
fn file_of(wanted: &Path, folder: &str) -> Option<PathBuf> {
    if wanted.is_file() {
        return Some(wanted.to_owned());
    }
    let named = Path::new(folder).join(format!("{}.toml", wanted.to_string_lossy()));
    (wanted.components().count() == 1 && named.is_file()).then_some(named)
}

/// The file of a rig description by path or name; none of one that is built in, or not there.
pub fn rig_file(wanted: &Path) -> Option<PathBuf> {
    file_of(wanted, RIGS)
}

/// A text by path, else in `folder` by name, else built in.
fn text_of<E: Embed>(wanted: &Path, folder: &str, what: &str, offered: &[String]) -> Result<String, Failure> {
    if let Some(file) = file_of(wanted, folder) {
        return read_text(&file);
    }
    let name = wanted.to_string_lossy();
    if let Some(text) = E::get(&format!("{name}.toml")) {
        return Ok(String::from_utf8_lossy(&text.data).into_owned());
    }
    let hint = match kort_recording::columns::nearest(&name, offered.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? "),
        None => String::new(),
    };
    Err(Failure::input(format!(
        "{name}: there is no such {what}, neither as a file nor by name\nhint: {hint}shipped: {}",
        offered.join(", ")
    )))
}

/// A rig description by path or name.
///
/// # Errors
/// Names the file, the key, the value found and what is allowed.
pub fn read_rig(wanted: &Path) -> Result<Rig, Failure> {
    Rig::from_toml_with_all(&rig_text(wanted)?).map_err(|wrong| Failure::in_file_all(wanted, wrong))
}

/// A rig description's text by path or name.
///
/// # Errors
/// There is no such file or rig.
pub fn rig_text(wanted: &Path) -> Result<String, Failure> {
    text_of::<Rigs>(wanted, RIGS, "rig description", &rigs())
}

/// The text of a scenario of `kort simulate`, by path or name.
///
/// # Errors
/// There is no such file or scenario.
pub fn scenario_text(wanted: &Path) -> Result<String, Failure> {
    let offered: Vec<String> =
        names::<Scenarios>().into_iter().filter(|name| !name.starts_with(SOAK)).collect();
    text_of::<Scenarios>(wanted, SCENARIOS, "scenario", &offered)
}

/// The text of a scenario of `kort soak`, by path or name.
///
/// # Errors
/// There is no such file or scenario.
pub fn soak_scenario_text(wanted: &Path) -> Result<String, Failure> {
    text_of::<Scenarios>(wanted, SCENARIOS, "soak scenario", &soak_scenarios())
}

/// A column map by path or name; `None` stays `None`.
///
/// # Errors
/// Names the map, the field and what is allowed.
pub fn read_columns(wanted: Option<&str>) -> Result<Option<ColumnMap>, Failure> {
    wanted.map(ColumnMap::find).transpose().map_err(Failure::input)
}

/// A recording, with progress on a terminal and its notes and losses on stderr.
///
/// # Errors
/// Names the file, the place, the value found and what is allowed.
pub fn read_recording(path: &Path, map: Option<&ColumnMap>) -> Result<Recording, Failure> {
    let file = Recording::open(path).map_err(Failure::input)?;
    let size = file.metadata().map_or(0, |m| m.len());
    let bar = progress::bytes(size, path.display().to_string());
    let recording = Recording::decode(&path.display().to_string(), bar.wrap_read(file), map);
    drop(bar);
    let recording = recording.map_err(Failure::input)?;
    for note in &recording.notes {
        eprintln!("{}: note: {note}", path.display());
    }
    for loss in &recording.losses {
        eprintln!("{}: lost: {loss}", path.display());
    }
    Ok(recording)
}

/// A recording to replay: by path, beside the scenario, or built in.
pub fn replayed_recording(
    name: &str,
    beside: Option<&Path>,
    map: Option<&ColumnMap>,
) -> Result<Recording, Failure> {
    let places: [Option<PathBuf>; 2] = [beside.map(|folder| folder.join(name)), Some(PathBuf::from(name))];
    if let Some(path) = places.into_iter().flatten().find(|p| p.is_file()) {
        return read_recording(&path, map);
    }
    match RECORDINGS.iter().find(|(n, _)| *n == name) {
        Some((_, bytes)) => Recording::decode(name, *bytes, map).map_err(Failure::input),
        None => {
            let names: Vec<&str> = RECORDINGS.iter().map(|(n, _)| *n).collect();
            Err(Failure::input(format!(
                "{name}: there is no such recording\nhint: give a file, or a shipped recording: {}",
                names.join(", ")
            )))
        }
    }
}
