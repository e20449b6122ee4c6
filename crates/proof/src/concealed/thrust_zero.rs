//! The force sensor's zero is off.

use super::columns::{cells, full_scale};
use super::{Change, Expected, Made};

/// Share of full scale.
const SHARE: f64 = 0.04;

/// The change.
pub const CHANGE: Change = Change {
    name: "thrust_zero",
    make: |recording, _| {
        let cells = cells(recording, "thrust_n")?;
        let zero_n = SHARE * full_scale(cells);
        cells.iter_mut().for_each(|cell| *cell += zero_n);
        Some(Made {
            what: format!("thrust {zero_n:.3} N too high"),
            expects: Expected::Named(vec!["thrust_bias_gain_hysteresis"]),
        })
    },
};
