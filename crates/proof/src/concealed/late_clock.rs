//! One channel's clock is behind: that of the thrust.

use super::columns::{between, cells, held, row_s};
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "late_clock",
    make: |recording, _| {
        let name = "thrust_n";
        let skew_s = (6.0 * row_s(recording)).max(0.06);
        let (time_s, own) = (recording.time_s.clone(), held(recording.column(name)?));
        let late: Vec<f64> = time_s.iter().map(|t| between(&time_s, &own, t - skew_s)).collect();
        let cells = cells(recording, name)?;
        for (cell, late) in cells.iter_mut().zip(late).filter(|(cell, _)| cell.is_finite()) {
            *cell = late;
        }
        Some(Made {
            what: format!("thrust logged {:.0} ms late", 1e3 * skew_s),
            expects: Expected::Named(vec!["clock_skew", "thrust_sensor_lag"]),
        })
    },
};
