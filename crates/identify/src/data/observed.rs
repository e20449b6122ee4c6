//! How closely an observer keeps a simulated shaft with the recorded one.
//!
//! What returns to its course by itself runs freely. What integrates drifts away for reasons that are no physics: it is
//! pulled back, as slowly as it can be, so that what is faster stays to be seen. A closed loop of high gain lets its shaft
//! move little under much torque; there a second's drift is many times all that was recorded, and the pull must be faster.

use kort_thruster::plant::load_inertia_kg_m2;
use kort_thruster::rig::{AmplifierKind, Load, Rig};

use super::{Driving, Prepared, Response, Series};
use crate::over_the_top::TOP_RAD;

/// Least bandwidth of the observer on a shaft that nothing brings back to its course, rad/s: 1 Hz.
pub const OBSERVER_RAD_S: f64 = std::f64::consts::TAU;
/// Share of the torque that drives which may be unknown before anything is found: plausible dry friction.
const UNKNOWN_TORQUE: f64 = 0.3;
/// Speed off the course over `a / w` under a lasting acceleration `a` that the observer of bandwidth `w` does not know
/// ([`kort_thruster::plant::Plant::with_observer`]).
const CARRIED: f64 = 1.4;

/// Bandwidth for a recording, rad/s: torque that is not known carries the shaft no further off its course than its
/// full-scale speed; 0 where it returns by itself.
pub(super) fn bandwidth_rad_s(series: &Series, rig: &Rig, prepared: &Prepared) -> f64 {
    if returns(series, rig, prepared.driving) {
        return 0.0;
    }
    let needed = CARRIED * UNKNOWN_TORQUE * acceleration_rad_s2(rig, prepared) / full_speed_rad_s(prepared);
    if needed.is_finite() { needed.max(OBSERVER_RAD_S) } else { OBSERVER_RAD_S }
}

/// What drives would accelerate the stated shaft by, root mean square; 0 where no torque follows from it.
fn acceleration_rad_s2(rig: &Rig, prepared: &Prepared) -> f64 {
    let motor = &rig.motor;
    let kt = motor.torque_constant_nm_a.value;
    let torque_per_command = match (prepared.driving, rig.amplifier.kind) {
        (Driving::Command(_), AmplifierKind::Voltage) => {
            motor.winding_resistance_ohm.map_or(0.0, |ohm| kt / ohm.value)
        }
        (Driving::Command(_) | Driving::Current, _) => kt,
        (Driving::Speed | Driving::Power, _) => 0.0,
    };
    let (sum, n) = prepared
        .command
        .iter()
        .filter(|c| c.is_finite())
        .fold((0.0, 0.0), |(sum, n), command| (sum + command * command, n + 1.0));
    let inertia_kg_m2 = motor.inertia_kg_m2.value + load_inertia_kg_m2(rig);
    torque_per_command * (sum / f64::max(n, 1.0)).sqrt() / inertia_kg_m2
}

/// Full scale of the recorded speed, or of the rate of the recorded angle.
fn full_speed_rad_s(prepared: &Prepared) -> f64 {
    let turns = |response| matches!(response, Response::ShaftSpeed | Response::ShaftAngle);
    prepared.channels.iter().filter(|c| turns(c.response)).map(|c| c.full_scale).fold(0.0, f64::max)
}

/// Whether a disturbed shaft returns to its course by itself: blades brake it, or the back-EMF under a
/// voltage does, within a few tenths of a second; a pendulum hangs. A dry shaft under a current integrates, and
/// drifts; a pendulum that passes its top falls on either side.
fn returns(series: &Series, rig: &Rig, driving: Driving) -> bool {
    let commanded = matches!(driving, Driving::Command(_));
    if driving == Driving::Speed || commanded && rig.amplifier.kind == AmplifierKind::Speed {
        return true;
    }
    if let Load::Pendulum { .. } = rig.load {
        let angle = series.column("shaft_angle_rad");
        return angle.is_some_and(|q| q.iter().all(|q| q.is_nan() || q.abs() < TOP_RAD));
    }
    if rig.propeller.is_some() {
        return true;
    }
    let (motor, voltage) = (&rig.motor, rig.amplifier.kind == AmplifierKind::Voltage);
    let braking = match (motor.winding_resistance_ohm, driving) {
        (Some(ohm), Driving::Command(_)) if voltage => motor.torque_constant_nm_a.value.powi(2) / ohm.value,
        _ => 0.0,
    };
    braking / (motor.inertia_kg_m2.value + load_inertia_kg_m2(rig)) > OBSERVER_RAD_S
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use super::OBSERVER_RAD_S;
    use crate::data::{Prepared, Series};

    /// Bandwidth for a log of two seconds of a free motor of 1e-5 kg m2 and 0.02 N m/A: a current of 0.5 A and a speed, both
    /// sines.
    fn bandwidth(speed_rad_s: f64) -> f64 {
        let rig =
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 1e-5\ntorque_constant_nm_a = 0.02\n";
        let sine = |size: f64| (0..2000).map(|k| size * (0.02 * f64::from(k)).sin()).collect();
        let log = Series {
            name: "log".into(),
            time_s: (0..2000).map(|k| 0.001 * f64::from(k)).collect(),
            columns: vec![
                ("current_cmd_a".into(), sine(0.5)),
                ("shaft_speed_rad_s".into(), sine(speed_rad_s)),
            ],
        };
        Prepared::new(&log, &Rig::from_toml(rig).unwrap(), false).unwrap().observer_rad_s
    }

    #[test]
    fn a_shaft_held_by_a_stiff_loop_is_pulled_faster_than_one_that_turns_freely() {
        assert_eq!(
            bandwidth(500.0),
            OBSERVER_RAD_S,
            "a second of its torque brings it no further than it was"
        );
        // 0.354 A give 707 rad/s2; 0.3 of it carries an observer of 30 rad/s off by 10 rad/s.
        assert!((bandwidth(10.0) - 30.0).abs() < 1.0, "{}", bandwidth(10.0));
    }
}
