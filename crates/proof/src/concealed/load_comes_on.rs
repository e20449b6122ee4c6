//! A load comes on in mid-run: from then on the recorded driver is larger by what it takes.

use super::columns::{cells, driver, full_scale, held};
use super::{Change, Expected, Made};

/// Share of full scale.
const SHARE: f64 = 0.2;
/// Instant over the run.
const WHEN: f64 = 0.55;

/// The change.
pub const CHANGE: Change = Change {
    name: "load_comes_on",
    make: |recording, _| {
        let name = driver(recording).filter(|name| *name != "duty_cmd")?;
        let (first, last) = (*recording.time_s.first()?, *recording.time_s.last()?);
        let at_s = first + WHEN * (last - first);
        let speed = held(recording.column("shaft_speed_rad_s")?);
        let still = 0.005 * full_scale(&speed);
        let time_s = recording.time_s.clone();
        let cells = cells(recording, name)?;
        let load = SHARE * full_scale(cells);
        for ((cell, time), speed) in cells.iter_mut().zip(time_s).zip(speed) {
            if time > at_s && speed.abs() > still {
                *cell += load * speed.signum();
            }
        }
        Some(Made {
            what: format!("{name} larger by a load of {load:.4} from {at_s:.2} s on"),
            expects: Expected::Nameless(&["shaft", "drive"], &[]),
        })
    },
};
