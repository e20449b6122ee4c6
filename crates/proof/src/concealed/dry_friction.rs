//! Dry friction: the recorded driver is larger by what friction would take while the shaft turns.

use super::columns::{cells, driver, full_scale, held};
use super::{Change, Expected, Made};

/// Share of full scale.
const SHARE: f64 = 0.12;

/// The change.
pub const CHANGE: Change = Change {
    name: "dry_friction",
    make: |recording, _| {
        let name = driver(recording).filter(|name| *name != "duty_cmd")?;
        let speed = held(recording.column("shaft_speed_rad_s")?);
        let still = 0.005 * full_scale(&speed);
        if !speed.iter().any(|speed| *speed < -still) {
            return None;
        }
        let cells = cells(recording, name)?;
        let level = SHARE * full_scale(cells);
        for (cell, speed) in cells.iter_mut().zip(&speed) {
            *cell += if speed.abs() > still { level * speed.signum() } else { 0.0 };
        }
        Some(Made {
            what: format!("{name} larger by a friction of {level:.4}"),
            expects: Expected::Named(vec!["coulomb_friction", "direction_dependent_friction"]),
        })
    },
};
