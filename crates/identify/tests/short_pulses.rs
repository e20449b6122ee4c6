//! A command that is set back, or on, at the next row is steps all the same.

use kort_identify::data::Series;
use kort_identify::noise::Criterion;
use kort_identify::setup::Setup;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 0.0012, tol = 0.2 }\n\
                   torque_constant_nm_a = { value = 0.5, tol = 0.1 }\n\
                   viscous_friction_nm_s = { value = 0.02, tol = 0.3 }\n\
                   [sensors]\nlog_rate_hz = 50\ncontrol_rate_hz = 500\n";
/// Interval of the rows, and the size of the noise of the speed, rad/s.
const ROW_S: f64 = 0.02;
const NOISE_RAD_S: f64 = 0.05;

/// A motor under levels, each set somewhere between two rows; every fifth stands for one row or two only.
fn recording() -> Series {
    const DT: f64 = 1e-4;
    let mut seed = 11_u64;
    let mut draw = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (rows, fine) = (1500, (ROW_S / DT).round() as usize);
    let mut set: Vec<(f64, f64)> = vec![(0.0, 0.0)];
    while set[set.len() - 1].0 < rows as f64 * ROW_S {
        let stands = if set.len() % 5 < 2 { 1.2 + 0.6 * draw() } else { 8.0 + 10.0 * draw() };
        set.push((set[set.len() - 1].0 + stands * ROW_S, 8.0 * draw() - 4.0));
    }
    let (mut speed, mut next, mut asked) = (0.0_f64, 0, 0.0);
    let (mut commands, mut speeds) = (Vec::new(), Vec::new());
    for step in 0..rows * fine {
        while next < set.len() && set[next].0 <= step as f64 * DT {
            asked = set[next].1;
            next += 1;
        }
        if step % fine == 0 {
            commands.push(asked);
            speeds.push(speed + NOISE_RAD_S * 12.0_f64.sqrt() * (draw() - 0.5));
        }
        speed += (0.5 * asked - 0.02 * speed) / 0.0012 * DT;
    }
    let names = ["current_cmd_a", "shaft_speed_rad_s"];
    Series {
        name: "pulses".into(),
        time_s: (0..rows).map(|k| k as f64 * ROW_S).collect(),
        columns: names.iter().map(|n| (*n).to_string()).zip([commands, speeds]).collect(),
    }
}

#[test]
fn what_stands_for_one_row_is_placed_as_any_step() {
    let rig = Rig::from_toml(RIG).unwrap();
    let criterion = Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
    let series = [recording()];
    let Setup { problem, baseline, .. } = Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap();
    let turned_at_once = problem.recordings[0].edges.windows(2).filter(|w| w[1] == w[0] + 1).count();
    assert!(turned_at_once > 20, "{turned_at_once}");
    let fit = problem.settle_from_stated(&baseline, 24);
    let left = &problem.residual(&fit.hypothesis, &fit.values)[0][0];
    let rms = (left.iter().map(|e| e * e).sum::<f64>() / left.len() as f64).sqrt();
    // A step is placed to a tick of 2 ms, or to a part of one.
    assert!(rms < 10.0 * NOISE_RAD_S, "{rms} rad/s of noise {NOISE_RAD_S}");
}
