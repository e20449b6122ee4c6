//! Rigs whose flow, swirl or shaft settles within a tick: followed, never run away from.

use kort_thruster::dual::Dual;
use kort_thruster::effects::{Descriptor, find};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::plant::{Driven, Plant, Tick};
use kort_thruster::rig::Rig;
use proptest::prelude::*;

/// A quadrotor's motor and propeller on a stand: the flow settles in a tenth of a millisecond.
const IN_AIR: &str = r#"
[propeller]
radius_m = 0.0381
duct_length_m = 0.012
pitch_rad = 0.30
lift_max = 0.70
drag_max = 0.60
[flow]
density_kg_m3 = 1.19
flux_coefficient = 2.0
added_mass_coefficient = 1.0
[motor]
inertia_kg_m2 = 1.0e-6
torque_constant_nm_a = 0.0027
winding_resistance_ohm = 0.12
[amplifier]
kind = "voltage"
supply_v = 16.6
current_limit_a = 30
time_constant_s = 0.01
[run]
water = "air"
"#;

/// A very short duct in water.
const SHORT_DUCT: &str = r#"
[propeller]
radius_m = 0.13
duct_length_m = 0.006
pitch_rad = 0.39
lift_max = 0.542
drag_max = 1.25
[flow]
density_kg_m3 = 998
flux_coefficient = 1.86
added_mass_coefficient = 1.0
[motor]
inertia_kg_m2 = 0.01
torque_constant_nm_a = 1.23
[amplifier]
time_constant_s = 0.002
current_limit_a = 9
"#;

const TICK_S: f64 = 0.002;
const FINER: usize = 100;
const TICKS: usize = 600;
/// Levels of the command, as shares of the top, changed every 75 ticks.
const LEVELS: [f64; 8] = [0.0, 0.5, 1.0, 0.3, -0.4, -0.9, 0.1, 0.7];

/// Speed, flow and thrust at every coarse tick's end.
fn run(rig: &Rig, model: ModelName, top: f64, effects: &[(&str, &[f64])], split: usize) -> Vec<[f64; 3]> {
    let effects: Vec<(&Descriptor, &[f64])> =
        effects.iter().map(|(id, values)| (find(id).unwrap(), *values)).collect();
    let tick_s = TICK_S / split as f64;
    let mut plant = Plant::new(model, rig, &Parameters::stated(rig), &effects, tick_s);
    assert_eq!(plant.is_stiff(), split == 1);
    (0..TICKS)
        .map(|k| {
            for j in 0..split {
                let time_s = (k as f64 + j as f64 / split as f64) * TICK_S;
                plant.step(&Tick { time_s, command: top * LEVELS[k / 75 % 8], ..Tick::default() });
            }
            let at = plant.truth();
            [at.shaft_speed_rad_s, at.axial_m_s, at.thrust_n]
        })
        .collect()
}

/// Root mean square of the difference from the finely stepped run, over full scale, channel by channel.
fn error(rig: &str, model: ModelName, top: f64, effects: &[(&str, &[f64])]) -> [f64; 3] {
    let rig = Rig::from_toml(rig).unwrap();
    let (coarse, fine) = (run(&rig, model, top, effects, 1), run(&rig, model, top, effects, FINER));
    std::array::from_fn(|c| {
        let full = fine.iter().fold(0.0_f64, |m, x| m.max(x[c].abs()));
        let sum: f64 = coarse.iter().zip(&fine).map(|(a, b)| (a[c] - b[c]).powi(2)).sum();
        (sum / coarse.len() as f64).sqrt() / full
    })
}

#[test]
fn follows_a_finer_step_to_a_percent() {
    let friction: &[(&str, &[f64])] = &[("coulomb_friction", &[5e-4, 0.3, 20.0])];
    let swirl: &[(&str, &[f64])] = &[("rotational_flow", &[0.3, 0.4])];
    for (what, rig, model, top, effects) in [
        ("in air", IN_AIR, ModelName::Model2, 15.0, &[] as &[(&str, &[f64])]),
        ("in air, dry friction", IN_AIR, ModelName::Model2, 15.0, friction),
        ("in air, swirl as a state", IN_AIR, ModelName::RotationalFlow, 15.0, &[]),
        ("in air, swirl as an effect", IN_AIR, ModelName::Model2, 15.0, swirl),
        ("short duct", SHORT_DUCT, ModelName::Model2, 9.0, &[]),
        ("short duct, swirl", SHORT_DUCT, ModelName::RotationalFlow, 9.0, &[]),
    ] {
        let error = error(rig, model, top, effects);
        assert!(error.iter().all(|e| *e < 0.01), "{what}: {error:?}");
    }
}

#[test]
fn a_recorded_speed_drives_a_stiff_flow() {
    let rig = Rig::from_toml(IN_AIR).unwrap();
    let mut plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], TICK_S);
    let (thrust, _) = Parameters::stated(&rig).bollard_coefficients();
    let speed = |k: usize| 2000.0 + 1000.0 * (0.01 * k as f64).sin();
    plant.start(0.0, speed(0), 8.0, 0.0, 0.0);
    for k in 0..500 {
        plant.step(&Tick { driven: Driven::Speed(speed(k), speed(k + 1)), ..Tick::default() });
        let wanted = thrust * speed(k + 1).powi(2);
        let seen = plant.truth().thrust_n;
        assert!(k < 3 || (seen / wanted - 1.0).abs() < 0.01, "{k}: {seen} {wanted}");
    }
}

#[test]
fn derivatives_of_a_stiff_run_are_those_of_its_differences() {
    let rig = Rig::from_toml(IN_AIR).unwrap();
    let stated = Parameters::stated(&rig);
    let speed = |p: P, by: f64| {
        let mut parameters = stated;
        parameters.set(p, stated.get(p) * (1.0 + by));
        let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], TICK_S);
        (0..200).for_each(|k| plant.step(&Tick { command: 8.0 + 0.01 * k as f64, ..Tick::default() }));
        [plant.truth().shaft_speed_rad_s, plant.truth().thrust_n]
    };
    for p in [P::LiftMax, P::DuctLengthM, P::InertiaKgM2, P::TorqueConstantNmA, P::TimeConstantS] {
        let mut parameters = Parameters::<Dual>::lift(&stated);
        parameters.set(p, Dual::parameter(stated.get(p), 2));
        let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], TICK_S);
        (0..200).for_each(|k| plant.step(&Tick { command: 8.0 + 0.01 * k as f64, ..Tick::default() }));
        let derived = [plant.truth().shaft_speed_rad_s, plant.truth().thrust_n].map(|d| d.slopes()[2]);
        let (up, down, here) = (speed(p, 1e-6), speed(p, -1e-6), speed(p, 0.0));
        for c in 0..2 {
            let difference = (up[c] - down[c]) / (2e-6 * stated.get(p));
            let size = here[c] / stated.get(p);
            assert!((derived[c] - difference).abs() < 1e-3 * difference.abs() + 1e-5 * size, "{p:?} {c}");
        }
    }
}

/// A rig of any size, in air or water, with any drive.
fn any_rig() -> impl Strategy<Value = (String, f64, f64)> {
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let shape = (log(0.01, 1.5), log(0.05, 3.0), 0.1..0.8f64, log(0.2, 2.0), log(0.2, 2.0));
    let rest = (prop::bool::ANY, 0.3..4.0f64, 0.3..4.0f64, log(0.01, 100.0), log(5e-4, 0.02));
    (shape, rest, prop::sample::select(vec!["current", "voltage", "speed"])).prop_map(
        |((radius, length, pitch, lift, drag), (air, flux, added, inertia, tick_s), kind)| {
            let density = if air { 1.2 } else { 998.0 };
            // Inertia about that of the blades, times anything; a torque that gives a tip speed of 20 m/s or
            // 150 m/s; a drive that can give it.
            let inertia = inertia * if air { 300.0 } else { 2000.0 } * radius.powi(5) * 0.1;
            let inertia = inertia.clamp(1e-9, 1e5);
            let tip = if air { 150.0 } else { 20.0 };
            let torque = 0.02 * density * tip * tip * radius.powi(3);
            let (kt, amps) = (torque / 20.0, 20.0);
            let supply = 1.5 * kt * tip / radius;
            let ohm = 0.1 * supply / amps;
            let text = format!(
                "[propeller]\nradius_m = {radius}\nduct_length_m = {}\npitch_rad = {pitch}\nlift_max = {lift}\n\
                 drag_max = {drag}\n[flow]\ndensity_kg_m3 = {density}\nflux_coefficient = {flux}\n\
                 added_mass_coefficient = {added}\n[motor]\ninertia_kg_m2 = {inertia}\n\
                 torque_constant_nm_a = {kt}\nwinding_resistance_ohm = {ohm}\n[amplifier]\nkind = \"{kind}\"\n\
                 current_limit_a = {amps}\nsupply_v = {supply}\n",
                (radius * length).max(0.001)
            );
            let top = match kind {
                "current" => amps,
                "voltage" => supply,
                _ => tip / radius,
            };
            (text, top, tick_s)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]
    /// Whatever the rig, no response runs away, and no derivative.
    #[test]
    fn no_rig_runs_away((text, top, tick_s) in any_rig(), levels in prop::collection::vec(-1.0..1.0f64, 6),
                        swirl in prop::bool::ANY) {
        let rig = Rig::from_toml(&text).unwrap();
        let model = if swirl { ModelName::RotationalFlow } else { ModelName::Model2 };
        let mut parameters = Parameters::<Dual>::lift(&Parameters::stated(&rig));
        parameters.set(P::LiftMax, Dual::parameter(parameters.get(P::LiftMax).value, 0));
        let mut plain = Plant::new(model, &rig, &Parameters::stated(&rig), &[], tick_s);
        let mut dual = Plant::new(model, &rig, &parameters, &[], tick_s);
        let radius = rig.propeller.unwrap().radius_m.value;
        for k in 0..240 {
            let tick = Tick { time_s: k as f64 * tick_s, command: top * levels[k / 40], ..Tick::default() };
            plain.step(&tick);
            dual.step(&tick);
            let (a, b) = (plain.truth(), dual.truth());
            prop_assert!(a.thrust_n.is_finite() && a.axial_m_s.is_finite() && a.shaft_speed_rad_s.is_finite());
            // No faster than the tip by far, were there no load at all.
            prop_assert!(a.axial_m_s.abs() < 3e3, "{} m/s in {text}", a.axial_m_s);
            prop_assert!(a.shaft_speed_rad_s.abs() * radius < 3e4, "{} rad/s in {text}", a.shaft_speed_rad_s);
            prop_assert!((a.thrust_n - b.thrust_n.value).abs() <= 1e-6 * a.thrust_n.abs() + 1e-9);
            prop_assert!(b.thrust_n.slopes()[0].is_finite() && b.shaft_speed_rad_s.slopes()[0].is_finite());
        }
    }
}

/// A very light shaft on a strong back-EMF, which its drive's limit hides wherever the shaft is led to.
const BRAKED_AT_ONCE: &str = r#"
[propeller]
radius_m = 0.0186
duct_length_m = 0.0026
pitch_rad = 0.345
lift_max = 0.302
drag_max = 0.413
[flow]
density_kg_m3 = 998
flux_coefficient = 0.3
added_mass_coefficient = 0.886
[motor]
inertia_kg_m2 = 4.44e-9
torque_constant_nm_a = 0.00255
winding_resistance_ohm = 0.0206
[amplifier]
kind = "voltage"
supply_v = 4.12
current_limit_a = 20
"#;

/// A speed that is set whatever current it takes, where the stated limit would allow a fifth of it.
const SET_SPEED: &str = r#"
[propeller]
radius_m = 0.0367
duct_length_m = 0.0046
pitch_rad = 0.77
lift_max = 1.57
drag_max = 1.0
[flow]
density_kg_m3 = 998
flux_coefficient = 3.75
added_mass_coefficient = 3.47
[motor]
inertia_kg_m2 = 3.6e-4
torque_constant_nm_a = 0.0197
[amplifier]
kind = "speed"
supply_v = 16.1
current_limit_a = 20
"#;

#[test]
fn what_a_limit_hides_still_settles_where_a_finer_step_does() {
    for (text, commands, tick_s) in
        [(BRAKED_AT_ONCE, [0.13, 1.67, 0.0], 0.02), (SET_SPEED, [490.0, -490.0, 270.0], 0.0013)]
    {
        let rig = Rig::from_toml(text).unwrap();
        let mut parameters = Parameters::<Dual>::lift(&Parameters::stated(&rig));
        parameters.set(P::LiftMax, Dual::parameter(parameters.get(P::LiftMax).value, 0));
        let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], tick_s);
        let mut finer: Plant =
            Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], tick_s / FINER as f64);
        for command in commands {
            for _ in 0..100 {
                plant.step(&Tick { command, ..Tick::default() });
                (0..FINER).for_each(|_| {
                    finer.step(&Tick { command, ..Tick::default() });
                });
            }
            let (a, b) = (plant.truth(), finer.truth());
            let a = [a.thrust_n.value, a.shaft_speed_rad_s.value];
            assert!((a[0] - b.thrust_n).abs() < 0.01 * b.thrust_n.abs() + 1e-3, "{command}: {a:?} {b:?}");
            assert!((a[1] - b.shaft_speed_rad_s).abs() < 0.01 * b.shaft_speed_rad_s.abs() + 0.1, "{command}");
            assert!(plant.truth().thrust_n.slopes()[0].abs() < 100.0 * b.thrust_n.abs() + 1.0, "{command}");
        }
    }
}

#[test]
fn several_quiet_ticks_at_once_end_where_single_ones_do() {
    let rig = Rig::from_toml(IN_AIR).unwrap();
    let stated = Parameters::stated(&rig);
    let warming: &[f64] = &[2e-4, 1e-7, 2.0];
    for effects in [&[] as &[(&Descriptor, &[f64])], &[(find("friction_warm_up").unwrap(), warming)]] {
        let mut one = Plant::new(ModelName::Model2, &rig, &stated, effects, TICK_S);
        let mut five = Plant::new(ModelName::Model2, &rig, &stated, effects, TICK_S);
        let mut most = [0.0_f64; 2];
        // Steps, and a slow rise after each.
        let tick = |k: usize| Tick {
            time_s: k as f64 * TICK_S,
            command: 15.0 * LEVELS[k / 75 % 8] + 0.002 * (k % 75) as f64,
            ..Tick::default()
        };
        for k in (0..TICKS).step_by(5) {
            let ticks: Vec<Tick> = (k..k + 5).map(tick).collect();
            ticks.iter().for_each(|tick| one.step(tick));
            five.stride(&ticks, None);
            let (a, b) = (one.truth(), five.truth());
            most[0] = most[0].max((a.shaft_speed_rad_s - b.shaft_speed_rad_s).abs());
            most[1] = most[1].max((a.thrust_n - b.thrust_n).abs());
        }
        let top = 15.0 / stated.get(P::TorqueConstantNmA);
        assert!(most[0] < 1e-3 * top, "{most:?} of {top}, {}", effects.len());
        assert!(most[0] > 0.0, "none were passed at once");
    }
}
