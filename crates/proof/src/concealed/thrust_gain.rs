//! The force sensor's gain is off one way: pulls read too small. (Off both ways, the blade's stated
//! coefficients would take it.)

use super::columns::{cells, varies};
use super::{Change, Expected, Made};

/// Share.
const SHARE: f64 = 0.15;

/// The change.
pub const CHANGE: Change = Change {
    name: "thrust_gain",
    make: |recording, _| {
        let cells = cells(recording, "thrust_n")?;
        if !varies(cells) || !cells.iter().any(|cell| *cell < 0.0) {
            return None;
        }
        cells.iter_mut().filter(|cell| **cell < 0.0).for_each(|cell| *cell *= 1.0 - SHARE);
        Some(Made {
            what: format!("thrust astern {:.0} % too small", 100.0 * SHARE),
            expects: Expected::Named(vec!["forward_reverse_asymmetry", "thrust_bias_gain_hysteresis"]),
        })
    },
};
