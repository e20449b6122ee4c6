//! The state at the first row.

use super::{Driving, Prepared, Series};

/// Share of the largest command below which a standing shaft may be held by friction.
const STANDING_SHARE: f64 = 0.1;

/// Shaft speed, axial flow, current and shaft angle at the first row, and the command before it where that is known: a
/// shaft that stands although something is asked for was asked just now, and for nothing until then. A logger that a
/// drive's enabling starts begins so.
pub(super) fn start_state(series: &Series, prepared: &Prepared) -> ([f64; 4], Option<f64>) {
    let first =
        |name: &str| series.column(name).and_then(|c| c.iter().take(10).copied().find(|v| v.is_finite()));
    let speed_scale = series
        .column("shaft_speed_rad_s")
        .map_or(0.0, |c| c.iter().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs())));
    let speed = first("shaft_speed_rad_s").unwrap_or(0.0);
    if speed.abs() < 0.01 * speed_scale || speed_scale == 0.0 {
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
        return ([0.0, 0.0, current, 0.0], before);
    }
    let flow = first("flow_m_s").unwrap_or(0.0);
    // Under a recorded power the current follows from it at once.
    let asked = if prepared.driving == Driving::Power { None } else { prepared.command.first().copied() };
    let current = first("current_a").or(asked).unwrap_or(0.0);
    ([speed, flow, current, first("shaft_angle_rad").unwrap_or(0.0)], None)
}
