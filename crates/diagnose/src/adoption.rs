//! What of a diagnosis a rig description may take over: from then on fits, observers and control laws count on it.

use kort_identify::scores::ParameterReport;
use kort_thruster::effects::{self, Scale};
use kort_thruster::rig::short;

use crate::decide::BELIEVED;
use crate::words::plain;

/// Standard errors to either side within which a value is stated to lie: the tolerance of a rig is two sigma.
const STATED_WITHIN: f64 = 2.0;

/// Why a rig description does not take a finding over; none where it may.
pub fn why_not(
    effect: &str,
    probability: f64,
    rivals: &[&str],
    parameters: &[ParameterReport],
) -> Option<String> {
    if !rivals.is_empty() {
        let rivals: Vec<String> = rivals.iter().map(|id| plain(id)).collect();
        return Some(format!("this recording cannot tell it from {}", rivals.join(", ")));
    }
    if probability < BELIEVED {
        return Some(format!("its probability of {probability:.2} is below {BELIEVED}"));
    }
    let specs = effects::find(effect).map_or_else(Vec::new, |e| (e.parameters)(&Scale::ANY));
    let is_shape = |p: &ParameterReport| specs.iter().any(|spec| spec.name == p.name && spec.shape);
    let strengths: Vec<&ParameterReport> = parameters.iter().filter(|p| !is_shape(p)).collect();
    // What has no size has none to be told from nothing.
    let untold = !strengths.is_empty() && !strengths.iter().any(|p| differs_from_nothing(p));
    let sizes = || strengths.iter().map(|p| size(p)).collect::<Vec<_>>().join(", ");
    untold.then(|| format!("its size cannot be told from nothing: {}", sizes()))
}

/// Whether the interval that a rig would state of a strength leaves nothing out; at a bound the error says nothing of it.
fn differs_from_nothing(strength: &ParameterReport) -> bool {
    strength.at_bound != Some(true) && strength.value.abs() > STATED_WITHIN * strength.std_error
}

fn size(strength: &ParameterReport) -> String {
    let doubt = match strength.at_bound {
        Some(true) => "the edge of what is allowed".into(),
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
            why_not("amplifier_lag", 0.84, &[], &[fitted("extra_lag_s", value, std_error, at_bound)])
        };
        let why = lag(-0.0009, 0.001, false).unwrap();
        assert!(why.contains("told from nothing: extra_lag_s = -0.0009 s (standard error 0.001)"), "{why}");
        assert!(lag(-0.0009, 1e-5, true).is_some_and(|why| why.contains("edge of what is allowed")));
        assert_eq!(lag(0.004, 0.001, false), None);
        // Of a loop that swings the damping alone is no size, and one strength that is known is enough.
        let time = |std_error| {
            let shape = fitted("loop_damping_ratio", 0.7, 0.01, false);
            let lag = fitted("extra_lag_s", 1e-4, 1e-3, false);
            why_not("amplifier_lag", 0.9, &[], &[lag, fitted("loop_time_s", 0.01, std_error, false), shape])
        };
        assert_eq!(time(0.001), None);
        assert!(time(0.01).is_some_and(|why| !why.contains("damping")));
    }

    #[test]
    fn what_is_unlikely_or_has_a_rival_is_refused_and_what_has_no_size_needs_none() {
        let known = [fitted("coulomb_torque_n_m", 1.0, 0.02, false)];
        let friction =
            |probability, rivals: &[&str]| why_not("coulomb_friction", probability, rivals, &known);
        assert_eq!(friction(0.7, &[]), None);
        assert_eq!(friction(0.69, &[]).unwrap(), "its probability of 0.69 is below 0.7");
        assert!(friction(0.9, &["windage_drag"]).is_some_and(|why| why.ends_with("from windage drag")));
        assert_eq!(why_not("axial_flow_dynamics", 0.9, &[], &[]), None);
    }
}
