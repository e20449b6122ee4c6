//! A fit reaches what is far from where it starts: there the response bends, and a step gives other than it promises.

use kort_identify::data::Series;
use kort_identify::hypothesis::Member;
use kort_identify::noise::Criterion;
use kort_identify::setup::Setup;
use kort_thruster::effects::coulomb_friction;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;
use rand::{Rng as _, SeedableRng};

const CRITERION: Criterion =
    Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 100.0, timing_s: 0.001 };
const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
/// Dry friction of a shaft whose motor gives 11 N m at most, N m, its rise at rest and the speed of that, rad/s.
const FRICTION: [f64; 3] = [1.2, 0.3, 2.0];
const TICK_S: f64 = 0.002;

/// 9 s of a thruster that rubs, at levels of its current.
fn recording(rig: &Rig) -> Series {
    let levels = [(1.0, 0.0), (3.4, 4.233), (5.37, 2.69), (6.78, 3.886), (9.0, -0.504)];
    let dry = (&coulomb_friction::DESCRIPTOR, &FRICTION[..]);
    let mut plant = Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), &[dry], TICK_S);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut noise = |size: f64| size * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    let (mut time_s, mut columns) = (Vec::new(), vec![Vec::new(); 3]);
    for k in 0..4500_u32 {
        let t = f64::from(k) * TICK_S;
        let command = levels.iter().find(|(until, _)| t < *until).unwrap().1;
        let at = *plant.truth();
        if k % 5 == 0 {
            time_s.push(t);
            let row = [command, at.shaft_speed_rad_s + noise(0.1), at.thrust_n + noise(0.6)];
            row.iter().zip(&mut columns).for_each(|(value, column)| column.push(*value));
        }
        plant.step(&Tick { time_s: t, command, ..Tick::default() });
    }
    let names = ["current_cmd_a", "shaft_speed_rad_s", "thrust_n"];
    Series {
        name: "rubbing".into(),
        time_s,
        columns: names.map(str::to_owned).into_iter().zip(columns).collect(),
    }
}

#[test]
fn friction_many_times_its_start_is_found_in_a_dozen_steps() {
    let rig = Rig::from_toml(RIG).unwrap();
    let Setup { problem, baseline, .. } =
        Setup::new(&[recording(&rig)], &rig, ModelName::Model2, CRITERION).unwrap();
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
