//! The speed sensor loses its sign.

use super::columns::{cells, full_scale};
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "unsigned_speed",
    make: |recording, _| {
        let cells = cells(recording, "shaft_speed_rad_s")?;
        let full = full_scale(cells);
        if !cells.iter().any(|speed| *speed < -0.1 * full) || !cells.iter().any(|speed| *speed > 0.1 * full) {
            return None;
        }
        cells.iter_mut().for_each(|speed| *speed = speed.abs());
        // The angle would give the sign away.
        recording.columns.retain(|column| column.name != "shaft_angle_rad");
        Some(Made {
            what: "shaft speed without its sign, no angle".into(),
            expects: Expected::Named(vec!["unsigned_speed_sensor"]),
        })
    },
};
