//! The speed is filtered once more.

use super::columns::{cells, lagged, row_s};
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "late_speed",
    make: |recording, _| {
        let lag_s = (4.0 * row_s(recording)).max(0.03);
        let late = lagged(&recording.time_s, recording.column("shaft_speed_rad_s")?, lag_s);
        *cells(recording, "shaft_speed_rad_s")? = late;
        Some(Made {
            what: format!("shaft speed behind a lag of {:.0} ms", 1e3 * lag_s),
            expects: Expected::Named(vec!["encoder_filter_lag"]),
        })
    },
};
