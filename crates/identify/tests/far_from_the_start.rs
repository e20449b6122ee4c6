//! A fit reaches what is far from where it starts: there the response bends, and a step gives other than it promises.

mod common;

use common::{CRITERION, RIG, recording};
use kort_identify::hypothesis::Member;
use kort_identify::setup::Setup;
use kort_thruster::effects::coulomb_friction;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

/// Dry friction of a shaft whose motor gives 11 N m at most, N m, its rise at rest and the speed of that, rad/s.
const FRICTION: [f64; 3] = [1.2, 0.3, 2.0];
/// Until when, s, and how much, A.
const LEVELS: [(f64, f64); 5] = [(1.0, 0.0), (3.4, 4.233), (5.37, 2.69), (6.78, 3.886), (9.0, -0.504)];

#[test]
fn friction_many_times_its_start_is_found_in_a_dozen_steps() {
    let rig = Rig::from_toml(RIG).unwrap();
    let rubbing = [(&coulomb_friction::DESCRIPTOR, &FRICTION[..])];
    let series = [recording(&rig, &rubbing, &LEVELS, [0.1, 0.6])];
    let Setup { problem, baseline, .. } = Setup::new(&series, &rig, ModelName::Model2, CRITERION).unwrap();
    let nothing = problem.settle_from_stated(&baseline, 24);
    let reached = |part: f64| {
        let start = vec![part * FRICTION[0], 0.3, 1.0];
        let dry = Member::new(&coulomb_friction::DESCRIPTOR, &problem.scale).at(start);
        let from = nothing.hypothesis.with(&nothing.values, dry, &problem.scale);
        let fit = problem.settle(&from, &Vec::new(), &nothing.floor, 12);
        (problem.members(&fit.hypothesis, &fit.values)[0].values[0], fit.cost())
    };
    let (near, cost) = reached(1.0);
    assert!((near / FRICTION[0] - 1.0).abs() < 0.1, "{near} N m");
    for part in [0.05, 0.1, 0.2] {
        let (found, there) = reached(part);
        assert!(
            (found / near - 1.0).abs() < 0.1 && there < cost + 30.0,
            "{part}: {found} N m, {there} for {cost}"
        );
    }
}
