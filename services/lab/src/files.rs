//! What a user hands in: rigs, recordings and scenarios, by path or by the name of a shipped one.

use std::path::{Path, PathBuf};

use kort_recording::{ColumnMap, Recording};
use kort_thruster::rig::Rig;

use crate::failure::{Failure, read_text};
use crate::progress;

macro_rules! shipped {
    ($($name:literal: $file:literal),* $(,)?) => { &[$(($name, include_str!(concat!("../../../", $file)))),*] };
}

/// Rigs built in, so that the program needs no folder beside it.
const RIGS: &[(&str, &str)] = shipped![
    "t200": "config/thrusters/t200.toml",
    "whitcomb-yoerger-1999": "config/thrusters/whitcomb-yoerger-1999.toml",
];

/// Scenarios of `kort simulate` built in.
pub const SCENARIOS: &[(&str, &str)] = shipped![
    "chirp": "config/scenarios/chirp.toml",
    "identification-prbs": "config/scenarios/identification-prbs.toml",
    "identification-random-levels": "config/scenarios/identification-random-levels.toml",
    "joystick-replay": "config/scenarios/joystick-replay.toml",
    "multisine": "config/scenarios/multisine.toml",
    "slow-reversal-ramp": "config/scenarios/slow-reversal-ramp.toml",
    "staircase": "config/scenarios/staircase.toml",
    "torque-step-9.2": "config/scenarios/torque-step-9.2.toml",
    "torque-steps-18": "config/scenarios/torque-steps-18.toml",
    "tow": "config/scenarios/tow.toml",
];

/// Recordings built in, for replays.
const RECORDINGS: &[(&str, &[u8])] =
    &[("vortex-auv-pool-heave-1", include_bytes!("../../../tests/recordings/vortex-auv-pool-heave-1.csv"))];

/// A text by path, else in `folder` by name, else built in.
fn text_of(wanted: &Path, folder: &str, what: &str, shipped: &[(&str, &str)]) -> Result<String, Failure> {
    if wanted.is_file() {
        return read_text(wanted);
    }
    let name = wanted.to_string_lossy();
    let named = Path::new(folder).join(format!("{name}.toml"));
    if wanted.components().count() == 1 && named.is_file() {
        return read_text(&named);
    }
    if let Some((_, text)) = shipped.iter().find(|(n, _)| *n == name) {
        return Ok((*text).to_string());
    }
    let names: Vec<&str> = shipped.iter().map(|(n, _)| *n).collect();
    let hint = match kort_recording::columns::nearest(&name, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? "),
        None => String::new(),
    };
    Err(Failure::input(format!(
        "{name}: there is no such {what}, neither as a file nor by name\nhint: {hint}shipped: {}",
        names.join(", ")
    )))
}

/// A rig description by path or name.
///
/// # Errors
/// Names the file, the key, the value found and what is allowed.
pub fn read_rig(wanted: &Path) -> Result<Rig, Failure> {
    Rig::from_toml(&rig_text(wanted)?).map_err(|e| Failure::in_file(wanted, e))
}

/// A rig description's text by path or name.
///
/// # Errors
/// There is no such file or rig.
pub fn rig_text(wanted: &Path) -> Result<String, Failure> {
    text_of(wanted, "config/thrusters", "rig description", RIGS)
}

/// A scenario's text by path or name.
///
/// # Errors
/// There is no such file or scenario.
pub fn scenario_text(wanted: &Path) -> Result<String, Failure> {
    text_of(wanted, "config/scenarios", "scenario", SCENARIOS)
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
