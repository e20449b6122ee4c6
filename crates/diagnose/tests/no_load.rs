//! A motor on a bench with nothing on its shaft, and a rig that states little of it.

mod common;

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::Finding;
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

use common::Draws;

const ROWS: usize = 3000;
const ROW_S: f64 = 0.01;
const FINE: usize = 50;
const TORQUE_CONSTANT_NM_A: f64 = 0.12;
const RESISTANCE_OHM: f64 = 0.5;
const INERTIA_KG_M2: f64 = 8e-4;

/// What is so, whatever the rig states.
struct Bench {
    viscous_nm_s: f64,
    supply_v: f64,
}

impl Bench {
    /// Steps of current both ways, with what the drive makes of them: 30 s at 100 Hz.
    fn recording(&self) -> Series {
        let mut draws = Draws(5);
        let (mut speed, mut angle, mut amperes) = (0.0_f64, 0.0, 0.0);
        let mut columns: Vec<(String, Vec<f64>)> = ["current_cmd_a", "shaft_angle_rad", "shaft_speed_rad_s"]
            .iter()
            .map(|name| (name.to_string(), Vec::new()))
            .collect();
        for row in 0..ROWS {
            if row % 150 == 0 {
                amperes = 2.0 * draws.next();
            }
            let shown = [amperes, angle + 1e-3 * draws.next(), speed + 0.3 * draws.next()];
            columns.iter_mut().zip(shown).for_each(|(column, value)| column.1.push(value));
            for _ in 0..FINE {
                let dt = ROW_S / FINE as f64;
                let emf_v = TORQUE_CONSTANT_NM_A * speed;
                // What the supply can push through the winding, either way.
                let most = ((self.supply_v - emf_v) / RESISTANCE_OHM).max(0.0);
                let least = ((-self.supply_v - emf_v) / RESISTANCE_OHM).min(0.0);
                let torque = TORQUE_CONSTANT_NM_A * amperes.clamp(least, most) - self.viscous_nm_s * speed;
                angle += speed * dt;
                speed += torque / INERTIA_KG_M2 * dt;
            }
        }
        Series { name: "bench".into(), time_s: (0..ROWS).map(|k| k as f64 * ROW_S).collect(), columns }
    }

    /// What is found where the rig states this of the motor's friction.
    fn findings(&self, stated: &str) -> Vec<Finding> {
        let rig = Rig::from_toml(&format!(
            "[rig]\nname = \"servo motor on a bench\"\n[propeller]\nkind = \"none\"\n[motor]\n\
             inertia_kg_m2 = {{ value = 7e-4, tol = 0.4 }}\ntorque_constant_nm_a = {{ value = 0.12, tol = 0.05 }}\n\
             winding_resistance_ohm = {{ value = 0.5, tol = 0.1 }}\n{stated}\n[amplifier]\nkind = \"current\"\n\
             [sensors]\nlog_rate_hz = 100\ncontrol_rate_hz = 500\n"
        ))
        .unwrap();
        let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
        diagnose(&[self.recording()], &rig, &options, &|_| {}).unwrap().report.findings
    }
}

fn value(finding: &Finding, name: &str) -> f64 {
    finding.parameters.iter().find(|p| p.name == name).unwrap().value
}

#[test]
fn a_supply_that_nobody_stated_runs_out_all_the_same() {
    let bench = Bench { viscous_nm_s: 1e-3, supply_v: 12.0 };
    let found = bench.findings("viscous_friction_nm_s = { value = 1e-3, tol = 0.3 }");
    let limit = found.iter().find(|f| f.effect == "voltage_limit_backemf").unwrap();
    assert!(limit.probability > 0.5, "{}", limit.probability);
    let limit_v = value(limit, "supply_taken_v") * (1.0 - value(limit, "lost_voltage_share"));
    assert!((limit_v / 12.0 - 1.0).abs() < 0.1, "{limit_v} V");
}

/// Most of the torque is friction's, as it must be where nothing else takes it.
#[test]
fn friction_that_takes_most_of_the_torque_is_no_wonder_on_an_idle_shaft() {
    let bench = Bench { viscous_nm_s: 1.2e-3, supply_v: 60.0 };
    let found = bench.findings("");
    let friction = found.first().unwrap();
    assert_eq!(friction.effect, "viscous_friction");
    assert!(friction.probability > 0.7, "{}", friction.probability);
    let size = value(friction, "viscous_friction_nm_s");
    assert!((size / 1.2e-3 - 1.0).abs() < 0.1, "{size} N m s");
}
