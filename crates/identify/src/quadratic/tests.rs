use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;
use rand::{Rng, SeedableRng};

use super::*;
use crate::data::Series;
use crate::hypothesis::Target;
use crate::setup::Setup;

const CRITERION: Criterion =
    Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };

fn free(sigma: f64) -> Free {
    let (target, name, unit) = (Target::Effect(0, 0), "size", "1");
    Free { target, name, unit, stated: false, mean: 0.0, sigma, low: -9.0, high: 9.0, acts: None }
}

/// Calls with the lines of a shaft's speed and with derivatives that are noise.
fn with_lines(then: impl FnOnce(&Spectrum, Vec<Arc<DVector<f64>>>)) {
    let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n";
    let wave = |by: f64| (0..900).map(|k| (by * f64::from(k)).sin()).collect();
    let series = Series {
        name: "log".into(),
        time_s: (0..900).map(|k| 0.01 * f64::from(k)).collect(),
        columns: vec![("current_cmd_a".into(), wave(0.02)), ("shaft_speed_rad_s".into(), wave(0.03))],
    };
    let rig = Rig::from_toml(rig).unwrap();
    let problem = Setup::new(&[series], &rig, ModelName::Model2, CRITERION).unwrap().problem;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let lines = problem.spectrum.lines;
    let mut column = || Arc::new(DVector::from_fn(lines, |_, _| rng.random_range(-1.0..1.0)));
    let columns = (0..7).map(|_| column()).collect();
    then(&problem.spectrum, columns);
}

fn alike(a: &Quadratic, b: &Quadratic) {
    let close = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
        assert_eq!(a.shape(), b.shape());
        assert!((a - b).amax() < 1e-12 * (1.0 + b.amax()));
    };
    close(&a.slope, &b.slope);
    close(&a.curvature, &b.curvature);
    assert!((&a.residual - &b.residual).amax() < 1e-12 * (1.0 + b.residual.amax()));
    assert_eq!(a.sigmas, b.sigmas);
}

#[test]
fn what_is_known_of_products_is_what_they_are() {
    with_lines(|spectrum, all| {
        let [residual, other] = [&all[0], &all[1]];
        let free: Vec<Free> = [0.5, 2.0, 1.0, 3.0, 0.1].map(free).into();
        let new = |residual: &DVector<f64>, columns: &[Arc<DVector<f64>>], free: &[Free]| {
            Quadratic::new(spectrum, &CRITERION, residual, columns, free)
        };
        let known = new(residual, &all[2..5], &free[..3]);
        let five = new(residual, &all[2..7], &free);
        alike(&known.beside(residual, &all[2..7], &free), &five);
        alike(&known.about(other, &all[2..7], &free), &new(other, &all[2..7], &free));
        // Another derivative in a place that was known, and another prior.
        let exchanged = [all[2].clone(), all[6].clone(), all[4].clone()];
        alike(&known.beside(residual, &exchanged, &free[..3]), &new(residual, &exchanged, &free[..3]));
        let wider = [free[0].clone(), free[3].clone(), free[2].clone()];
        alike(&known.beside(residual, &all[2..5], &wider), &new(residual, &all[2..5], &wider));

        let more: Vec<&DVector<f64>> = all[5..7].iter().map(AsRef::as_ref).collect();
        let crossed = known.crossed(residual, &more);
        let crossed: Vec<&DMatrix<f64>> = crossed.iter().collect();
        let joined = known.joined(&crossed, &products(spectrum, &more), &free);
        alike(&joined, &five);
        let picked = [all[2].clone(), all[4].clone(), all[6].clone()];
        let of_picked = [free[0].clone(), free[2].clone(), free[4].clone()];
        alike(&joined.only(&[0, 2, 4]), &new(residual, &picked, &of_picked));
        let narrow: Vec<Free> = free
            .iter()
            .enumerate()
            .map(|(k, f)| Free { sigma: if k < 3 { f.sigma } else { 0.3 * f.sigma }, ..f.clone() })
            .collect();
        alike(&joined.scaled(3, 0.3), &new(residual, &all[2..7], &narrow));
    });
}

#[test]
fn a_step_leaves_what_its_straight_line_says() {
    with_lines(|spectrum, all| {
        let free: Vec<Free> = [0.5, 2.0, 1.0].map(free).into();
        let model = Quadratic::new(spectrum, &CRITERION, &all[0], &all[2..5], &free);
        let step = DVector::from_row_slice(&[0.3, -0.7, 1.1]);
        let moved = (0..3)
            .fold(all[0].as_ref().clone(), |left, k| left - all[2 + k].as_ref() * (step[k] * free[k].sigma));
        let (told, are) = (model.powers(&step), spectrum.powers(&moved));
        assert!(told.iter().zip(&are).all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + b)), "{told:?} {are:?}");
    });
}
