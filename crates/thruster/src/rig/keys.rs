//! Every key of a rig description, and what is said of one that is wrong.

use super::RigError;

/// Every key, with the range a number must lie in (both ends allowed) and a hint on units.
pub(super) type Key = (&'static str, &'static str, Option<(f64, f64)>, &'static str);

pub(super) const KEYS: &[Key] = &[
    ("rig", "name", None, ""),
    ("rig", "class", None, ""),
    ("propeller", "kind", None, ""),
    ("propeller", "radius_m", Some((0.005, 10.0)), "metres: 0.13 for a 26 cm duct"),
    (
        "propeller",
        "duct_length_m",
        Some((0.001, 20.0)),
        "metres: 0.127 for a 12.7 cm duct; for an open propeller about one radius",
    ),
    ("propeller", "pitch_rad", Some((0.02, 1.4)), "radians: 0.39 for 22.5 degrees"),
    ("propeller", "lift_max", Some((0.01, 10.0)), "dimensionless, usually 0.3 to 2"),
    ("propeller", "drag_max", Some((0.0, 20.0)), "dimensionless, usually 0.3 to 2"),
    ("flow", "density_kg_m3", Some((1.0, 2000.0)), "998 in fresh water, 1025 in the sea"),
    ("flow", "flux_coefficient", Some((0.01, 20.0)), "dimensionless, 2 in theory"),
    ("flow", "added_mass_coefficient", Some((0.01, 50.0)), "dimensionless, usually 1 to 3"),
    ("motor", "inertia_kg_m2", Some((1e-9, 1e5)), "kg m^2, motor, shaft and propeller together"),
    ("motor", "torque_constant_nm_a", Some((1e-6, 1e4)), "N m/A"),
    ("motor", "winding_resistance_ohm", Some((1e-5, 1e4)), "ohm, the whole current path"),
    ("motor", "viscous_friction_nm_s", Some((0.0, 1e4)), "N m per rad/s"),
    ("amplifier", "kind", None, ""),
    ("amplifier", "time_constant_s", Some((0.0, 10.0)), "seconds: 0.002 for 2 ms"),
    ("amplifier", "current_limit_a", Some((1e-3, 1e6)), "ampere"),
    ("amplifier", "supply_v", Some((0.1, 1e5)), "volt"),
    ("sensors", "log_rate_hz", Some((0.01, 1e5)), "Hz"),
    ("sensors", "control_rate_hz", Some((0.1, 1e5)), "Hz"),
    ("sensors", "encoder_counts_per_rev", Some((1.0, 1e8)), "counts per turn"),
    ("sensors", "speed_filter_time_constant_s", Some((0.0, 100.0)), "seconds: 0.010 for 10 ms"),
    ("sensors", "thrust_filter_hz", Some((0.01, 1e6)), "Hz"),
    ("sensors", "thrust_full_scale_n", Some((1e-3, 1e8)), "newton, one side"),
    ("sensors", "thrust_bits", Some((2.0, 32.0)), "bits of the converter"),
    ("sensors", "torque_filter_hz", Some((0.01, 1e6)), "Hz"),
    ("sensors", "flow_rate_hz", Some((0.01, 1e5)), "Hz"),
    ("sensors", "torque", None, ""),
    ("sensors", "ambient_flow", None, ""),
    ("sensors", "thrust", None, ""),
    ("sensors", "flow", None, ""),
    ("load", "kind", None, ""),
    ("load", "mass_kg", Some((1e-6, 1e6)), "kilogram: the weight that swings, or what the axis moves"),
    ("load", "length_m", Some((1e-4, 100.0)), "metres from the shaft to the centre of the mass"),
    ("load", "inertia_kg_m2", Some((1e-9, 1e5)), "kg m^2, the load's side alone"),
    ("load", "stiffness_nm_rad", Some((1e-6, 1e9)), "N m per radian of twist"),
    ("load", "damping_nm_s", Some((0.0, 1e6)), "N m per rad/s of twist"),
    ("load", "fan_coefficient_nm_s2", Some((0.0, 1e6)), "torque over the square of shaft speed, N m s^2"),
    ("load", "lead_m_rev", Some((1e-6, 10.0)), "metres a turn of the shaft: 0.005 for a 5 mm screw"),
    ("load", "incline_rad", Some((-1.6, 1.6)), "radians, positive where turning ahead lifts; 0 is level"),
    ("run", "water", None, ""),
];

pub(super) fn value_error(key: &str, found: impl std::fmt::Display, allowed: &str, hint: &str) -> RigError {
    RigError::Value { key: key.into(), found: found.to_string(), allowed: allowed.into(), hint: hint.into() }
}

const TABLES: [&str; 9] =
    ["rig", "propeller", "flow", "motor", "amplifier", "sensors", "load", "run", "effects"];

/// Tables and keys that kort does not know; what each of them was probably meant to be is left in `meant`, as `table` or
/// `table.key`.
pub(super) fn check_keys(table: &toml::Table, wrong: &mut Vec<RigError>, meant: &mut Vec<String>) {
    for (name, value) in table {
        if !TABLES.contains(&name.as_str()) {
            let known = TABLES.iter().copied();
            meant.extend(near(name, known.clone()).map(str::to_owned));
            wrong.push(RigError::UnknownKey { key: name.clone(), hint: nearest(name, known) });
            continue;
        }
        // A list, read where its effects are known.
        if name == "effects" {
            continue;
        }
        let Some(inner) = value.as_table() else {
            let hint = format!("write [{name}] on a line of its own");
            wrong.push(value_error(name, value, "a table", &hint));
            continue;
        };
        let known = KEYS.iter().filter(|k| k.0 == name).map(|k| k.1);
        for key in inner.keys().filter(|key| !is_known(name, key)) {
            meant.extend(near(key, known.clone()).map(|near| format!("{name}.{near}")));
            wrong.push(RigError::UnknownKey {
                key: format!("{name}.{key}"),
                hint: nearest(key, known.clone()),
            });
        }
    }
}

/// Is it a key of this table, wanted there or not?
pub(super) fn is_known(table: &str, key: &str) -> bool {
    KEYS.iter().any(|k| (k.0, k.1) == (table, key))
}

/// The known word that this one was probably meant to be.
pub(super) fn near<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let best = known.max_by(|a, b| strsim::jaro_winkler(a, word).total_cmp(&strsim::jaro_winkler(b, word)));
    best.filter(|best| strsim::jaro_winkler(best, word) > 0.75)
}

pub(super) fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    match near(word, known.clone()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("known here: {}", known.collect::<Vec<_>>().join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::KEYS;

    #[test]
    fn the_docs_say_what_every_key_is() {
        let docs = include_str!("../../../../docs/recordings.md");
        let rows: Vec<&str> = docs.lines().filter(|line| line.starts_with('|')).collect();
        for (table, key, ..) in KEYS {
            let named = rows.iter().any(|row| row.contains(&format!("`{key}`")));
            assert!(named && docs.contains(&format!("`[{table}]`")), "{table}.{key}");
        }
    }
}
