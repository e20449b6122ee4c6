//! The current sensor's zero is off: the recorded driver holds a part that drives nothing.

use super::columns::{cells, driver, full_scale};
use super::{Change, Expected, Made};

/// Share of full scale.
const SHARE: f64 = 0.1;

/// The change.
pub const CHANGE: Change = Change {
    name: "torque_zero",
    make: |recording, _| {
        let name = driver(recording)?;
        let both_ways = recording.column("shaft_speed_rad_s")?.iter().any(|speed| *speed < 0.0);
        let cells = cells(recording, name)?;
        let zero = SHARE * full_scale(cells);
        cells.iter_mut().for_each(|cell| *cell += zero);
        // One way only, it is as good as dry friction.
        let names = if both_ways {
            vec!["torque_channel_bias"]
        } else {
            vec!["torque_channel_bias", "coulomb_friction"]
        };
        Some(Made { what: format!("{name} {zero:.4} too high"), expects: Expected::Named(names) })
    },
};
