//! The columns kort knows, as the recording contract names them.

/// What a column is to a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The log instant.
    Time,
    /// What was asked for; drives a model.
    Command,
    /// What was measured of the thruster; a model's response, and in part able to drive it.
    Measured,
    /// What surrounds the thruster.
    Environment,
}

/// One known column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Name in files, reports and the API; the unit is its end.
    pub name: &'static str,
    /// Unit for display.
    pub unit: &'static str,
    /// What it is to a model.
    pub role: Role,
    /// Meaning and sign.
    pub meaning: &'static str,
}

const fn known(name: &'static str, unit: &'static str, role: Role, meaning: &'static str) -> Known {
    Known { name, unit, role, meaning }
}

/// Every known column; positive means ahead.
pub const KNOWN: &[Known] = &[
    known("time_s", "s", Role::Time, "log instant, strictly increasing"),
    known("current_cmd_a", "A", Role::Command, "commanded motor current"),
    known("current_a", "A", Role::Measured, "measured motor current"),
    known("voltage_cmd_v", "V", Role::Command, "commanded motor voltage"),
    known("duty_cmd", "1", Role::Command, "commanded duty, -1 to 1 of the supply"),
    known("speed_cmd_rad_s", "rad/s", Role::Command, "commanded shaft speed"),
    known("thrust_cmd_n", "N", Role::Command, "commanded thrust"),
    known("shaft_angle_rad", "rad", Role::Measured, "shaft angle, unwrapped"),
    known("shaft_speed_rad_s", "rad/s", Role::Measured, "shaft speed"),
    known("thrust_n", "N", Role::Measured, "measured thrust"),
    known("torque_n_m", "N m", Role::Measured, "propeller torque, positive against positive shaft speed"),
    known("flow_m_s", "m/s", Role::Measured, "axial flow through the propeller"),
    known("ambient_m_s", "m/s", Role::Environment, "flow past the thruster far ahead of it"),
    known("supply_v", "V", Role::Environment, "supply voltage at the drive"),
    known("temperature_c", "C", Role::Environment, "temperature of motor or water, degrees Celsius"),
    known("depth_m", "m", Role::Environment, "depth of the propeller below the surface"),
];

/// The known column of this name.
pub fn find(name: &str) -> Option<&'static Known> {
    KNOWN.iter().find(|k| k.name == name)
}

/// Words for a quantity that mean nothing without a unit.
const BARE_WORDS: &[&str] = &[
    "time", "t", "rpm", "erpm", "pwm", "speed", "omega", "angle", "force", "voltage", "velocity", "position",
    "pressure", "power", "temp",
];

/// If `name` is a quantity of ours with its unit missing or another than ours: the known column it
/// comes nearest to (or `None` if the quantity is plain but no known column fits).
///
/// `thrust`, `shaft_speed_rpm` and `voltage` are such names; `valve_open` and `humidity_percent`
/// are not: they are kept as unknown columns.
pub fn unit_missing(name: &str) -> Option<Option<&'static Known>> {
    let name = name.trim().to_lowercase();
    let stem = crate::units::split_suffix(&name).map_or(name.as_str(), |(stem, _)| stem);
    let stem_of = |k: &Known| crate::units::split_suffix(k.name).map_or(k.name, |(s, _)| s);
    let fits = |k: &&Known| stem_of(k) == stem || stem_of(k) == name;
    if let Some(k) = KNOWN.iter().find(fits) {
        return (k.name != name).then_some(Some(k));
    }
    let bare = BARE_WORDS.contains(&name.as_str());
    let near = match name.as_str() {
        "speed" | "rpm" | "omega" => find("shaft_speed_rad_s"),
        "angle" => find("shaft_angle_rad"),
        "force" => find("thrust_n"),
        "voltage" => find("supply_v"),
        "temp" => find("temperature_c"),
        "pwm" => find("duty_cmd"),
        _ => None,
    };
    bare.then_some(near)
}

/// The nearest of `names` to `wanted`, if any comes near.
pub fn nearest<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    names
        .into_iter()
        .map(|n| (strsim::jaro_winkler(&wanted.to_lowercase(), &n.to_lowercase()), n))
        .filter(|(score, _)| *score > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, n)| n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_our_unit_are_told_from_unknown_ones() {
        for bare in ["thrust", "shaft_speed_rpm", "Current", "thrust_kgf", "rpm", "voltage", "current_ma"] {
            assert!(unit_missing(bare).is_some(), "{bare}");
        }
        assert_eq!(unit_missing("shaft_speed").unwrap().unwrap().name, "shaft_speed_rad_s");
        for other in
            ["valve_open", "damping_level", "humidity_percent", "other_speed_rad_s", "motor2_current_a"]
        {
            assert!(unit_missing(other).is_none(), "{other}");
        }
        for ours in KNOWN {
            assert!(unit_missing(ours.name).is_none(), "{}", ours.name);
        }
    }

    #[test]
    fn every_known_name_ends_in_its_unit() {
        for k in KNOWN.iter().filter(|k| k.unit != "1") {
            assert_eq!(crate::units::of_column(k.name).unwrap().symbol, k.unit, "{}", k.name);
        }
    }
}
