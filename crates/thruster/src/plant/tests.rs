//! The step at input jumps, against the same plant stepped a hundred times finer.

use super::{Course, Driven, Plant, Tick};
use crate::models::ModelName;
use crate::parameters::{Parameter as P, Parameters};
use crate::rig::Rig;

const COARSE_S: f64 = 5e-3;
const FINER: usize = 100;
const TICKS: usize = 80;

/// Shaft speed and axial flow after each coarse tick.
fn run(lag_s: f64, split: usize, input: impl Fn(usize) -> Tick) -> Vec<[f64; 2]> {
    let rig = Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml"))
        .expect("the shipped rig");
    let mut parameters = Parameters::stated(&rig);
    parameters.set(P::TimeConstantS, lag_s);
    let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], COARSE_S / split as f64);
    let mut seen = Vec::new();
    for i in 0..TICKS {
        for j in 0..split {
            let part = 1.0 / split as f64;
            let tick = input(i);
            let at = |(a, b): (f64, f64), p: f64| a + (b - a) * p;
            let ends = |ends| (at(ends, j as f64 * part), at(ends, (j + 1) as f64 * part));
            let driven = match tick.driven {
                Driven::Current(a, b) => {
                    let (a, b) = ends((a, b));
                    Driven::Current(a, b)
                }
                other => other,
            };
            let time_s = (i as f64 + j as f64 * part) * COARSE_S;
            plant.step(&Tick { time_s, driven, ambient_m_s: ends(tick.ambient_m_s), ..tick });
        }
        seen.push([plant.truth().shaft_speed_rad_s, plant.truth().axial_m_s]);
    }
    seen
}

/// Largest difference from the finely stepped plant.
fn error(lag_s: f64, input: impl Fn(usize) -> Tick + Copy) -> f64 {
    run(lag_s, 1, input)
        .iter()
        .zip(run(lag_s, FINER, input))
        .flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]])
        .fold(0.0, |worst, e| worst.max(e.abs()))
}

/// A level that jumps every eighth tick.
fn level(i: usize) -> f64 {
    [6.0, -4.0, 2.0, 9.0, -9.0][(i / 8) % 5]
}

#[test]
fn a_jump_of_the_command_without_drive_lag_costs_no_accuracy() {
    let e = error(0.0, |i| Tick { command: level(i), ..Tick::default() });
    assert!(e < 5e-3, "{e}");
}

#[test]
fn a_jump_of_a_recorded_current_costs_no_accuracy() {
    let e = error(0.0, |i| Tick { driven: Driven::Current(level(i), level(i) + 0.2), ..Tick::default() });
    assert!(e < 5e-3, "{e}");
}

#[test]
fn a_jump_of_the_ambient_flow_costs_no_accuracy() {
    let e = error(0.01, |i| Tick {
        command: 6.0,
        ambient_m_s: (0.1 * level(i), 0.1 * level(i)),
        ..Tick::default()
    });
    assert!(e < 5e-3, "{e}");
}

/// Where nothing moves fast the cheaper steps do as well; at a jump they would not.
#[test]
fn a_smooth_tick_costs_no_accuracy() {
    let slow = |i: usize| 6.0 + 0.5 * (0.1 * i as f64).sin();
    let driven = |i: usize| Driven::Current(slow(i), slow(i + 1));
    let plain = error(0.0, |i| Tick { command: level(i), ..Tick::default() });
    for course in [Course::Smooth, Course::Calm] {
        let late = |i: usize| if i > 40 { course } else { Course::Any };
        let cheap = error(0.0, |i| Tick { driven: driven(i), course: late(i), ..Tick::default() });
        assert!(cheap < 2e-3, "{course:?}: {cheap} rad/s");
        let wrong = error(0.0, |i| Tick { command: level(i), course, ..Tick::default() });
        assert!(wrong > 1.05 * plain, "{course:?}: {wrong} {plain}");
    }
}

/// A slow swing passed in strides of five ticks, and tick by tick: what the sensors show at each stride's end. With a
/// lag of the drive, and with effects that keep a memory from tick to tick.
fn in_strides(effects: &[(&crate::effects::Descriptor, &[f64])], of: usize) -> Vec<[f64; 3]> {
    const STRIDE: usize = 5;
    let rig = Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml"))
        .expect("the shipped rig");
    let parameters = Parameters::stated(&rig);
    let mut plant: Plant = Plant::new(ModelName::Model2, &rig, &parameters, effects, 2e-3);
    let ticks: Vec<Tick> = (0..10_000)
        .map(|i| Tick {
            time_s: f64::from(i) * 2e-3,
            course: if i > 1000 { Course::Calm } else { Course::Any },
            ..Tick::default()
        })
        .collect();
    let commands: Vec<f64> = (0..10_000).map(|i| 3.0 + 2.0 * (1e-3 * f64::from(i)).sin()).collect();
    let mut seen = Vec::new();
    for from in (0..ticks.len()).step_by(STRIDE) {
        for part in (from..from + STRIDE).step_by(of) {
            plant.stride(&ticks[part..part + of], Some(&commands[part..part + of]));
        }
        let s = plant.sensed();
        seen.push([s.shaft_speed_rad_s, s.thrust_n, s.current_a]);
    }
    seen
}

#[test]
fn several_smooth_ticks_at_once_lead_where_single_ones_do() {
    use crate::effects::{command_dead_band, coulomb_friction, thrust_sensor_lag};
    let friction = (&coulomb_friction::DESCRIPTOR, &[0.1, 0.2, 3.0][..]);
    let band = (&command_dead_band::DESCRIPTOR, &[0.2, 0.0, 0.0][..]);
    let lag = (&thrust_sensor_lag::DESCRIPTOR, &[0.02, 0.3][..]);
    for effects in [&[][..], &[friction], &[band, lag], &[friction, band, lag]] {
        let (one, five) = (in_strides(effects, 1), in_strides(effects, 5));
        let top = one.iter().fold([0.0_f64; 3], |top, at| [0, 1, 2].map(|k| top[k].max(at[k].abs())));
        for k in 0..3 {
            let off = one.iter().zip(&five).map(|(a, b)| (a[k] - b[k]).abs()).fold(0.0, f64::max);
            assert!(off < 2e-4 * top[k], "{k}: {off} of {}", top[k]);
            assert!(off > 0.0 || k == 2, "{k}: they were passed at once");
        }
    }
}

#[test]
fn a_disturbance_dies_at_the_rate_that_is_told() {
    let rig = Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml"))
        .expect("the shipped rig");
    let parameters = Parameters::stated(&rig);
    let settle = |by_m_s: f64| {
        let mut plant: Plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], 1e-4);
        plant.start(0.0, 20.0, 0.5 + by_m_s, 0.0, 0.0);
        let told = plant.fastest_decay_1_s(Driven::Command);
        plant.step(&Tick::default());
        (told, plant.truth().axial_m_s)
    };
    let ((told, calm), (_, disturbed)) = (settle(0.0), settle(1e-3));
    let dies = (1.0 - (disturbed - calm) / 1e-3) / 1e-4;
    assert!(told > 0.9 * dies && told < 2.0 * dies, "{told} {dies}");
}

/// A light rotor that its supply holds back: strides chosen without that limit would run away at it.
#[test]
fn a_supply_that_brakes_within_a_stride_is_not_passed_over() {
    let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 8e-5\ntorque_constant_nm_a = 0.11\n\
               viscous_friction_nm_s = 3e-4\nwinding_resistance_ohm = 0.9\n[amplifier]\nkind = \"current\"\n\
               current_limit_a = 20\nsupply_v = 10\n[sensors]\n";
    let rig = Rig::from_toml(rig).expect("a rig");
    let limit = (&crate::effects::voltage_limit_backemf::DESCRIPTOR, &[0.0, 1.0, 0.0][..]);
    let ends_at = |of: usize| {
        let mut plant: Plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[limit], 1e-3);
        let ticks: Vec<Tick> = (0..3000)
            .map(|i| Tick {
                time_s: f64::from(i) * 1e-3,
                course: if i > 500 { Course::Smooth } else { Course::Any },
                ..Tick::default()
            })
            .collect();
        // Up to the limit, and slowly on.
        let commands: Vec<f64> = (0..3000).map(|i| 0.2 + 1e-3 * f64::from(i)).collect();
        ticks.chunks(of).zip(commands.chunks(of)).for_each(|(t, c)| plant.stride(t, Some(c)));
        plant.truth().shaft_speed_rad_s
    };
    let (one, ten) = (ends_at(1), ends_at(10));
    assert!((80.0..95.0).contains(&one), "at its limit: {one}");
    assert!((ten - one).abs() < 1e-3 * one, "{ten} {one}");
}

/// A ball screw's motor on a voltage drive, with hardly any friction: the winding brakes it.
#[test]
fn a_voltage_that_stands_brakes() {
    let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 1e-4\ntorque_constant_nm_a = 0.1\n\
               winding_resistance_ohm = 1.0\n[amplifier]\nkind = \"voltage\"\n[sensors]\n";
    let rig = Rig::from_toml(rig).expect("a rig");
    let mut plant: Plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], 1e-3);
    plant.start(0.0, 5.0, 0.0, 0.0, 0.0);
    let told = plant.fastest_decay_1_s(Driven::Command);
    assert!((told / (0.1 * 0.1 / 1e-4) - 1.0).abs() < 1e-3, "{told}");
    assert!(plant.fastest_decay_1_s(Driven::Current(1.0, 1.0)) < 1e-3);
}

/// A propeller of 76 mm in air on a voltage drive: the flow through the disc settles within a tick.
#[test]
fn one_step_a_calm_tick_leads_where_many_do() {
    let rig = Rig::from_toml(include_str!("../../../../tests/recordings/measured/sar-prop-step/rig.toml"))
        .expect("the rig of a measured propeller");
    let fly = |calm: bool| {
        let parameters = Parameters::stated(&rig);
        let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], 2e-3);
        let stiff = plant.stiff.as_mut().expect("stiff in air");
        assert!(stiff.steps > 1, "{stiff:?}");
        if !calm {
            // No tick moves less than nothing.
            stiff.top_m_s = -1.0;
        }
        let top_rad_s = stiff.top_rad_s;
        let mut seen = Vec::new();
        for i in 0..4000_i32 {
            // Levels, a ramp, and rest.
            let volts = match i / 800 {
                0 => 8.0,
                1 => 2.0,
                2 => 2.0 + f64::from(i - 1600) * 0.01,
                3 => 10.0,
                _ => 0.0,
            };
            plant.step(&Tick { time_s: f64::from(i) * 2e-3, command: volts, ..Tick::default() });
            seen.push(plant.truth().shaft_speed_rad_s / top_rad_s);
        }
        seen
    };
    let (few, many) = (fly(true), fly(false));
    let off = |k: usize| (few[k] - many[k]).abs();
    let worst = (0..few.len()).map(off).fold(0.0, f64::max);
    assert!(worst < 2e-4, "{worst} of the largest speed");
    assert!(off(799) < 1e-7 && off(1599) < 1e-7, "settled: {} and {}", off(799), off(1599));
    assert!(few[700] > 0.1, "it turns: {}", few[700]);
}

#[test]
fn a_speed_drive_brings_its_shaft_no_faster_than_its_current_can() {
    let rig = |limit: &str| {
        let text = format!(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.02\ntorque_constant_nm_a = 1.0\n\
             [load]\nkind = \"fan\"\nfan_coefficient_nm_s2 = 4e-4\n[amplifier]\nkind = \"speed\"\ntime_constant_s = 0.02\n{limit}"
        );
        Rig::from_toml(&text).expect("a rig")
    };
    let speed_after = |limit: &str, seconds: f64| {
        let rig = rig(limit);
        let mut plant: Plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], 1e-3);
        for k in 0..(seconds * 1e3) as u32 {
            plant.step(&Tick { time_s: f64::from(k) * 1e-3, command: 60.0, ..Tick::default() });
            assert_eq!(plant.truth().current_a, 0.0, "its current is not modelled");
        }
        plant.truth().shaft_speed_rad_s
    };
    // 2 A through 1 N m/A on 0.02 kg m^2, against a fan that takes all of it at 70.7 rad/s: Om = 70.7 tanh(100 t/70.7).
    let most = |t: f64| 70.711 * (100.0 * t / 70.711).tanh();
    for t in [0.1, 0.4] {
        let speed = speed_after("current_limit_a = 2.0", t);
        assert!((speed / most(t) - 1.0).abs() < 0.01, "{speed} at {t} s, {}", most(t));
    }
    assert!((speed_after("current_limit_a = 2.0", 3.0) - 60.0).abs() < 0.1, "it gets there");
    assert!(
        (speed_after("", 0.1) / (60.0 * (1.0 - (-5.0_f64).exp())) - 1.0).abs() < 0.01,
        "no limit is stated"
    );
}
