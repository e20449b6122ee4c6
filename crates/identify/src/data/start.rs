//! The state at the first row.

use super::{Driving, Prepared, Series};

/// Share of the largest command below which a standing shaft may be held by friction.
const STANDING_SHARE: f64 = 0.1;

/// Shaft speed, axial flow, current and shaft angle at the first row, and the command before it where that is known: a
/// shaft that stands although something is asked for was asked just now, and for nothing until then. A logger that a
/// drive's enabling starts begins so.
pub(super) fn start_state(series: &Series, prepared: &Prepared) -> ([f64; 4], Option<f64>) {
    let first = |name: &str| first_of(series, name);
    let (speed, angle) = (first("shaft_speed_rad_s").unwrap_or(0.0), first("shaft_angle_rad").unwrap_or(0.0));
    if starts_from_rest(series) || fastest(series) == 0.0 {
        let asked = prepared.command.first().copied().unwrap_or(0.0);
        let range = prepared.command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        let just_now =
            matches!(prepared.driving, Driving::Command(_)) && asked.abs() >= STANDING_SHARE * range;
        let before = (just_now && asked != 0.0).then_some(0.0);
        let current = match prepared.driving {
            Driving::Command("current_cmd_a") if just_now => {
                first("current_a").map_or(0.0, |measured| measured.clamp(-asked.abs(), asked.abs()))
            }
            Driving::Command("current_cmd_a") => asked,
            _ => 0.0,
        };
        return ([0.0, 0.0, current, angle], before);
    }
    let flow = first("flow_m_s").unwrap_or(0.0);
    // Under a recorded power the current follows from it at once.
    let asked = if prepared.driving == Driving::Power { None } else { prepared.command.first().copied() };
    let current = first("current_a").or(asked).unwrap_or(0.0);
    ([speed, flow, current, angle], None)
}

/// A shaft stands where it turns by less than this share of its fastest.
const STANDING: f64 = 0.01;

/// Whether the shaft stands at the first row and turns later.
pub(super) fn starts_from_rest(series: &Series) -> bool {
    first_of(series, "shaft_speed_rad_s").unwrap_or(0.0).abs() < STANDING * fastest(series)
}

/// Fastest that the shaft was recorded to turn, rad/s; zero where no speed is.
fn fastest(series: &Series) -> f64 {
    let of = |column: &[f64]| column.iter().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()));
    series.column("shaft_speed_rad_s").map_or(0.0, of)
}

fn first_of(series: &Series, name: &str) -> Option<f64> {
    series.column(name)?.iter().take(10).copied().find(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use crate::data::{Prepared, Series};

    /// Command before the first row of a log whose first command and speed are these.
    fn before(command_a: f64, speed_rad_s: f64) -> Option<f64> {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let rig = Rig::from_toml(rig).unwrap();
        let rows = 100;
        let time_s = (0..rows).map(|k| 0.01 * f64::from(k)).collect();
        let columns = vec![
            ("current_cmd_a".into(), (0..rows).map(|k| if k < 50 { command_a } else { -2.0 }).collect()),
            ("shaft_speed_rad_s".into(), (0..rows).map(|k| speed_rad_s + f64::from(k)).collect()),
        ];
        Prepared::new(&Series { name: "log".into(), time_s, columns }, &rig, false).unwrap().before
    }

    #[test]
    fn a_shaft_that_stands_starts_where_its_encoder_says() {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let columns = vec![
            ("current_cmd_a".into(), (0..100).map(|k| if k < 50 { 0.0 } else { 1.0 }).collect()),
            ("shaft_speed_rad_s".into(), (0..100).map(|k| f64::from((k - 50).max(0))).collect()),
            (
                "shaft_angle_rad".into(),
                (0..100).map(|k| 68.0 + 0.005 * f64::from((k - 50).max(0)).powi(2)).collect(),
            ),
        ];
        let time_s = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let log = Series { name: "log".into(), time_s, columns };
        let prepared = Prepared::new(&log, &Rig::from_toml(rig).unwrap(), false).unwrap();
        assert_eq!(prepared.start, [0.0, 0.0, 0.0, 68.0]);
    }

    #[test]
    fn a_shaft_that_stands_under_a_live_command_was_asked_for_nothing_until_then() {
        assert_eq!(before(2.0, 0.0), Some(0.0));
        assert_eq!(before(2.0, 40.0), None, "it was under way");
        assert_eq!(before(0.0, 0.0), None, "it is asked for nothing");
    }
}
