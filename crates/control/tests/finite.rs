//! Finite on any finite input, within limits on any input at all.

mod common;

use common::rigs;
use kort_control::{
    Controller, ControllerConfig, EstimatorKind, LawKind, Measurement, ObserverKind, Reference,
};
use proptest::prelude::*;

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -200.0..200.0,
        1 => Just(0.0),
        1 => any::<f64>(),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
    ]
}

fn measurement() -> impl Strategy<Value = Measurement> {
    let maybe = || proptest::option::weighted(0.8, number());
    (maybe(), maybe(), maybe(), maybe(), maybe(), maybe(), maybe()).prop_map(|(a, b, c, d, e, f, g)| {
        Measurement {
            shaft_speed_rad_s: a,
            current_a: b,
            thrust_n: c,
            flow_m_s: d,
            ambient_m_s: e,
            supply_v: f,
            shaft_angle_rad: g,
        }
    })
}

fn reference() -> impl Strategy<Value = Reference> {
    prop_oneof![
        Just(Reference::Off),
        number().prop_map(Reference::Thrust),
        number().prop_map(Reference::Speed)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn every_kind_stays_finite_and_limited(
        inputs in prop::collection::vec((measurement(), reference(), 0.0..0.02f64), 1..60),
        rate in prop_oneof![Just(100.0), Just(500.0), Just(1000.0), Just(5000.0)],
    ) {
        for rig in rigs() {
            // One controller for all: what it does at a switch is limited too, and each takes a rehearsal of faults to make.
            let mut c = Controller::new(&rig, &ControllerConfig::default(), 1.0 / rate).unwrap();
            let mut last = 0.0_f64;
            for law in LawKind::ALL {
                for (observer, estimator) in [
                    (ObserverKind::OpenLoop, EstimatorKind::Off),
                    (ObserverKind::Luenberger, EstimatorKind::Gradient),
                    (ObserverKind::Ekf, EstimatorKind::Rls),
                    (ObserverKind::Ukf, EstimatorKind::Rls),
                ] {
                    let config = ControllerConfig { law, observer, estimator, ..Default::default() };
                    c.configure(&config);
                    for (measured, reference, dt) in &inputs {
                        let out = c.tick(measured, *reference, *dt);
                        let who = format!("{} {} {}", rig.name, law.name(), observer.name());
                        let i = out.command.current_a;
                        prop_assert!(i.is_finite() && i.abs() <= c.model().current_limit_a, "{who}: {i}");
                        let most = config.limits.current_rate_per_s * c.model().current_limit_a * 5.0 / rate;
                        prop_assert!((i - last).abs() <= most * 1.0001 || *reference == Reference::Off || i == 0.0, "{who}: {last} to {i}");
                        last = i;
                        for v in [out.command.voltage_v, out.command.speed_rad_s].into_iter().flatten() {
                            prop_assert!(v.is_finite(), "{who}");
                        }
                        let e = out.estimate;
                        for x in [e.shaft_speed_rad_s, e.flow_m_s, e.ambient_m_s, e.thrust_n, e.load_torque_n_m, e.swirl_m_s] {
                            prop_assert!(x.value.is_finite() && x.std_error >= 0.0, "{who}: {x:?}");
                        }
                        for r in c.adapted().ratio {
                            prop_assert!((0.4..=2.5).contains(&r), "{who}: {r}");
                        }
                    }
                }
            }
        }
    }
}
