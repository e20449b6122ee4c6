//! A known compensation is forgotten: the command stands at the nominal supply, and the measured supply
//! is not in the log.

use super::columns::{cells, full_scale, held, varies};
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "forgotten_supply",
    make: |recording, _| {
        let supply = held(recording.column("supply_v")?);
        if !varies(&supply) {
            return None;
        }
        let nominal = full_scale(&supply);
        if recording.column("voltage_cmd_v").is_some() {
            for (cell, supply) in cells(recording, "voltage_cmd_v")?.iter_mut().zip(&supply) {
                *cell *= nominal / supply;
            }
        } else if recording.column("duty_cmd").is_none() {
            return None;
        }
        recording.columns.retain(|column| column.name != "supply_v");
        let least = supply.iter().copied().fold(f64::INFINITY, f64::min);
        Some(Made {
            what: format!("supply of {least:.1} to {nominal:.1} V forgotten"),
            expects: Expected::Named(vec!["supply_sag", "voltage_limit_backemf"]),
        })
    },
};
