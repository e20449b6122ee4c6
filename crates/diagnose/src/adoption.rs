//! What of a diagnosis a rig description may take over: from then on fits, observers and control laws count on it.

use kort_identify::data::Prepared;
use kort_identify::scores::ParameterReport;
use kort_identify::simulate::Problem;
use kort_thruster::effects::{self, Path, Scale};
use kort_thruster::rig::short;

use crate::decide::BELIEVED;
use crate::words::plain;

/// Standard errors to either side within which a value is stated to lie: the tolerance of a rig is two sigma.
const STATED_WITHIN: f64 = 2.0;

/// Why a rig description does not take a finding over; none where it may.
pub fn why_not(
    problem: &Problem,
    effect: &str,
    probability: f64,
    rivals: &[&str],
    parameters: &[ParameterReport],
) -> Option<String> {
    // At which instant between two rows of the log the drive was told to step is not known: anywhere is as likely, and a lag
    // that is not longer may as well be when it was told.
    let intervals = problem.recorded().map(Prepared::step_interval_s);
    let told_s = intervals.fold(f64::INFINITY, f64::min) / 12.0_f64.sqrt();
    refused(effect, probability, rivals, parameters, told_s)
}

/// The same where the instant at which the drive is told to step has this standard deviation, s.
fn refused(
    effect: &str,
    probability: f64,
    rivals: &[&str],
    parameters: &[ParameterReport],
    told_s: f64,
) -> Option<String> {
    if !rivals.is_empty() {
        let rivals: Vec<String> = rivals.iter().map(|id| plain(id)).collect();
        return Some(format!("this recording cannot tell it from {}", rivals.join(", ")));
    }
    if probability < BELIEVED {
        return Some(format!("its probability of {probability:.2} is below {BELIEVED}"));
    }
    let descriptor = effects::find(effect);
    let specs = descriptor.map_or_else(Vec::new, |e| (e.parameters)(&Scale::ANY));
    let of_drive = descriptor.is_some_and(|e| e.path == Path::Drive);
    let instant_s = |p: &ParameterReport| if of_drive && p.unit == "s" { told_s } else { 0.0 };
    let is_shape = |p: &ParameterReport| specs.iter().any(|spec| spec.name == p.name && spec.shape);
    let strengths: Vec<&ParameterReport> = parameters.iter().filter(|p| !is_shape(p)).collect();
    // What has no size has none to be told from nothing.
    let untold = !strengths.is_empty() && !strengths.iter().any(|p| differs_from_nothing(p, instant_s(p)));
    let sizes = || strengths.iter().map(|p| size(p, instant_s(p))).collect::<Vec<_>>().join(", ");
    untold.then(|| format!("its size cannot be told from nothing: {}", sizes()))
}

/// Whether the interval that a rig would state of a strength leaves nothing out; at a bound the error says nothing of it.
fn differs_from_nothing(strength: &ParameterReport, instant_s: f64) -> bool {
    strength.at_bound != Some(true)
        && strength.value.abs() > STATED_WITHIN * strength.std_error.hypot(instant_s)
}

fn size(strength: &ParameterReport, instant_s: f64) -> String {
    let doubt = match strength.at_bound {
        Some(true) => "the edge of what is allowed".into(),
        _ if instant_s > strength.std_error => {
            format!("between its rows the log leaves {instant_s:.4} s open")
        }
        _ => format!("standard error {}", short(strength.std_error)),
    };
    format!("{} = {} {} ({doubt})", strength.name, short(strength.value), strength.unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted(name: &str, value: f64, std_error: f64, at_bound: bool) -> ParameterReport {
        let (name, unit) = (name.into(), "s".into());
        ParameterReport { name, value, unit, std_error, stated: None, at_bound: Some(at_bound) }
    }

    #[test]
    fn what_cannot_be_told_from_nothing_by_its_own_size_is_refused() {
        let lag = |value, std_error, at_bound| {
            refused("amplifier_lag", 0.84, &[], &[fitted("extra_lag_s", value, std_error, at_bound)], 0.0)
        };
        let why = lag(-0.0009, 0.001, false).unwrap();
        assert!(why.contains("told from nothing: extra_lag_s = -0.0009 s (standard error 0.001)"), "{why}");
        assert!(lag(-0.0009, 1e-5, true).is_some_and(|why| why.contains("edge of what is allowed")));
        assert_eq!(lag(0.004, 0.001, false), None);
        // Of a loop that swings the damping alone is no size, and one strength that is known is enough.
        let time = |std_error| {
            let shape = fitted("loop_damping_ratio", 0.7, 0.01, false);
            let lag = fitted("extra_lag_s", 1e-4, 1e-3, false);
            refused(
                "amplifier_lag",
                0.9,
                &[],
                &[lag, fitted("loop_time_s", 0.01, std_error, false), shape],
                0.0,
            )
        };
        assert_eq!(time(0.001), None);
        assert!(time(0.01).is_some_and(|why| !why.contains("damping")));
    }

    #[test]
    fn what_is_unlikely_or_has_a_rival_is_refused_and_what_has_no_size_needs_none() {
        let known = [fitted("coulomb_torque_n_m", 1.0, 0.02, false)];
        let friction =
            |probability, rivals: &[&str]| refused("coulomb_friction", probability, rivals, &known, 0.003);
        assert_eq!(friction(0.7, &[]), None);
        assert_eq!(friction(0.69, &[]).unwrap(), "its probability of 0.69 is below 0.7");
        assert!(friction(0.9, &["windage_drag"]).is_some_and(|why| why.ends_with("from windage drag")));
        assert_eq!(refused("axial_flow_dynamics", 0.9, &[], &[], 0.003), None);
    }

    #[test]
    fn a_lag_within_a_row_of_the_log_is_no_lag_of_the_drive_and_may_be_one_of_a_sensor() {
        // Rows 10 ms apart.
        let told_s = 0.01 / 12.0_f64.sqrt();
        let of = |effect: &str, name: &str, value: f64| {
            refused(effect, 0.8, &[], &[fitted(name, value, 2e-4, false)], told_s)
        };
        let why = of("amplifier_lag", "loop_time_s", 0.0029).unwrap();
        assert!(why.contains("0.0029 s open"), "{why}");
        assert!(of("transport_delay", "delay_s", 0.004).is_some());
        assert_eq!(of("amplifier_lag", "loop_time_s", 0.0086), None);
        assert_eq!(of("thrust_sensor_lag", "thrust_lag_s", 0.0029), None);
    }
}
