//! A motor on a stand, for tests of what looks at residuals.

use kort_identify::data::Series;
use kort_identify::fit::Fit;
use kort_identify::setup::Setup;
use kort_identify::simulate::{Problem, Stack};
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;
use rand::{Rng as _, SeedableRng};

use crate::constants::Constants;

/// Nothing brakes it: an observer keeps the simulation with the recorded speed.
const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n";
const ROWS: usize = 4000;

/// Looks at a residual of the shaft's speed that is this function of the simulated speed (over its usual size), of time
/// and of a draw of normal noise; 40 s of random levels of the current.
pub fn left<R>(error: impl Fn(f64, f64, f64) -> f64, look: impl FnOnce(&Problem, &Fit, &Stack) -> R) -> R {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let levels: Vec<f64> = (0..ROWS / 100).map(|_| rng.random_range(-5.0..5.0)).collect();
    let columns = vec![
        ("current_cmd_a".into(), (0..ROWS).map(|k| levels[k / 100]).collect()),
        ("shaft_speed_rad_s".into(), (0..ROWS).map(|k| 30.0 * (k as f64 * 0.01).sin()).collect()),
    ];
    let time_s = (0..ROWS).map(|k| 0.01 * k as f64).collect();
    let series = [Series { name: "log".into(), time_s, columns }];
    let rig = Rig::from_toml(RIG).unwrap();
    let setup = Setup::new(&series, &rig, ModelName::Model2, Constants::built_in().criterion).unwrap();
    let fit = setup.problem.fit(&setup.baseline, &Vec::new(), &setup.problem.floor, 0);
    let speed: Vec<f64> =
        setup.problem.rows(&fit.hypothesis, &fit.values)[0].iter().map(|s| s.true_speed_rad_s).collect();
    let usual = (speed.iter().map(|s| s * s).sum::<f64>() / ROWS as f64).sqrt();
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let residual = speed.iter().enumerate().map(|(k, s)| error(s / usual, 0.01 * k as f64, normal()));
    let residual = vec![vec![residual.collect()]];
    look(&setup.problem, &fit, &residual)
}
