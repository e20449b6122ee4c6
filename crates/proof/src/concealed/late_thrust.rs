//! The thrust is filtered once more.

use super::columns::{cells, lagged, row_s};
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "late_thrust",
    make: |recording, _| {
        let lag_s = (5.0 * row_s(recording)).max(0.05);
        let late = lagged(&recording.time_s, recording.column("thrust_n")?, lag_s);
        *cells(recording, "thrust_n")? = late;
        Some(Made {
            what: format!("thrust behind a lag of {:.0} ms", 1e3 * lag_s),
            expects: Expected::Named(vec!["thrust_sensor_lag"]),
        })
    },
};
