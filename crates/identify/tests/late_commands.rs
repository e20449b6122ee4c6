//! A drive that answers late, and not equally late each time, is fitted with the steps of its command.

use kort_identify::data::Series;
use kort_identify::hypothesis::{Free, Member};
use kort_identify::noise::Criterion;
use kort_identify::setup::Setup;
use kort_thruster::effects::transport_delay;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 0.01, tol = 0.2 }\n\
                   torque_constant_nm_a = { value = 0.5, tol = 0.1 }\n\
                   viscous_friction_nm_s = { value = 0.1, tol = 0.3 }\n\
                   [amplifier]\ntime_constant_s = 0.002\n\
                   [sensors]\nlog_rate_hz = 200\ncontrol_rate_hz = 200\n";
const ROW_S: f64 = 0.005;
/// Mean delay and how far each step's may lie from it, s.
const LATE_S: (f64, f64) = (0.0145, 0.0018);

/// A motor under levels that are commanded at rows and act some time later, with its current and its speed.
fn recording() -> Series {
    const DT: f64 = 1e-4;
    let mut seed = 5_u64;
    let mut draw = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (rows, fine) = (4000, (ROW_S / DT).round() as usize);
    let (mut commands, mut acts) = (Vec::new(), Vec::<(f64, f64)>::new());
    while commands.len() < rows {
        let (level, from_s) = (8.0 * draw() - 4.0, commands.len() as f64 * ROW_S);
        acts.push((from_s + LATE_S.0 + LATE_S.1 * (2.0 * draw() - 1.0), level));
        commands.extend(std::iter::repeat_n(level, 60 + (60.0 * draw()) as usize));
    }
    let (mut current, mut speed, mut next, mut asked) = (0.0_f64, 0.0_f64, 0, 0.0);
    let (mut currents, mut speeds) = (Vec::new(), Vec::new());
    for step in 0..rows * fine {
        if step % fine == 0 {
            currents.push(current + 0.01 * (draw() - 0.5));
            speeds.push(speed + 0.02 * (draw() - 0.5));
        }
        while next < acts.len() && acts[next].0 <= step as f64 * DT {
            asked = acts[next].1;
            next += 1;
        }
        current += (asked - current) / 0.002 * DT;
        speed += (0.5 * current - 0.1 * speed) / 0.01 * DT;
    }
    commands.truncate(rows);
    let names = ["current_cmd_a", "current_a", "shaft_speed_rad_s"];
    Series {
        name: "late".into(),
        time_s: (0..rows).map(|k| k as f64 * ROW_S).collect(),
        columns: names.iter().map(|n| (*n).to_string()).zip([commands, currents, speeds]).collect(),
    }
}

fn mean(of: &[f64]) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

#[test]
fn a_delay_that_is_not_always_the_same_is_found_from_anywhere() {
    let rig = Rig::from_toml(RIG).unwrap();
    let criterion = Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
    let series = [recording()];
    let Setup { problem, baseline, .. } = Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap();
    let nothing = problem.settle_from_stated(&baseline, 24);
    let reached = |start_s: f64| {
        let late = Member::new(&transport_delay::DESCRIPTOR, &problem.scale).at(vec![start_s]);
        let from = nothing.hypothesis.with(&nothing.values, late, &problem.scale);
        let fit = problem.settle(&from, &nothing.columns, &nothing.floor, 12);
        // Sensors read later show the same as a drive that answers later.
        let sampled = |(free, value): (&Free, &f64)| (free.name == "sampling_delay_s").then_some(*value);
        let sampled: Vec<f64> = fit.hypothesis.free.iter().zip(&fit.values).filter_map(sampled).collect();
        let delay_s = problem.members(&fit.hypothesis, &fit.values)[0].values[0];
        let earlier_s = problem.scale.tick_s * mean(&fit.hypothesis.inputs.edges[0]);
        (delay_s - earlier_s + mean(&sampled), fit.cost())
    };
    let all = [0.003, 0.01, 0.02].map(reached);
    let least = all.iter().map(|r| r.1).fold(f64::INFINITY, f64::min);
    for (late_s, cost) in all {
        assert!((late_s - LATE_S.0).abs() < 0.0005 && cost < least + 10.0, "{all:?}");
    }
}
