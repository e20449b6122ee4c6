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
    let unknown_rad_s2 = UNKNOWN_TORQUE * acceleration_rad_s2(rig, prepared);
    if returns(series, rig, prepared, unknown_rad_s2) {
        return 0.0;
    }
    let needed = CARRIED * unknown_rad_s2 / full_speed_rad_s(prepared);
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
    torque_per_command * (sum / f64::max(n, 1.0)).sqrt() / inertia_kg_m2(rig)
}

fn inertia_kg_m2(rig: &Rig) -> f64 {
    rig.motor.inertia_kg_m2.value + load_inertia_kg_m2(rig)
}

/// What the stated friction and load take at a speed, N m.
fn braking_n_m(rig: &Rig, speed_rad_s: f64) -> f64 {
    let fan_nm_s2 = match &rig.load {
        Load::Fan { fan_coefficient_nm_s2 } => fan_coefficient_nm_s2.value,
        _ => 0.0,
    };
    let viscous_nm_s = rig.motor.viscous_friction_nm_s.map_or(0.0, |friction| friction.value);
    (viscous_nm_s + fan_nm_s2 * speed_rad_s) * speed_rad_s
}

/// Full scale of the recorded speed, or of the rate of the recorded angle.
fn full_speed_rad_s(prepared: &Prepared) -> f64 {
    let turns = |response| matches!(response, Response::ShaftSpeed | Response::ShaftAngle);
    prepared.channels.iter().filter(|c| turns(c.response)).map(|c| c.full_scale).fold(0.0, f64::max)
}

/// Whether a disturbed shaft returns to its course by itself: blades brake it, or the back-EMF under a
/// voltage does, within a few tenths of a second; a pendulum hangs; stated friction or a fan takes up what may be unknown
/// before it carries the shaft off by its full-scale speed. A dry shaft under a current integrates else, and
/// drifts; a pendulum that passes its top falls on either side.
fn returns(series: &Series, rig: &Rig, prepared: &Prepared, unknown_rad_s2: f64) -> bool {
    let driving = prepared.driving;
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
    let braked_rad_s2 = braking_n_m(rig, full_speed_rad_s(prepared)) / inertia_kg_m2(rig);
    braking / inertia_kg_m2(rig) > OBSERVER_RAD_S || 0.0 < unknown_rad_s2 && unknown_rad_s2 < braked_rad_s2
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use super::OBSERVER_RAD_S;
    use crate::data::{Prepared, Series};

    /// Bandwidth for a log of two seconds of a motor of 1e-5 kg m2 and 0.02 N m/A, with what else its rig states: a current of
    /// 0.5 A and a speed, both sines.
    fn bandwidth(speed_rad_s: f64, more: &str) -> f64 {
        let motor =
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 1e-5\ntorque_constant_nm_a = 0.02\n";
        let rig = &format!("{motor}{more}");
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
            bandwidth(500.0, ""),
            OBSERVER_RAD_S,
            "a second of its torque brings it no further than it was"
        );
        // 0.354 A give 707 rad/s2; 0.3 of it carries an observer of 30 rad/s off by 10 rad/s.
        assert!((bandwidth(10.0, "") - 30.0).abs() < 1.0, "{}", bandwidth(10.0, ""));
    }

    #[test]
    fn a_shaft_whose_stated_friction_or_fan_takes_up_what_may_be_unknown_runs_freely() {
        // 0.3 of 0.354 A are 2.1e-3 N m.
        let viscous = |nm_s: f64| format!("viscous_friction_nm_s = {nm_s}\n");
        assert_eq!(bandwidth(500.0, &viscous(5e-6)), 0.0);
        assert_eq!(bandwidth(500.0, &viscous(3e-6)), OBSERVER_RAD_S);
        let fan = "[load]\nkind = \"fan\"\nfan_coefficient_nm_s2 = 1e-8\n";
        assert_eq!(bandwidth(500.0, fan), 0.0);
        assert!(bandwidth(10.0, fan) > OBSERVER_RAD_S, "a stiff loop hardly turns it");
        let weight = "[load]\nkind = \"pendulum\"\nmass_kg = 0.01\nlength_m = 0.01\n";
        assert_eq!(bandwidth(500.0, &(viscous(5e-6) + weight)), OBSERVER_RAD_S, "it may fall on either side");
    }
}
