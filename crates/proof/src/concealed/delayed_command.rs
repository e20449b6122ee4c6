//! The command reaches the drive late: the recorded one is put earlier by the delay, so that what
//! drives the machine comes that much after it.

use super::columns::{cells, driver, held, held_at, row_s};
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "delayed_command",
    make: |recording, _| {
        let name = driver(recording)?;
        let delay_s = (3.0 * row_s(recording)).max(0.025);
        let (time_s, own) = (recording.time_s.clone(), held(recording.column(name)?));
        let earlier: Vec<f64> = time_s.iter().map(|t| held_at(&time_s, &own, t + delay_s)).collect();
        *cells(recording, name)? = earlier;
        // Beside a measured current the same shift is one of clocks.
        let names =
            if name == "current_a" { vec!["clock_skew", "transport_delay"] } else { vec!["transport_delay"] };
        Some(Made {
            what: format!("{name} {:.0} ms before what drives", 1e3 * delay_s),
            expects: Expected::Named(names),
        })
    },
};
