//! The encoder sits off its centre: angle and speed swing once a turn.

use super::columns::{cells, full_scale, held};
use super::{Change, Expected, Made};

/// Angle error, rad.
const ERROR_RAD: f64 = 0.05;

/// The change.
pub const CHANGE: Change = Change {
    name: "eccentricity",
    make: |recording, _| {
        let angle = held(recording.column("shaft_angle_rad")?);
        // Fewer than a few turns show no order.
        if full_scale(&angle.iter().map(|q| q - angle[0]).collect::<Vec<_>>()) < 40.0 {
            return None;
        }
        for (cell, q) in cells(recording, "shaft_speed_rad_s")?.iter_mut().zip(&angle) {
            *cell *= 1.0 + ERROR_RAD * (q + 0.7).cos();
        }
        for (cell, q) in cells(recording, "shaft_angle_rad")?.iter_mut().zip(&angle) {
            *cell += ERROR_RAD * (q + 0.7).sin();
        }
        Some(Made {
            what: format!("angle off by {ERROR_RAD} rad once a turn"),
            expects: Expected::Named(vec!["encoder_eccentricity"]),
        })
    },
};
