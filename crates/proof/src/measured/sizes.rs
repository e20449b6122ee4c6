//! Which of our parameters a size in a key means, and in which unit.
//!
//! Keys name their sizes freely; this table is all that is known of them. A size that is not in it is
//! not compared. Sizes in amperes are ours in newton metres over the torque constant that the report's
//! baseline fitted: on a rig whose torque constant is a guess only the ratio was measured.

use serde::Serialize;
use serde_json::Value;
use toml::Value as Toml;

use crate::report::Report;

/// Relative error up to which a size holds.
pub const HOLDS: f64 = 0.2;

/// How our value becomes one of the key.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unit {
    /// The same unit.
    Same,
    /// Newton metres over the fitted torque constant: amperes.
    PerTorqueConstant,
}

/// Effect, size in the key, our parameters (their sum is meant), unit.
const SIZES: &[(&str, &str, &[&str], Unit)] = &[
    ("coulomb_friction", "coulomb_current_a", &["coulomb_torque_n_m"], Unit::PerTorqueConstant),
    ("coulomb_friction", "coulomb_torque_n_m", &["coulomb_torque_n_m"], Unit::Same),
    ("viscous_friction", "viscous_current_a_s_rad", &["viscous_friction_nm_s"], Unit::PerTorqueConstant),
    ("viscous_friction", "viscous_friction_nm_s", &["viscous_friction_nm_s"], Unit::Same),
    ("gear_load_friction", "k", &["gear_friction_share"], Unit::Same),
    ("encoder_filter_lag", "lag_s", &["filter_excess_s", "second_lag_s"], Unit::Same),
    ("transport_delay", "delay_s", &["delay_s"], Unit::Same),
    ("amplifier_lag", "lag_s", &["extra_lag_s"], Unit::Same),
    ("thrust_sensor_lag", "thrust_lag_s", &["thrust_lag_s"], Unit::Same),
    ("thrust_bias_gain_hysteresis", "bias_n", &["bias_n"], Unit::Same),
    ("torque_channel_bias", "bias_n_m", &["shaft_torque_bias_n_m"], Unit::Same),
    ("torque_channel_bias", "bias_a", &["shaft_torque_bias_n_m"], Unit::PerTorqueConstant),
    ("supply_sag", "source_resistance_ohm", &["source_resistance_ohm"], Unit::Same),
    ("command_dead_band", "half_width", &["half_width"], Unit::Same),
    ("clock_skew", "thrust_delay_s", &["thrust_delay_s"], Unit::Same),
    ("clock_skew", "speed_delay_s", &["encoder_delay_s"], Unit::Same),
];

/// One size held against the key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Size {
    /// Effect.
    pub effect: String,
    /// Name in the key.
    pub name: String,
    /// The key's value, or the ends of its range.
    pub key: [f64; 2],
    /// Ours, in the key's unit.
    pub ours: f64,
    /// Ours lies within a fifth of the key.
    pub holds: bool,
}

/// Sizes of a finding that the key gives and the table knows.
pub fn sizes(effect: &str, key: &toml::Table, report: &Report) -> Vec<Size> {
    let findings = report.findings();
    let Some(finding) = findings.iter().find(|named| named.effect == effect) else { return Vec::new() };
    let parameter = |list: &Value, name: &str| {
        list.as_array()?.iter().find(|p| p["name"] == name).and_then(|p| p["value"].as_f64())
    };
    let torque_constant = parameter(&report.0["baseline"]["parameters"], "torque_constant_nm_a");
    SIZES
        .iter()
        .filter(|(of, ..)| *of == effect)
        .filter_map(|(_, name, ours, unit)| {
            let [low, high] = range(key.get(*name)?)?;
            let found: Vec<f64> =
                ours.iter().filter_map(|own| parameter(&finding.body["parameters"], own)).collect();
            if found.is_empty() {
                return None;
            }
            let sum: f64 = found.iter().sum();
            let ours = match unit {
                Unit::Same => sum,
                Unit::PerTorqueConstant => sum / torque_constant?,
            };
            let most = HOLDS * low.abs().max(high.abs());
            let holds = ours >= low - most && ours <= high + most;
            Some(Size { effect: effect.into(), name: (*name).into(), key: [low, high], ours, holds })
        })
        .collect()
}

/// A number, or a pair that is a range.
fn range(value: &Toml) -> Option<[f64; 2]> {
    let number = |value: &Toml| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
    match value {
        Toml::Array(list) if list.len() == 2 => {
            let (a, b) = (number(&list[0])?, number(&list[1])?);
            Some([a.min(b), a.max(b)])
        }
        other => number(other).map(|one| [one, one]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn amperes_are_newton_metres_over_the_fitted_torque_constant() {
        let body = json!({ "baseline": { "parameters": [{ "name": "torque_constant_nm_a", "value": 0.02 }] },
            "findings": [{ "effect": "coulomb_friction", "parameters": [{ "name": "coulomb_torque_n_m", "value": 0.0016 }] }] });
        let key: toml::Table = "coulomb_current_a = 0.074\nother = 3".parse().unwrap();
        let list = sizes("coulomb_friction", &key, &Report(&body));
        assert_eq!(list.len(), 1);
        assert!((list[0].ours - 0.08).abs() < 1e-12 && list[0].holds);
    }

    #[test]
    fn a_range_holds_between_its_ends_and_a_fifth_beyond() {
        let report = |lag: f64| json!({ "findings": [{ "effect": "thrust_sensor_lag", "parameters": [{ "name": "thrust_lag_s", "value": lag }] }] });
        let key: toml::Table = "thrust_lag_s = [0.025, 0.035]".parse().unwrap();
        for (lag, holds) in [(0.030, true), (0.041, true), (0.045, false), (0.010, false)] {
            let body = report(lag);
            assert_eq!(sizes("thrust_sensor_lag", &key, &Report(&body))[0].holds, holds, "{lag}");
        }
        assert!(sizes("transport_delay", &key, &Report(&report(0.03))).is_empty(), "not found, no size");
    }
}
