//! Calm stretches are passed in longer steps: whatever an effect does to the machine, its response is the one that single
//! ticks give.

mod common;

use std::sync::Arc;

use common::{CRITERION, RIG, recording};
use kort_identify::data::available;
use kort_identify::hypothesis::{Hypothesis, Inputs, Member};
use kort_identify::setup::Setup;
use kort_identify::simulate::Problem;
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

/// Long enough to settle: a step that comes late falls into the calm. Until when, s, and how much, A.
const LEVELS: [(f64, f64); 8] =
    [(2.0, 0.0), (4.0, 4.0), (6.0, -3.0), (8.0, 6.0), (10.0, 2.0), (12.0, -5.0), (14.0, 1.0), (16.0, 3.0)];

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
        Setup::new(&[recording(&rig, &[], &LEVELS, [0.0; 2])], &rig, ModelName::Model2, CRITERION).unwrap();
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

/// A step of the command fell into a gap of the log, in which the shaft had settled: wherever in the gap it is tried.
#[test]
fn a_step_moved_through_a_gap_acts_as_in_single_ticks() {
    let rig = Rig::from_toml(RIG).unwrap();
    let mut series = recording(&rig, &[], &LEVELS, [0.0; 2]);
    let kept: Vec<usize> =
        (0..series.time_s.len()).filter(|row| !(3.81..4.03).contains(&series.time_s[*row])).collect();
    let keep = |all: &mut Vec<f64>| *all = kept.iter().map(|row| all[*row]).collect();
    keep(&mut series.time_s);
    series.columns.iter_mut().for_each(|(_, column)| keep(column));
    let Setup { problem, baseline, .. } = Setup::new(&[series], &rig, ModelName::Model2, CRITERION).unwrap();
    let mut single = problem.clone();
    single.recordings[0].strides.fill(1);
    let after_gap = problem.recordings[0].edges.iter().position(|row| kept[*row] == 403).unwrap();
    for ticks in (0..110).step_by(10) {
        let mut edges = baseline.inputs.edges.clone();
        edges[0][after_gap] = f64::from(ticks);
        let inputs = Arc::new(Inputs::new(&problem.recordings, edges));
        let apart = apart(&problem, &single, &Hypothesis { inputs, ..baseline.clone() });
        assert!(apart < 2e-3, "{ticks} ticks before its row: {apart}");
    }
}
