//! Physics that is hidden behind a rough rig description is found although the baseline bends another number for it.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

/// The winding and the inertia are known to a factor of two, and half of what brakes the shaft is not stated at all.
const RIG: &str = r#"
[rig]
name = "gear motor of unknown winding"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 0.003, tol = 0.9 }
torque_constant_nm_a = { value = 0.6, tol = 0.01 }
winding_resistance_ohm = { value = 4.0, tol = 0.9 }
viscous_friction_nm_s = { value = 0.004, tol = 0.01 }
[amplifier]
kind = "voltage"
current_limit_a = 12
supply_v = 24
[sensors]
log_rate_hz = 500
control_rate_hz = 500
"#;

const ROWS: usize = 4000;
const ROW_S: f64 = 0.002;
const FINE: usize = 20;

/// Levels of voltage between -24 and 24 V, each held for 20 to 160 ms.
fn commands() -> Vec<f64> {
    let mut seed = 12_345_u64;
    let mut draw = || {
        seed = (seed * 1_103_515_245 + 12_345) % (1 << 31);
        seed
    };
    let mut commands = Vec::new();
    while commands.len() < ROWS {
        let volt = 24.0 * (2.0 * draw() as f64 / f64::from(1_u32 << 31) - 1.0);
        let held = [10, 20, 40, 80][(draw() >> 16) as usize & 3];
        commands.extend(std::iter::repeat_n(volt, held));
    }
    commands.truncate(ROWS);
    commands
}

/// The motor as it truly is: its winding at 60 % of what is stated, its inertia at 125 %, four times the friction.
fn recording() -> Series {
    let (resistance, inertia, constant, friction) = (2.4, 0.00375, 0.6, 0.016);
    let (mut speed, mut angle, mut noise) = (0.0_f64, 0.0_f64, 1_u64);
    let commands = commands();
    let mut columns = vec![Vec::new(), Vec::new()];
    for volt in &commands {
        let rough = (0..12).map(|_| {
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (noise >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        });
        columns[0].push(angle);
        columns[1].push(speed + 0.05 * rough.sum::<f64>());
        for _ in 0..FINE {
            let dt = ROW_S / FINE as f64;
            let current = ((volt - constant * speed) / resistance).clamp(-12.0, 12.0);
            speed += (constant * current - friction * speed) / inertia * dt;
            angle += speed * dt;
        }
    }
    let names = ["shaft_angle_rad", "shaft_speed_rad_s"];
    let measured = names.iter().map(|n| (*n).to_string()).zip(columns);
    let columns = std::iter::once(("voltage_cmd_v".to_string(), commands)).chain(measured).collect();
    Series { name: "motor".into(), time_s: (0..ROWS).map(|k| k as f64 * ROW_S).collect(), columns }
}

/// That friction is named, and nothing beside it.
fn names_the_friction(rig: &str) {
    let rig = Rig::from_toml(rig).unwrap();
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    let report = diagnose(&[recording()], &rig, &options, &|_| ()).unwrap().report;
    let named = report.findings.iter().find(|f| f.effect == "viscous_friction");
    let named = named.unwrap_or_else(|| panic!("{}", report.summary));
    // Eight seconds say it clearly, and not much more.
    assert!(named.probability > 0.5, "{}: {}", named.probability, report.summary);
    assert_eq!(report.findings.len(), 1, "{}", report.summary);
}

#[test]
fn what_a_bent_winding_hides_is_named() {
    names_the_friction(RIG);
}

/// A rig that states its encoder does not say how its drive makes a speed of it: of an instant here, where the model's is
/// the mean over a tick. At every step of the command the two differ, which passed for play in a gear.
#[test]
fn a_speed_of_an_instant_is_no_play_in_a_gear() {
    names_the_friction(&format!("{RIG}encoder_counts_per_rev = 12800\n"));
}
