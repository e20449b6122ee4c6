//! A dead band: the recorded command is what must be asked for, through it, to drive as it was driven.

use super::columns::{cells, driver, full_scale};
use super::{Change, Expected, Made};

/// Share of full scale.
const SHARE: f64 = 0.1;

/// The change.
pub const CHANGE: Change = Change {
    name: "dead_band",
    make: |recording, _| {
        let name = driver(recording).filter(|name| name.contains("_cmd"))?;
        let cells = cells(recording, name)?;
        let half = SHARE * full_scale(cells);
        for cell in cells.iter_mut().filter(|cell| **cell != 0.0 && cell.is_finite()) {
            *cell += half * cell.signum();
        }
        Some(Made {
            what: format!("{name} through a dead band of {half:.4}"),
            expects: Expected::Named(vec!["command_dead_band", "coulomb_friction"]),
        })
    },
};
