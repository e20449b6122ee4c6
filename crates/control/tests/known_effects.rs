//! What a rig is known to have makes thrust better under laws that are told of it, on thrusters of several kinds.

mod common;

use common::{Loop, rigs};
use kort_control::{Controller, ControllerConfig, LawKind, ObserverKind, Output, Reference};
use kort_thruster::effects;
use kort_thruster::rig::{KnownEffect, Quantity, Rig};

const DT: f64 = 1e-3;

/// An effect with some of its values as multiples of where a fit starts.
fn known(rig: &Rig, id: &str, sizes: &[(&str, f64)]) -> KnownEffect {
    let model = kort_control::ControlModel::from_rig(rig, DT).unwrap();
    let specs = (effects::find(id).unwrap().parameters)(&model.scale(rig, 60.0));
    let size = |name: &str| sizes.iter().find(|(n, _)| *n == name).map(|(_, factor)| *factor);
    let value = |s: &effects::Spec| match size(s.name) {
        Some(factor) => factor * s.start,
        None if s.shape => s.mean,
        None => 0.0,
    };
    KnownEffect {
        effect: effects::find(id).unwrap().id,
        parameters: specs.iter().map(|s| (s.name, Quantity::exact(value(s)))).collect(),
    }
}

/// Thrust error, share of the largest, of a plant that has the effects under a controller that is told of some.
fn error(rig: &Rig, has: &[KnownEffect], told: &[KnownEffect], law: LawKind) -> f64 {
    let with = |effects: &[KnownEffect]| Rig { effects: effects.to_vec(), ..rig.clone() };
    let config = ControllerConfig::with_law(law);
    let mut l = Loop::new(&with(has), &config, DT);
    l.controller = Controller::new(&with(told), &config, DT).unwrap();
    let full = kort_control::ControlModel::from_rig(rig, DT).unwrap().thrust_max_n;
    let (mut sum, mut n) = (0.0, 0.0);
    for share in [0.5, 0.15, -0.3, -0.6, 0.05, 0.7, 0.3] {
        for k in 0..1200 {
            l.tick(Reference::Thrust(share * full));
            if k > 100 {
                sum += (l.plant.net_thrust_n() / full - share).powi(2);
                n += 1.0;
            }
        }
    }
    f64::sqrt(sum / n)
}

fn named(name: &str) -> Rig {
    rigs().into_iter().find(|r| r.name.contains(name) || r.name == name).unwrap_or_else(|| panic!("{name}"))
}

#[test]
fn a_law_that_knows_an_effect_is_better_than_one_that_does_not() {
    /// Effect, its values, law, share of the untold error that may be left.
    type Told<'a> = (&'a str, &'a [(&'a str, f64)], LawKind, f64);
    let cases: &[Told] = &[
        ("coulomb_friction", &[("coulomb_torque_n_m", 3.0)], LawKind::TorqueControl, 0.6),
        ("windage_drag", &[("windage_nm_s2", 3.0)], LawKind::TorqueControl, 0.6),
        ("torque_constant_saturation", &[("saturation_per_a2", 4.0)], LawKind::TorqueControl, 0.6),
        (
            "forward_reverse_asymmetry",
            &[("reverse_lift_error", 3.0), ("reverse_drag_error", 3.0)],
            LawKind::VelocityServo,
            0.7,
        ),
        ("duct_loss", &[("duct_thrust", 3.0)], LawKind::Model2Inversion, 0.7),
        ("thrust_deduction_interaction", &[("deduction", 5.0)], LawKind::VelocityServo, 0.6),
        (
            "thrust_bias_gain_hysteresis",
            &[("gain_error", 3.0), ("bias_n", 3.0)],
            LawKind::TrimmedModel2Inversion,
            0.7,
        ),
        ("water_density", &[("density_error", 4.0)], LawKind::VelocityServo, 0.7),
    ];
    let mut said = String::new();
    let mut worse = String::new();
    for rig in [Rig::from_toml(common::STAND).unwrap(), named("t200"), named("t500"), named("tunnel")] {
        for (id, sizes, law, most) in cases {
            let effect = [known(&rig, id, sizes)];
            let (without, with) = (error(&rig, &effect, &[], *law), error(&rig, &effect, &effect, *law));
            let line = format!("{} {id} {}: {without:.4} -> {with:.4}\n", rig.name, law.name());
            // What hardly shows cannot be taken away.
            let clean = error(&rig, &[], &[], *law);
            let excess = |e: f64| (e * e - clean * clean).max(0.0).sqrt();
            if excess(without) > 0.3 * clean.max(0.005) && excess(with) > most * excess(without) {
                worse += &format!("clean {clean:.4} {line}");
            }
            said += &line;
        }
    }
    println!("{said}");
    assert!(worse.is_empty(), "{worse}");
}

#[test]
fn a_dead_band_and_a_curve_of_the_command_are_undone_on_current_and_voltage_drives() {
    for rig in [Rig::from_toml(common::STAND).unwrap(), named("t200"), named("speed")] {
        for (id, sizes) in [
            ("command_dead_band", &[("half_width", 2.0)][..]),
            (
                "command_curve",
                &[("second_degree_share", 3.0), ("third_degree_share", 2.0), ("full_command", 1.0)],
            ),
        ] {
            let effect = [known(&rig, id, sizes)];
            let law = LawKind::StaticMap;
            let (without, with, clean) = (
                error(&rig, &effect, &[], law),
                error(&rig, &effect, &effect, law),
                error(&rig, &[], &[], law),
            );
            println!("{} {id}: {without:.4} -> {with:.4}, clean {clean:.4}", rig.name);
            assert!(
                with < 1.1 * clean + 0.2 * (without - clean).max(0.0),
                "{} {id}: {without} {with} {clean}",
                rig.name
            );
        }
    }
}

#[test]
fn a_late_drive_and_late_sensors_leave_the_loop_stable() {
    for rig in [Rig::from_toml(common::STAND).unwrap(), named("t200")] {
        for (id, sizes) in [
            ("transport_delay", &[("delay_s", 10.0)][..]),
            ("amplifier_lag", &[("extra_lag_s", 4.0)]),
            ("amplifier_lag", &[("command_lag_s", 4.0)]),
            ("thrust_sensor_lag", &[("thrust_lag_s", 3.0)]),
        ] {
            let effect = [known(&rig, id, sizes)];
            for law in [LawKind::Model2Inversion, LawKind::VelocityServo] {
                let (without, with) = (error(&rig, &effect, &[], law), error(&rig, &effect, &effect, law));
                println!("{} {id} {}: {without:.4} -> {with:.4}", rig.name, law.name());
                // A known lag or delay makes the loops more careful: where it takes nothing from thrust, that costs a little.
                assert!(with < 1.15 * without + 1e-3, "{} {id} {}: {without} {with}", rig.name, law.name());
            }
        }
    }
}

/// An observer that took a late error for prompt would swing about it: a tenth of full thrust and more.
#[test]
fn sensors_known_to_be_late_cost_the_default_law_little() {
    for name in ["t200", "t500", "duct", "tunnel"] {
        let rig = named(name);
        let law = LawKind::Model2Inversion;
        let clean = error(&rig, &[], &[], law);
        for (id, sizes) in [
            ("thrust_sensor_lag", &[("thrust_lag_s", 10.0)][..]),
            ("thrust_sensor_lag", &[("thrust_lag_s", 30.0)]),
            ("clock_skew", &[("thrust_delay_s", 10.0)]),
            ("clock_skew", &[("encoder_delay_s", 2.0)]),
            ("encoder_filter_lag", &[("filter_excess_s", 2.0)]),
        ] {
            let effect = [known(&rig, id, sizes)];
            let with = error(&rig, &effect, &effect, law);
            println!("{name} {id} {sizes:?}: {clean:.4} -> {with:.4}");
            assert!(with < clean + 5e-3, "{name} {id} {sizes:?}: {clean} {with}");
        }
    }
}

/// Steps that throw the blades' angle about, no sensor of force: the thrust that an observer believes is that of its prediction.
#[test]
fn an_observer_that_knows_of_lift_that_builds_up_predicts_its_thrust() {
    for rig in [Rig::from_toml(common::STAND).unwrap(), named("tunnel")] {
        let effect = [known(&rig, "unsteady_lift_lag", &[("wagner_share", 2.0), ("chord_radii", 3.0)])];
        for kind in ObserverKind::ALL {
            let believed_off = |has: &[KnownEffect], told: &[KnownEffect]| {
                let with = |effects: &[KnownEffect]| Rig { effects: effects.to_vec(), ..rig.clone() };
                let law = ControllerConfig::with_law(LawKind::VelocityServo);
                let config = ControllerConfig { observer: kind, ..law };
                let mut l = Loop::new(&with(has), &config, DT);
                l.controller = Controller::new(&with(told), &config, DT).unwrap();
                l.force_sensor = false;
                let full = l.controller.model().thrust_max_n;
                let mut sum = 0.0;
                for share in [0.5, 0.1, -0.4, 0.6, 0.05, -0.2, 0.7] {
                    for _ in 0..800 {
                        let believed_n = l.tick(Reference::Thrust(share * full)).estimate.thrust_n.value;
                        sum += ((believed_n - l.plant.net_thrust_n()) / full).powi(2);
                    }
                }
                f64::sqrt(sum / 5600.0)
            };
            let (without, with) = (believed_off(&effect, &[]), believed_off(&effect, &effect));
            // What an observer errs by where there is nothing to know.
            let clean = believed_off(&[], &[]);
            let line = format!("{} {}: {without:.4} -> {with:.4}, clean {clean:.4}", rig.name, kind.name());
            println!("{line}");
            assert!(with < clean + 0.05 * (without - clean), "{line}");
        }
    }
}

/// The command as the drive takes it: A, V or rad/s.
fn told(output: &Output) -> f64 {
    let command = output.command;
    command.voltage_v.or(command.speed_rad_s).unwrap_or(command.current_a)
}

/// Whatever a revision changes between law and drive, and on the way back: the first command is the last one, and none
/// after it leaps.
#[test]
fn a_rigs_revision_is_taken_over_without_a_jump() {
    let changes: [(&str, &[(&str, f64)]); 5] = [
        ("coulomb_friction", &[("coulomb_torque_n_m", 3.0)]),
        ("torque_constant_saturation", &[("saturation_per_a2", 4.0)]),
        ("command_dead_band", &[("half_width", 2.0)]),
        (
            "command_curve",
            &[("second_degree_share", 3.0), ("third_degree_share", 2.0), ("full_command", 1.0)],
        ),
        ("forward_reverse_asymmetry", &[("forward_lift_error", 3.0), ("reverse_lift_error", 3.0)]),
    ];
    for rig in [Rig::from_toml(common::STAND).unwrap(), named("t200"), named("speed")] {
        for (id, sizes) in changes {
            let revised = Rig { effects: vec![known(&rig, id, sizes)], ..rig.clone() };
            for law in [LawKind::Model2Inversion, LawKind::StaticMap] {
                let mut l = Loop::new(&rig, &ControllerConfig::with_law(law), DT);
                let full = l.controller.nominal().thrust_max_n;
                let steady = Reference::Thrust(0.35 * full);
                // The last command and the largest step on the way to it.
                let drive = |l: &mut Loop, mut last: f64, ticks: u32| {
                    let mut step = 0.0_f64;
                    for _ in 0..ticks {
                        let now = told(&l.tick(steady));
                        step = step.max((now - last).abs());
                        last = now;
                    }
                    (last, step)
                };
                let settled = told(&l.run(steady, 3.0));
                let (mut before, usual) = drive(&mut l, settled, 1500);
                for (to, way) in [(&revised, "there"), (&rig, "back")] {
                    l.controller = l.controller.revised(to, DT).unwrap();
                    let (first, at_once) = drive(&mut l, before, 1);
                    let (after, step) = drive(&mut l, first, 1500);
                    let case = format!("{} {id} {} {way}: {before} {first} {after}", rig.name, law.name());
                    assert!(at_once < 2e-3 * before.abs(), "{case}");
                    // By a fade of 0.1 s no tick of 1 ms moves much more than a hundredth of the whole change.
                    let most = 1.5 * usual + 0.02 * (after - before).abs() + 2e-3 * before.abs();
                    assert!(step < most, "{case}: a step of {step}, usual {usual}");
                    before = after;
                }
            }
        }
    }
}

/// What a dead band swallows lies within it: the command that it held back goes on from there.
#[test]
fn a_dead_band_adopted_over_a_command_within_it_is_no_step() {
    let rig = Rig::from_toml(common::STAND).unwrap();
    let band = known(&rig, "command_dead_band", &[("half_width", 4.0)]);
    let half_width = band.value("half_width");
    let mut l = Loop::new(&rig, &ControllerConfig::with_law(LawKind::StaticMap), DT);
    let before = told(&l.run(Reference::Thrust(0.01 * l.controller.nominal().thrust_max_n), 2.0));
    assert!(before > 0.0 && before < half_width, "{before} in {half_width}");
    l.controller = l.controller.revised(&Rig { effects: vec![band], ..rig }, DT).unwrap();
    let after = told(&l.tick(Reference::Thrust(0.01 * l.controller.nominal().thrust_max_n)));
    assert!((after - before).abs() < 0.02 * half_width, "{before} {after}");
}
