//! A known inflow is forgotten.

use super::columns::varies;
use super::{Change, Expected, Made};

/// The change.
pub const CHANGE: Change = Change {
    name: "forgotten_inflow",
    make: |recording, _| {
        let inflow = recording.column("ambient_m_s").filter(|cells| varies(cells))?;
        let top = inflow.iter().copied().filter(|cell| cell.is_finite()).fold(0.0, f64::max);
        recording.columns.retain(|column| column.name != "ambient_m_s");
        Some(Made {
            what: format!("inflow up to {top:.1} m/s forgotten"),
            expects: Expected::Named(vec!["ambient_axial_flow", "ambient_flow_unsteady"]),
        })
    },
};
