//! A bent throttle: the recorded command is what, through u + c u |u| (ends kept), drives as it was
//! driven.

use super::columns::{cells, driver, full_scale};
use super::{Change, Expected, Made};

/// Share of the bend.
const BEND: f64 = 0.35;

/// The change.
pub const CHANGE: Change = Change {
    name: "throttle_curve",
    make: |recording, _| {
        let name = driver(recording).filter(|name| name.contains("_cmd"))?;
        let cells = cells(recording, name)?;
        let full = full_scale(cells);
        for cell in cells.iter_mut().filter(|cell| cell.is_finite()) {
            // (1 - c) x + c x^2 = y for y at most one; beyond it the straight line goes on.
            let y = cell.abs() / full;
            let x = if y <= 1.0 {
                (((1.0 - BEND).powi(2) + 4.0 * BEND * y).sqrt() - (1.0 - BEND)) / (2.0 * BEND)
            } else {
                1.0 + (y - 1.0) / (1.0 + BEND)
            };
            *cell = cell.signum() * x * full;
        }
        Some(Made {
            what: format!("{name} bent by {:.0} % of its square", 100.0 * BEND),
            expects: Expected::Named(vec!["command_curve"]),
        })
    },
};
