//! The run is mirrored: ahead is astern. Physics that has a side has the other; the names stay.

use super::{Change, Expected, Made};

/// Columns with a direction.
const SIGNED: [&str; 12] = [
    "current_cmd_a",
    "current_a",
    "voltage_cmd_v",
    "voltage_q_v",
    "duty_cmd",
    "speed_cmd_rad_s",
    "shaft_angle_cmd_rad",
    "shaft_angle_rad",
    "shaft_speed_rad_s",
    "thrust_n",
    "torque_n_m",
    "flow_m_s",
];

/// The change.
pub const CHANGE: Change = Change {
    name: "mirrored",
    make: |recording, _| {
        // Duct, camber and a pendulum's zero have a side that the rig states; a dry shaft's speed has none.
        recording.column("shaft_speed_rad_s")?;
        if recording.column("thrust_n").is_some() {
            return None;
        }
        for column in recording.columns.iter_mut().filter(|column| SIGNED.contains(&column.name.as_str())) {
            column.values.iter_mut().for_each(|value| *value = -*value);
        }
        Some(Made { what: "the run mirrored: the same names".into(), expects: Expected::TheSame })
    },
};
