//! One suite over every estimator: it finds the truth, feeds the law, keeps its box, and freezes.

mod common;

use common::{Loop, rigs};
use kort_control::estimators::Freeze;
use kort_control::{ControllerConfig, EstimatorKind, LawKind, Reference};
use kort_thruster::parameters::Parameter;

fn config(estimator: EstimatorKind) -> ControllerConfig {
    ControllerConfig { law: LawKind::Model2Inversion, estimator, ..Default::default() }
}

const ADAPTIVE: [EstimatorKind; 2] = [EstimatorKind::Gradient, EstimatorKind::Rls];

/// Steps between levels for a while.
fn excite(l: &mut Loop, seconds: f64) {
    let levels = [60.0, 100.0, 40.0, -70.0, 90.0, -30.0];
    for k in 0..(seconds / 3.0) as usize {
        l.run(Reference::Thrust(levels[k % levels.len()]), 3.0);
    }
}

#[test]
fn estimates_converge_on_the_truth() {
    let rig = &rigs()[0];
    for estimator in ADAPTIVE {
        for (factors, expected) in [
            (vec![(Parameter::LiftMax, 1.3)], [1.3, 1.0]),
            (vec![(Parameter::LiftMax, 0.7)], [0.7, 1.0]),
            (vec![(Parameter::DragMax, 1.3)], [1.0, 1.3]),
            (vec![(Parameter::LiftMax, 0.85), (Parameter::DragMax, 1.2)], [0.85, 1.2]),
        ] {
            let mut l = Loop::with_truth(rig, &config(estimator), 0.001, &factors);
            excite(&mut l, 60.0);
            let found = l.controller.adapted();
            for (ratio, expected) in found.ratio.iter().zip(expected) {
                assert!((ratio / expected - 1.0).abs() < 0.06, "{} {factors:?}: {found:?}", estimator.name());
            }
            assert_eq!(l.controller.model().blade.lift_max, 0.542 * found.ratio[0], "the law runs on it");
        }
    }
}

/// With a flow meter the flux coefficient is found too, and is not laid on lift and drag.
#[test]
fn a_flow_meter_tells_the_flux_coefficient() {
    let rig = &rigs()[0];
    for estimator in ADAPTIVE {
        for factor in [0.75, 1.3] {
            let mut l =
                Loop::with_truth(rig, &config(estimator), 0.001, &[(Parameter::FluxCoefficient, factor)]);
            l.flow_meter = true;
            excite(&mut l, 90.0);
            let found = l.controller.adapted().ratio;
            for (ratio, expected) in found.iter().zip([1.0, 1.0, factor]) {
                assert!((ratio / expected - 1.0).abs() < 0.06, "{} {factor}: {found:?}", estimator.name());
            }
        }
    }
}

#[test]
fn adaptation_freezes_without_excitation_or_sensor() {
    let rig = &rigs()[0];
    for estimator in ADAPTIVE {
        let mut l = Loop::new(rig, &config(estimator), 0.001);
        l.run(Reference::Thrust(0.0), 5.0);
        assert_eq!(l.controller.adapted().frozen, Some(Freeze::NoExcitation), "{}", estimator.name());
        let mut l = Loop::with_truth(rig, &config(estimator), 0.001, &[(Parameter::LiftMax, 1.3)]);
        l.force_sensor = false;
        l.run(Reference::Thrust(60.0), 10.0);
        // One working point and torque alone: lift and drag cannot be told apart.
        assert!(l.controller.adapted().frozen.is_some(), "{}", estimator.name());
        // What the start-up transient taught is little.
        for ratio in l.controller.adapted().ratio {
            assert!((ratio - 1.0).abs() < 0.08, "{ratio}");
        }
    }
}

#[test]
fn estimates_never_leave_their_box() {
    let rig = &rigs()[0];
    for estimator in ADAPTIVE {
        let mut l = Loop::with_truth(
            rig,
            &config(estimator),
            0.001,
            &[(Parameter::LiftMax, 4.0), (Parameter::DragMax, 0.1)],
        );
        for k in 0..20 {
            l.run(Reference::Thrust(if k % 2 == 0 { 90.0 } else { -60.0 }), 1.0);
            for r in l.controller.adapted().ratio {
                assert!((0.4..=2.5).contains(&r), "{}: {r}", estimator.name());
            }
        }
    }
}

/// After a 30 % change of lift, the adaptive law's thrust error comes back to what it is with true
/// parameters.
#[test]
fn the_adapted_model_feeds_the_law() {
    let rig = &rigs()[0];
    let rms = |estimator: EstimatorKind, factor: f64| {
        let mut l = Loop::with_truth(rig, &config(estimator), 0.001, &[(Parameter::LiftMax, factor)]);
        l.force_sensor = true;
        excite(&mut l, 36.0);
        let (mut sum, mut n) = (0.0, 0.0);
        for target in [60.0, 100.0, -50.0] {
            for _ in 0..2000 {
                l.tick(Reference::Thrust(target));
                sum += (l.thrust() - target).powi(2);
                n += 1.0;
            }
        }
        (sum / n).sqrt()
    };
    let truth = rms(EstimatorKind::Off, 1.0);
    for estimator in ADAPTIVE {
        let adapted = rms(estimator, 1.3);
        assert!(adapted < 1.2 * truth, "{}: {adapted} against {truth}", estimator.name());
    }
}
