//! Calm stretches are passed in longer steps: whatever an effect does to the machine, its response is the one that single
//! ticks give.

use kort_identify::data::{Series, available};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_identify::noise::Criterion;
use kort_identify::setup::Setup;
use kort_identify::simulate::Problem;
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;

const CRITERION: Criterion =
    Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 100.0, timing_s: 0.001 };
const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
const TICK_S: f64 = 0.002;

/// 16 s of levels of the current, long enough to settle: a step that comes late falls into the calm.
fn recording(rig: &Rig) -> Series {
    let levels = [0.0, 4.0, -3.0, 6.0, 2.0, -5.0, 1.0, 3.0];
    let mut plant = Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), &[], TICK_S);
    let (mut time_s, mut columns) = (Vec::new(), vec![Vec::new(); 3]);
    for k in 0..8000_u32 {
        let t = f64::from(k) * TICK_S;
        let command = levels[(t / 2.0) as usize];
        let at = *plant.truth();
        if k % 5 == 0 {
            time_s.push(t);
            let row = [command, at.shaft_speed_rad_s, at.thrust_n];
            row.iter().zip(&mut columns).for_each(|(value, column)| column.push(*value));
        }
        plant.step(&Tick { time_s: t, command, ..Tick::default() });
    }
    let names = ["current_cmd_a", "shaft_speed_rad_s", "thrust_n"];
    Series {
        name: "levels".into(),
        time_s,
        columns: names.map(str::to_owned).into_iter().zip(columns).collect(),
    }
}

/// The largest difference between two responses, over full scale.
fn apart(problem: &Problem, single: &Problem, hypothesis: &Hypothesis) -> f64 {
    let (a, b) =
        (problem.respond(hypothesis, &hypothesis.start), single.respond(hypothesis, &hypothesis.start));
    let channels = &problem.recordings[0].channels;
    let of =
        |c: usize| a[0][c].iter().zip(&b[0][c]).map(move |(x, y)| (x - y).abs() / channels[c].full_scale);
    (0..channels.len()).flat_map(of).fold(0.0, f64::max)
}

#[test]
fn every_effect_responds_as_in_single_ticks() {
    let rig = Rig::from_toml(RIG).unwrap();
    let Setup { series, problem, baseline, .. } =
        Setup::new(&[recording(&rig)], &rig, ModelName::Model2, CRITERION).unwrap();
    let strides = &problem.recordings[0].strides;
    assert!(
        strides.iter().filter(|count| **count > 1).count() > strides.len() / 10,
        "nothing is passed over"
    );
    let mut single = problem.clone();
    single.recordings[0].strides.fill(1);
    let offered = available(ModelName::Model2, &series, &problem.recordings);
    let mut compared = 0;
    for effect in effects::ALL.iter().copied().filter(|e| (e.needs)(&rig, &offered).is_ok()) {
        for start in Member::new(effect, &problem.scale).starts(&problem.scale) {
            let member = Member::new(effect, &problem.scale).at(start.clone());
            let hypothesis = baseline.with(&baseline.start, member, &problem.scale);
            let apart = apart(&problem, &single, &hypothesis);
            assert!(apart < 2e-3, "{} {start:?}: {apart}", effect.id);
            compared += 1;
        }
    }
    assert!(compared > 60, "{compared} starts of effects");
}
