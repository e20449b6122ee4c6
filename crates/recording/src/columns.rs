//! The columns kort knows, as the recording contract names them.

use kort_proto::signals::SIGNALS;

use crate::units;

/// One known column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Name in files, reports and the API; the unit is its end.
    pub name: &'static str,
    /// Unit for display.
    pub unit: &'static str,
    /// Meaning and sign.
    pub meaning: &'static str,
}

/// The one column that is no signal.
pub(crate) const TIME: Known =
    Known { name: "time_s", unit: "s", meaning: "Log instant, strictly increasing." };

/// What a model is compared with: where none of it is there, or all of it stands still, there is nothing to compare.
pub(crate) const RESPONSES: [&str; 5] =
    ["shaft_speed_rad_s", "shaft_angle_rad", "thrust_n", "torque_n_m", "flow_m_s"];

/// Every known column: the time, then the one table of signals, in its order.
pub fn known() -> impl Iterator<Item = Known> {
    let signals = SIGNALS.iter().map(|signal| Known {
        name: signal.name,
        unit: units::of_column(signal.name).map_or(signal.unit, |unit| unit.symbol),
        meaning: signal.meaning,
    });
    std::iter::once(TIME).chain(signals)
}

/// The known column of this name.
pub fn find(name: &str) -> Option<Known> {
    known().find(|k| k.name == name)
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
pub fn unit_missing(name: &str) -> Option<Option<Known>> {
    let name = name.trim().to_lowercase();
    let stem = units::split_suffix(&name).map_or(name.as_str(), |(stem, _)| stem);
    let stem_of = |k: &Known| units::split_suffix(k.name).map_or(k.name, |(s, _)| s);
    let fits = |k: &Known| stem_of(k) == stem || stem_of(k) == name;
    if let Some(k) = known().find(fits) {
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
        for ours in known() {
            assert!(unit_missing(ours.name).is_none(), "{}", ours.name);
        }
    }

    #[test]
    fn every_known_name_ends_in_its_unit() {
        for k in known().filter(|k| k.unit != "1") {
            assert_eq!(units::of_column(k.name).unwrap().symbol, k.unit, "{}", k.name);
        }
        // The table of signals spells Celsius out; every other unit is the same symbol.
        for s in SIGNALS.iter().filter(|s| s.name != "temperature_c") {
            assert_eq!(find(s.name).unwrap().unit, s.unit, "{}", s.name);
        }
    }
}
