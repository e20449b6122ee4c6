//! The monitor of mismatch in closed loop: an effect switched on in mid-run is found on its path, and a clean run
//! gives no alarm.

mod common;

use common::watched::{DT, Watched, learnt, reference};
use kort_control::Reference;
use kort_control::mismatch::{BLOCK_S, LEARNT, Mismatch, Path};
use kort_thruster::parameters::Parameter;

/// Within which an effect of a few percent is to be found, s.
const WITHIN_S: f64 = 90.0;

/// Places of residuals.
const CURRENT: usize = 0;
const TORQUE: usize = 1;

#[test]
fn an_effect_of_a_few_percent_is_found_on_its_path() {
    let full_n_m = 9.0 * 1.25;
    /// An effect with its values, if one is switched on.
    type Switched<'a> = Option<(&'a str, &'a [(&'a str, f64)])>;
    /// Name, effect, parameters that change, and the path to be blamed.
    type Case<'a> = (&'a str, Switched<'a>, &'a [(Parameter, f64)], Path);
    let cases: [Case; 8] = [
        (
            "friction",
            Some(("coulomb_friction", &[("coulomb_torque_n_m", 0.03 * full_n_m)])),
            &[],
            Path::Shaft,
        ),
        ("windage", Some(("windage_drag", &[("windage_nm_s2", 8e-5)])), &[], Path::Shaft),
        (
            "curve",
            Some(("command_curve", &[("second_degree_share", 0.06), ("full_command", 9.0)])),
            &[],
            Path::Drive,
        ),
        ("dead band", Some(("command_dead_band", &[("half_width", 0.27)])), &[], Path::Drive),
        ("lift", None, &[(Parameter::LiftMax, 0.95)], Path::Blade),
        ("outflow", None, &[(Parameter::FluxCoefficient, 1.2)], Path::Flow),
        ("gain", Some(("thrust_bias_gain_hysteresis", &[("gain_error", 0.03)])), &[], Path::Sensor),
        ("bias", Some(("thrust_bias_gain_hysteresis", &[("bias_n", 0.03 * 175.0)])), &[], Path::Sensor),
    ];
    let found = std::thread::scope(|threads| {
        let running: Vec<_> = cases
            .iter()
            .map(|(name, effect, factors, path)| {
                threads.spawn(move || {
                    let mut watched = learnt();
                    watched.switch(effect.as_slice(), factors);
                    let began = watched.time_s;
                    let alarm = watched.run(WITHIN_S);
                    let after = watched.time_s - began;
                    let mut settled = watched.l.controller.mismatch();
                    for _ in 0..(30.0 / DT) as usize {
                        let measured = watched.l.measured();
                        watched.l.tick_with(&measured, reference(watched.time_s));
                        watched.time_s += DT;
                        settled = watched.l.controller.mismatch();
                    }
                    let measured = watched.l.measured();
                    for _ in 0..(30.0 / DT) as usize {
                        watched.l.tick_with(&measured, Reference::Off);
                    }
                    let rested_s = watched.l.controller.mismatch().since_s - settled.since_s;
                    (*name, *path, alarm, after, settled, rested_s)
                })
            })
            .collect();
        running.into_iter().map(|t| t.join().unwrap()).collect::<Vec<_>>()
    });
    for (name, path, alarm, after, settled, rested_s) in &found {
        println!("{name}: {alarm:?} after {after:.0} s, then {:?} {:?}", settled.alarm, settled.level);
        assert!(alarm.is_some(), "{name}: no alarm within {WITHIN_S} s: {settled:?}");
        assert_eq!((*alarm, settled.alarm), (Some(*path), Some(*path)), "{name}: {settled:?}");
        // The onset is known to within a few blocks.
        let onset_s = after + 30.0 - settled.since_s;
        assert!(onset_s.abs() < 10.0 * BLOCK_S, "{name}: onset off by {onset_s} s: {settled:?}");
        assert!((rested_s - 30.0).abs() < 0.1, "{name}: at rest it went on by {rested_s} s of 30");
    }
}

/// The sums learn it as usual; what the residual is lately says it.
#[test]
fn what_is_off_from_the_start_raises_no_alarm_and_is_told_all_the_same() {
    let mut watched = Watched::new();
    watched.switch(&[("coulomb_friction", &[("coulomb_torque_n_m", 0.1 * 9.0 * 1.25)])], &[]);
    assert_eq!(watched.run(2.2 * f64::from(LEARNT) * BLOCK_S), None);
    let told = watched.l.controller.mismatch();
    assert!(!told.learning && told.level.iter().all(|level| *level < 0.5), "{told:?}");
    assert!(told.lately[TORQUE].unwrap() > 0.1, "{told:?}");
    assert!(told.lately[CURRENT].unwrap().abs() < 0.05, "{told:?}");
}

#[test]
fn a_clean_run_gives_no_alarm() {
    let mut watched = learnt();
    let told = watched.l.controller.mismatch().lately;
    assert!(told.iter().flatten().count() >= 4 && told.iter().flatten().all(|x| x.abs() < 0.05), "{told:?}");
    assert_eq!(watched.run(1500.0), None, "{:?}", watched.l.controller.mismatch());
}

/// A second fault on another path is named beside the first, which alone stands at an alarm before; what is mended is
/// let go of, whatever else is off.
#[test]
fn a_second_fault_is_named_beside_the_first_and_each_is_let_go_of_by_itself() {
    let friction: (&str, &[(&str, f64)]) = ("coulomb_friction", &[("coulomb_torque_n_m", 0.03 * 9.0 * 1.25)]);
    let gain: (&str, &[(&str, f64)]) = ("thrust_bias_gain_hysteresis", &[("gain_error", 0.05)]);
    let mut watched = learnt();
    watched.switch(&[friction], &[]);
    assert_eq!(watched.run(WITHIN_S), Some(Path::Shaft));
    let off = |m: Mismatch| Path::ALL.into_iter().filter(|p| m.level[*p as usize] >= 1.0).collect::<Vec<_>>();
    assert!(
        watched
            .is(60.0, |m| m.alarm != Some(Path::Shaft) || off(m).iter().any(|p| *p != Path::Shaft))
            .is_none()
    );
    watched.switch(&[friction, gain], &[]);
    assert!(watched.is(WITHIN_S, |m| m.alarm == Some(Path::Sensor)).is_some());
    assert!(watched.is(30.0, |m| off(m) == [Path::Shaft, Path::Sensor]).is_some());
    watched.switch(&[gain], &[]);
    let shaft = watched.is(WITHIN_S, |m| m.level[Path::Shaft as usize] == 0.0);
    assert!(
        shaft.is_some() && watched.l.controller.mismatch().alarm == Some(Path::Sensor),
        "{shaft:?} {:?}",
        watched.l.controller.mismatch()
    );
    watched.switch(&[], &[]);
    let none = watched.is(WITHIN_S, |m| m.alarm.is_none());
    println!("shaft let go of after {shaft:?} s, all after {none:?} s");
    assert!(none.is_some(), "{:?}", watched.l.controller.mismatch());
}
