//! One suite over every law and every thruster.

mod common;

use common::{Loop, rigs};
use kort_control::{ControllerConfig, LawKind, Reference};
use kort_thruster::rig::AmplifierKind;

/// Settled thrust follows the reference in still water, at rest and at both signs, and does not
/// hunt: the last half second stays within a narrow band.
#[test]
fn stable_over_the_envelope() {
    for rig in rigs() {
        for law in LawKind::ALL {
            for rate in [200.0, 500.0, 1000.0] {
                let mut l = Loop::new(&rig, &ControllerConfig::with_law(law), 1.0 / rate);
                let most = l.controller.model().thrust_max_n;
                // The plant's water does not swirl: a law that believes in a wake is off by what it believes.
                let off = if law == LawKind::RotationalFlowInversion { 0.1 } else { 0.05 };
                for share in [0.05_f64, 0.4, 0.9, -0.6, 0.0, -0.02, 0.1] {
                    // By similarity the plant settles in shaft angle: low thrust takes longer.
                    let slow = l.controller.model().poles_per_rad().0
                        * l.controller.model().map.speed_rad_s(share.abs().max(0.02) * most);
                    l.run(Reference::Thrust(share * most), 1.0 + 8.0 / slow);
                    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
                    for _ in 0..(0.5 * rate) as usize {
                        let out = l.tick(Reference::Thrust(share * most));
                        let model = l.controller.model();
                        assert!(out.command.current_a.abs() <= model.current_limit_a);
                        low = low.min(l.thrust());
                        high = high.max(l.thrust());
                    }
                    let mean = 0.5 * (low + high) - share * most;
                    let who = format!(
                        "{} {} {rate} Hz at {share}: {low} .. {high} of {most}",
                        rig.name,
                        law.name()
                    );
                    assert!(high - low < 0.06 * most, "hunts: {who}");
                    if rig.amplifier.kind != AmplifierKind::Speed {
                        assert!(mean.abs() < off * most, "off: {who}");
                    }
                }
            }
        }
    }
}

#[test]
fn zero_in_gives_zero_out() {
    for rig in rigs() {
        for law in LawKind::ALL {
            let mut l = Loop::new(&rig, &ControllerConfig::with_law(law), 0.002);
            for reference in [Reference::Off, Reference::Thrust(0.0), Reference::Speed(0.0)] {
                for _ in 0..200 {
                    let out = l.tick(reference);
                    assert_eq!(out.command.current_a, 0.0, "{} {}", rig.name, law.name());
                    assert_eq!(out.command.voltage_v.unwrap_or(0.0), 0.0);
                    assert_eq!(out.command.speed_rad_s.unwrap_or(0.0), 0.0);
                }
            }
        }
    }
}

/// At a switch the command moves by no more than the rate limit, and the first tick by nothing
/// but what the fade lets go.
#[test]
fn every_switch_is_bumpless() {
    for rig in rigs() {
        for from in LawKind::ALL {
            for to in LawKind::ALL {
                let mut l = Loop::new(&rig, &ControllerConfig::with_law(from), 0.002);
                let thrust = Reference::Thrust(0.3 * l.controller.model().thrust_max_n);
                let before = l.run(thrust, 1.0);
                let mut quiet = 0.0_f64;
                let mut last = before.command.current_a;
                for _ in 0..100 {
                    let now = l.tick(thrust).command.current_a;
                    quiet = quiet.max((now - last).abs());
                    last = now;
                }
                l.controller.configure(&ControllerConfig::with_law(to));
                let after = l.tick(thrust).command.current_a;
                let most = l.controller.model().current_limit_a;
                assert!(
                    (after - last).abs() <= quiet + 0.02 * most,
                    "{} {} to {}: {last} to {after}",
                    rig.name,
                    from.name(),
                    to.name()
                );
            }
        }
    }
}

/// Thrust that has come to rest stays where it is through a switch, not only at its first tick.
#[test]
fn no_switch_lets_go_of_a_steady_thrust() {
    for rig in rigs() {
        let (servo, trimmed) = (LawKind::VelocityServo, LawKind::TrimmedModel2Inversion);
        let pairs = LawKind::ALL.into_iter().flat_map(|law| [(servo, law), (law, trimmed)]);
        for (from, to) in pairs {
            let mut l = Loop::new(&rig, &ControllerConfig::with_law(from), 0.004);
            let most = l.controller.model().thrust_max_n;
            let thrust = Reference::Thrust(0.45 * most);
            l.run(thrust, 4.0);
            let before = l.thrust();
            l.controller.configure(&ControllerConfig::with_law(to));
            let mut off = 0.0_f64;
            for _ in 0..150 {
                l.tick(thrust);
                off = off.max((l.thrust() - before).abs());
            }
            let who = format!("{} {} to {}", rig.name, from.name(), to.name());
            assert!(off < 0.015 * most, "{who}: {off} of {most} off");
        }
    }
}

#[test]
fn a_speed_reference_is_followed_under_every_law() {
    for rig in rigs() {
        for law in LawKind::ALL {
            let mut l = Loop::new(&rig, &ControllerConfig::with_law(law), 0.002);
            let target = 0.5 * l.controller.model().speed_max_rad_s;
            l.run(Reference::Speed(target), 3.0);
            let speed = l.plant.truth().shaft_speed_rad_s;
            assert!((speed / target - 1.0).abs() < 0.05, "{} {} {speed} {target}", rig.name, law.name());
        }
    }
}

/// What the model does not know is taken out by the laws that measure it.
#[test]
fn ambient_flow_is_rejected_by_the_laws_that_can() {
    let rig = &rigs()[0];
    let error = |law: LawKind, force_sensor: bool| {
        let mut l = Loop::new(rig, &ControllerConfig::with_law(law), 0.002);
        (l.ambient_m_s, l.force_sensor) = (0.3, force_sensor);
        l.run(Reference::Thrust(30.0), 12.0);
        (l.thrust() - 30.0).abs()
    };
    let plain = error(LawKind::VelocityServo, true);
    assert!(plain > 3.0, "{plain}");
    for law in [
        LawKind::Model2Inversion,
        LawKind::Model3Inversion,
        LawKind::TrimmedModel2Inversion,
        LawKind::ThrustPi,
        LawKind::LookAhead,
    ] {
        let e = error(law, true);
        assert!(e < 0.3 * plain, "{} {e} of {plain}", law.name());
    }
    let e = error(LawKind::Model2Inversion, false);
    assert!(e < 0.6 * plain, "without force sensor {e} of {plain}");
}

/// A force sensor stands still for a quarter of a second, as the controller takes it, and is then gone,
/// just as the reference steps: what the law learnt of the dead reading does not stay.
#[test]
fn a_force_sensor_that_dies_in_a_step_leaves_no_trim() {
    let rig = &rigs()[0];
    for law in [LawKind::TrimmedModel2Inversion, LawKind::ThrustPi] {
        let mut l = Loop::new(rig, &ControllerConfig { law, ..ControllerConfig::default() }, 0.001);
        l.run(Reference::Thrust(90.0), 3.0);
        l.stuck_n = Some(l.thrust());
        l.run(Reference::Thrust(-50.0), 0.25);
        l.force_sensor = false;
        l.run(Reference::Thrust(-50.0), 0.25);
        let soon = (l.thrust() + 50.0).abs();
        l.run(Reference::Thrust(-50.0), 4.0);
        let later = (l.thrust() + 50.0).abs();
        assert!(later < 3.0, "{}: {soon} N, then {later} N off", law.name());
        if law == LawKind::TrimmedModel2Inversion {
            assert!(soon < 20.0, "{}: {soon} N off", law.name());
        }
    }
}
