//! What single effects do, against what their equations say.

use kort_thruster::effects::{Descriptor, Scale, find};
use kort_thruster::plant::Tick;
use kort_thruster::rig::Rig;

use crate::{dry, dry_filtered, plant};

const TICK_S: f64 = 0.002;
const INERTIA: f64 = 0.01;

fn hold(command: f64, released: bool) -> Tick {
    Tick { command, released, ..Tick::default() }
}

#[test]
fn a_gear_rubs_by_what_it_carries() {
    let mut plant = plant(&dry(), &[("gear_load_friction", &[0.3, 1.0])], TICK_S);
    (0..100).for_each(|_| plant.step(&hold(1.0, false)));
    let speed = plant.truth().shaft_speed_rad_s;
    assert!((speed - 0.7 / INERTIA * 0.2).abs() < 1e-9, "{speed}");
    // Nothing is carried, nothing rubs.
    (0..100).for_each(|_| plant.step(&hold(1.0, true)));
    assert_eq!(plant.truth().shaft_speed_rad_s, speed);
    // Against the turning the friction helps to stop.
    (0..10).for_each(|_| plant.step(&hold(-1.0, false)));
    let slowed = speed - plant.truth().shaft_speed_rad_s;
    assert!((slowed - 1.3 / INERTIA * 0.02).abs() < 1e-9, "{slowed}");
}

#[test]
fn friction_by_direction_holds_and_slows_by_its_side() {
    let values = [0.2, 0.5, 0.0, 0.01];
    for (from, dry_n_m, viscous) in [(10.0, 0.2, 0.0), (-10.0, 0.5, 0.01)] {
        let mut plant = plant(&dry(), &[("direction_dependent_friction", &values)], TICK_S);
        plant.start(0.0, from, 0.0, 0.0, 0.0);
        (0..50).for_each(|_| plant.step(&hold(0.0, false)));
        // I w' = -tc - kf w over a tenth of a second.
        let rate = viscous / INERTIA;
        let wanted = if rate == 0.0 {
            10.0 - dry_n_m / INERTIA * 0.1
        } else {
            (10.0 + dry_n_m / viscous) * (-rate * 0.1_f64).exp() - dry_n_m / viscous
        };
        assert!((plant.truth().shaft_speed_rad_s.abs() - wanted).abs() < 1e-6, "{from}");
    }
    let mut plant = plant(&dry(), &[("direction_dependent_friction", &values)], TICK_S);
    (0..50).for_each(|_| plant.step(&hold(-0.4, false)));
    assert_eq!(plant.truth().shaft_speed_rad_s, 0.0);
    (0..50).for_each(|_| plant.step(&hold(0.4, false)));
    assert!(plant.truth().shaft_speed_rad_s > 1.0);
}

#[test]
fn friction_by_angle_follows_the_recorded_angle() {
    // Twice the friction at a quarter turn, none at three quarters.
    let values = [0.2, 1.0, 0.0, 0.0, 0.0];
    for (angle, friction) in [(0.0, 0.2), (0.5, 0.4), (1.5, 0.0)] {
        let mut plant = plant(&dry(), &[("position_dependent_friction", &values)], TICK_S);
        plant.start(0.0, 10.0, 0.0, 0.0, 0.0);
        let angle = angle * std::f64::consts::PI;
        plant.step(&Tick { shaft_angle_rad: Some((angle, angle)), ..Tick::default() });
        let wanted = 10.0 - friction / INERTIA * TICK_S;
        assert!((plant.truth().shaft_speed_rad_s - wanted).abs() < 1e-9);
    }
}

#[test]
fn cold_friction_fades_while_the_shaft_turns() {
    let mut plant = plant(&dry(), &[("friction_warm_up", &[0.4, 0.0, 2.0])], TICK_S);
    let mut gain = |ticks: usize, torque: f64| {
        let before = plant.truth().shaft_speed_rad_s;
        (0..ticks).for_each(|_| plant.step(&hold(torque, false)));
        (plant.truth().shaft_speed_rad_s - before) / (ticks as f64 * TICK_S)
    };
    assert!((gain(10, 0.5) - 0.1 / INERTIA).abs() < 0.2, "cold");
    gain(5000, 0.5);
    assert!((gain(10, 0.5) - 0.5 / INERTIA).abs() < 0.5, "warm");
}

/// Speeds of two inertias on a spring, motor and load, integrated finely.
fn two_masses(
    share: f64,
    stiffness: f64,
    damping: f64,
    torque: impl Fn(f64) -> f64,
    end_s: f64,
) -> Vec<[f64; 2]> {
    let fine_s = 1e-6;
    let steps = (TICK_S / fine_s).round() as usize;
    let (i1, i2) = ((1.0 - share) * INERTIA, share * INERTIA);
    let (mut twist, mut w1, mut w2) = (0.0, 0.0, 0.0);
    (0..(end_s / TICK_S).round() as usize)
        .map(|k| {
            for _ in 0..steps {
                let passed = stiffness * twist + damping * (w1 - w2);
                w1 += fine_s / i1 * (torque(k as f64 * TICK_S) - passed);
                w2 += fine_s / i2 * passed;
                twist += fine_s * (w1 - w2);
            }
            [w1, w2]
        })
        .collect()
}

#[test]
fn a_flexible_coupling_is_two_inertias_on_a_spring() {
    let (share, hz, ratio) = (0.4, 5.0, 0.1);
    let reduced = share * (1.0 - share) * INERTIA;
    let wn = std::f64::consts::TAU * hz;
    let (stiffness, damping) = (reduced * wn * wn, 2.0 * ratio * wn * reduced);
    let torque = |t: f64| if t < 0.5 { 0.2 } else { -0.1 };
    let wanted = two_masses(share, stiffness, damping, torque, 1.0);
    // An encoder on the motor, then on the load.
    for side in [0, 1] {
        let values = [1.0 / stiffness, share, ratio, side as f64];
        let mut plant = plant(&dry(), &[("flexible_coupling", &values)], TICK_S);
        for (k, wanted) in wanted.iter().enumerate() {
            plant.step(&Tick { command: torque(k as f64 * TICK_S), ..Tick::default() });
            let (seen, wanted) = (plant.sensed().shaft_speed_rad_s, wanted[side]);
            assert!((seen - wanted).abs() < 0.02, "{k}: {seen} {wanted}");
        }
    }
    assert!(wanted.iter().fold(0.0_f64, |m, w| m.max(w[0])) > 9.0);
    assert!(wanted.iter().any(|[motor, load]| (motor - load).abs() > 1.0), "it twists");
}

#[test]
fn a_command_curve_bends_and_keeps_the_ends() {
    let reach = |command: f64| {
        let mut plant = plant(&dry(), &[("command_curve", &[0.2, 0.1, 2.0, 0.0, 0.0, 0.0, 0.0])], TICK_S);
        plant.step(&hold(command, false));
        plant.sensed().current_a
    };
    assert_eq!((reach(2.0), reach(-2.0), reach(0.0)), (2.0, -2.0, 0.0));
    assert!((reach(1.0) - (1.0 - 0.1 - 0.075)).abs() < 1e-12 && reach(-1.0) == -reach(1.0));
}

#[test]
fn an_unsigned_sensor_shows_the_size() {
    let mut plant = plant(&dry(), &[("unsigned_speed_sensor", &[1.0])], TICK_S);
    plant.start(0.0, -3.0, 0.0, 0.0, 0.0);
    plant.step(&hold(0.0, false));
    assert_eq!((plant.sensed().shaft_speed_rad_s, plant.truth().shaft_speed_rad_s), (3.0, -3.0));
}

#[test]
fn cogging_has_several_orders_at_once() {
    let cogging: &Descriptor = find("torque_ripple_cogging").unwrap();
    let scale = Scale {
        shaft_speed_rad_s: 10.0,
        torque_n_m: 1.0,
        thrust_n: 1.0,
        flow_m_s: 1.0,
        current_a: 1.0,
        command: 1.0,
        supply_v: 0.0,
        current_limit_a: f64::INFINITY,
        winding_resistance_ohm: 0.0,
        inertia_kg_m2: INERTIA,
        tick_s: TICK_S,
        duration_s: 10.0,
        clock_s: [0.0, 10.0],
        angle_known: true,
        turned_rad: f64::INFINITY,
        angle_rad: [0.0; 2],
        reverses: true,
    };
    let mut values = vec![0.0; (cogging.parameters)(&scale).len()];
    let lines = [(72.0, 0.05, 0.03), (18.0, -0.02, 0.0), (12.0, 0.0, 0.01), (144.0, 0.004, 0.0)];
    for (place, (order, sin, cos)) in lines.iter().enumerate() {
        values[5 * place..5 * place + 3].copy_from_slice(&[*order, *sin, *cos]);
    }
    for angle in [0.1, 1.0, 2.7] {
        let mut plant = plant(&dry(), &[("torque_ripple_cogging", &values)], TICK_S);
        plant.step(&Tick { shaft_angle_rad: Some((angle, angle)), ..Tick::default() });
        let torque: f64 =
            lines.iter().map(|(k, sin, cos)| sin * (k * angle).sin() + cos * (k * angle).cos()).sum();
        assert!((plant.truth().shaft_speed_rad_s - torque / INERTIA * TICK_S).abs() < 1e-12);
    }
}

#[test]
fn a_voltage_drive_stops_at_its_supply() {
    let rig = Rig::from_toml(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
         winding_resistance_ohm = 5.0\nviscous_friction_nm_s = 0.01\n[amplifier]\nkind = \"voltage\"\nsupply_v = 10\n",
    )
    .unwrap();
    let top = |effects: &[(&str, &[f64])], supply_v: Option<f64>| {
        let mut plant = plant(&rig, effects, TICK_S);
        (0..1000).for_each(|_| plant.step(&Tick { command: 14.0, supply_v, ..Tick::default() }));
        plant.truth().shaft_speed_rad_s
    };
    let (free, limited) = (top(&[], None), top(&[("voltage_limit_backemf", &[0.0, 1.0, 0.0])], None));
    assert!((limited / free - 10.0 / 14.0).abs() < 1e-3, "{limited} {free}");
    let recorded = top(&[("voltage_limit_backemf", &[0.0, 1.0, 0.0])], Some(7.0));
    assert!((recorded / free - 0.5).abs() < 1e-3, "{recorded}");
    // A supply that the rig states is what there is, whatever is taken for one that is not stated.
    let taken = top(&[("voltage_limit_backemf", &[0.0, 1.0, 3.0])], None);
    assert_eq!(taken, limited);
    let sagging = top(&[("supply_sag", &[4.0, 0.0, 1.0])], None);
    assert!(sagging < 0.999 * free && sagging > 0.8 * free, "{sagging} {free}");
}

/// A current drive whose rig states neither supply nor limit ends at what is taken for them, and at nothing where nothing is.
#[test]
fn limits_that_a_rig_does_not_state_are_where_they_are_taken() {
    let rig = Rig::from_toml(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
         winding_resistance_ohm = 2.0\nviscous_friction_nm_s = 0.1\n[amplifier]\nkind = \"current\"\n",
    )
    .unwrap();
    let top = |effect: (&str, &[f64])| {
        let mut plant = plant(&rig, &[effect], TICK_S);
        (0..2000).for_each(|_| plant.step(&Tick { command: 5.0, ..Tick::default() }));
        plant.truth().shaft_speed_rad_s
    };
    // 5 A against 0.1 N m s: 50 rad/s, where it would take 60 V.
    for free in [top(("voltage_limit_backemf", &[0.1, 1.0, 0.0])), top(("current_saturation", &[0.1, 0.0]))] {
        assert!((free - 50.0).abs() < 0.1, "{free}");
    }
    let limited = top(("voltage_limit_backemf", &[0.5, 1.0, 60.0]));
    assert!((limited - 25.0).abs() < 0.1, "{limited}");
    let cut = top(("current_saturation", &[0.2, 5.0]));
    assert!((cut - 40.0).abs() < 0.1, "{cut}");
}

/// A speed is differenced from the encoder's angle and filtered, whatever moves the encoder.
#[test]
fn a_motor_that_moves_against_its_load_is_seen_through_the_speed_filter() {
    let rig = dry_filtered();
    let soft: (&str, &[f64]) = ("flexible_coupling", &[2.0, 0.5, 0.1, 0.0]);
    let loose: (&str, &[f64]) = ("gear_backlash", &[0.5, 0.4, 60.0, 0.5, 0.0]);
    for effect in [soft, loose] {
        let mut plant = plant(&rig, &[effect], TICK_S);
        let (mut filtered, mut last, mut apart) = (0.0, 0.0, 0.0_f64);
        for k in 0..2000 {
            let time_s = k as f64 * TICK_S;
            plant.step(&Tick { time_s, command: (9.0 * time_s).sin(), ..Tick::default() });
            let seen = plant.sensed();
            let raw = (seen.shaft_angle_rad - last) / TICK_S;
            last = seen.shaft_angle_rad;
            filtered = raw + (filtered - raw) * (-TICK_S / 0.02_f64).exp();
            assert!((seen.shaft_speed_rad_s - filtered).abs() < 1e-9, "{} {k}", effect.0);
            apart = apart.max((seen.shaft_speed_rad_s - plant.truth().shaft_speed_rad_s).abs());
        }
        assert!(apart > 0.5, "{} moves the encoder: {apart}", effect.0);
    }
}
