//! The observer keeps the shaft with the recording; the angle is a response on any rig.

use kort_thruster::plant::{Sensed, Tick};
use kort_thruster::rig::Rig;

use crate::{dry, dry_filtered, plant};

const TICK_S: f64 = 0.002;

/// Under a bias of the torque that the recording does not have, with what is observed of it.
fn biased(bandwidth_rad_s: f64, observe: impl Fn(&Sensed, &mut Tick)) -> (f64, f64) {
    let rig = dry();
    let mut recorded = plant(&rig, &[], TICK_S);
    let mut ours = plant(&rig, &[], TICK_S).with_observer(bandwidth_rad_s);
    let mut worst = (0.0_f64, 0.0_f64);
    for k in 0..5000 {
        let time_s = k as f64 * TICK_S;
        let command = (3.0 * time_s).sin();
        recorded.step(&Tick { time_s, command, ..Tick::default() });
        let mut tick = Tick { time_s, command: command + 0.05, ..Tick::default() };
        observe(&recorded.sensed(), &mut tick);
        ours.step(&tick);
        let (a, b) = (recorded.sensed(), ours.sensed());
        worst.0 = worst.0.max((a.shaft_angle_rad - b.shaft_angle_rad).abs());
        worst.1 = worst.1.max((a.shaft_speed_rad_s - b.shaft_speed_rad_s).abs());
    }
    worst
}

#[test]
fn a_free_run_drifts_and_an_observed_one_stays() {
    let (angle, speed) = biased(0.0, |_, _| {});
    assert!(angle > 200.0 && speed > 40.0, "{angle} {speed}");
    // Steady: w^2 e = b/I with b/I = 5 rad/s^2.
    let (angle, _) = biased(6.3, |s, tick| tick.observed_angle_rad = Some(s.shaft_angle_rad));
    assert!(angle < 1.3 * 5.0 / 6.3_f64.powi(2), "{angle}");
    let (_, speed) = biased(6.3, |s, tick| tick.observed_speed_rad_s = Some(s.shaft_speed_rad_s));
    assert!(speed < 1.1 * 5.0 / 6.3, "{speed}");
}

#[test]
fn what_is_shown_is_the_prediction_before_the_pull() {
    let rig = dry();
    let (mut free, mut pulled) = (plant(&rig, &[], TICK_S), plant(&rig, &[], TICK_S).with_observer(6.3));
    for k in 0..3 {
        let tick = Tick { command: 1.0, observed_angle_rad: Some(10.0), ..Tick::default() };
        free.step(&tick);
        pulled.step(&tick);
        let same = free.sensed() == pulled.sensed();
        assert_eq!(same, k == 0, "the first pull shows a tick later");
    }
}

#[test]
fn an_angle_pulled_is_no_speed_of_the_encoder() {
    let rig = Rig::from_toml(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 1e5\ntorque_constant_nm_a = 1.0\n\
         [sensors]\nencoder_counts_per_rev = 4096\nspeed_filter_time_constant_s = 0.01\n",
    )
    .unwrap();
    let mut plant = plant(&rig, &[], TICK_S).with_observer(1e-3);
    plant.start(0.0, 0.0, 0.0, 0.0, 0.0);
    for _ in 0..10 {
        plant.step(&Tick { observed_angle_rad: Some(1e3), ..Tick::default() });
        // 2.8e-3 rad a tick of pull would read as 1.4 rad/s; the true speed is what the pull made.
        assert!((plant.sensed().shaft_speed_rad_s - plant.truth().shaft_speed_rad_s).abs() < 0.05);
    }
    assert!(plant.sensed().shaft_angle_rad > 0.01);
}

#[test]
fn the_angle_is_a_response_of_a_dry_shaft_from_its_start() {
    let mut plant = plant(&dry(), &[], TICK_S);
    plant.start(0.0, 2.0, 0.0, 1.0, 0.7);
    assert_eq!(plant.sensed().shaft_angle_rad, 0.7);
    for k in 0..500 {
        plant.step(&Tick { time_s: k as f64 * TICK_S, command: 1.0, ..Tick::default() });
        let t = (k + 1) as f64 * TICK_S;
        // 1 N m on 0.01 kg m^2; the recorded angle, where there is one, does not replace it.
        let wanted = 0.7 + 2.0 * t + 50.0 * t * t;
        assert!((plant.sensed().shaft_angle_rad - wanted).abs() < 1e-9, "{k}");
    }
}

/// What an effect makes the sensors show says where the shaft is, not that it is elsewhere: under the physics that made
/// the recording nothing is pulled.
#[test]
fn a_recording_of_the_same_effect_pulls_nothing() {
    let rig = dry_filtered();
    let late: (&str, &[f64]) = ("clock_skew", &[0.0, 0.02, 0.0, 0.0, 0.0]);
    let soft: (&str, &[f64]) = ("flexible_coupling", &[2.0, 0.5, 0.1, 0.0]);
    let loose: (&str, &[f64]) = ("gear_backlash", &[0.5, 0.4, 60.0, 0.5, 0.0]);
    for effect in [late, soft, loose] {
        for by_angle in [true, false] {
            let mut recorded = plant(&rig, &[effect], TICK_S);
            let mut ours = plant(&rig, &[effect], TICK_S).with_observer(6.3);
            for k in 0..2000 {
                let time_s = k as f64 * TICK_S;
                let mut tick = Tick { time_s, command: (9.0 * time_s).sin(), ..Tick::default() };
                recorded.step(&tick);
                let seen = recorded.sensed();
                if by_angle {
                    tick.observed_angle_rad = Some(seen.shaft_angle_rad);
                } else {
                    tick.observed_speed_rad_s = Some(seen.shaft_speed_rad_s);
                }
                ours.step(&tick);
                let off = (ours.truth().shaft_angle_rad - recorded.truth().shaft_angle_rad).abs();
                assert!(off < 1e-9, "{} {by_angle} {k}: {off}", effect.0);
            }
        }
    }
}
