//! One suite over every observer: they see the water, and say when they do not.

mod common;

use common::{Loop, rigs};
use kort_control::{ControllerConfig, EstimatorKind, LawKind, Measurement, ObserverKind, Reference};
use kort_thruster::rig::Rig;

fn config(observer: ObserverKind) -> ControllerConfig {
    ControllerConfig { observer, ..Default::default() }
}

#[test]
fn the_flow_is_found_in_still_water() {
    for rig in rigs() {
        for observer in ObserverKind::ALL {
            for force_sensor in [false, true] {
                let mut l = Loop::new(&rig, &config(observer), 0.001);
                l.force_sensor = force_sensor;
                let most = l.controller.model().thrust_max_n;
                for share in [0.5, -0.5, 0.1] {
                    let out = l.run(Reference::Thrust(share * most), 6.0);
                    let (found, truth) = (out.estimate.flow_m_s.value, l.plant.truth().axial_m_s);
                    let scale = l.controller.model().map.flow_m * l.controller.model().speed_max_rad_s;
                    assert!(
                        (found - truth).abs() < 0.06 * scale,
                        "{} {} force {force_sensor} {share}: {found} for {truth}",
                        rig.name,
                        observer.name()
                    );
                }
            }
        }
    }
}

#[test]
fn the_ambient_flow_is_found_where_it_can_be() {
    let rig = &rigs()[0];
    for observer in [ObserverKind::Luenberger, ObserverKind::Ekf, ObserverKind::Ukf] {
        let mut l = Loop::new(rig, &config(observer), 0.001);
        l.ambient_m_s = 0.4;
        l.flow_meter = true;
        let out = l.run(Reference::Thrust(60.0), 20.0);
        let (flow, truth) = (out.estimate.flow_m_s.value, l.plant.truth().axial_m_s);
        assert!((flow - truth).abs() < 0.08, "{}: flow {flow} for {truth}", observer.name());
        let ambient = out.estimate.ambient_m_s;
        assert!((ambient.value - 0.4).abs() < 0.2, "{}: ambient {ambient:?}", observer.name());
    }
}

/// From shaft speed alone, ambient flow and load torque cannot be told apart, and at standstill
/// nothing is seen of either: the standard errors must say so.
#[test]
fn the_covariance_says_when_a_state_is_not_observable() {
    let rig = &rigs()[0];
    for observer in [ObserverKind::Ekf, ObserverKind::Ukf] {
        let doubt = |force_sensor: bool, thrust: f64| {
            let mut l = Loop::new(rig, &config(observer), 0.001);
            l.force_sensor = force_sensor;
            l.run(Reference::Thrust(thrust), 20.0).estimate
        };
        let (with, without, resting) = (doubt(true, 80.0), doubt(false, 80.0), doubt(true, 0.0));
        let name = observer.name();
        assert!(
            with.ambient_m_s.std_error < 0.6 * without.ambient_m_s.std_error,
            "{name}: {with:?} {without:?}"
        );
        assert!(resting.ambient_m_s.std_error > 0.9 * 0.5, "{name}: prior is 0.5, at rest {resting:?}");
        let load_prior = 0.03 * 9.0 * 1.25;
        assert!(without.load_torque_n_m.std_error > 0.4 * load_prior, "{name}: {without:?}");
    }
    let mut l = Loop::new(rig, &config(ObserverKind::Luenberger), 0.001);
    assert!(l.run(Reference::Thrust(80.0), 1.0).estimate.ambient_m_s.std_error.is_infinite());
}

/// A stuck or lying force sensor must not carry the filter away for good.
#[test]
fn a_filter_comes_back_after_a_sensor_fault() {
    let rig = &rigs()[0];
    for observer in [ObserverKind::Ekf, ObserverKind::Ukf] {
        let mut l = Loop::new(rig, &config(observer), 0.001);
        l.run(Reference::Thrust(80.0), 4.0);
        for k in 0..2000 {
            let mut lie = l.measured();
            lie.thrust_n = Some(if k % 2 == 0 { 600.0 } else { -600.0 });
            l.controller.tick(&lie, Reference::Thrust(80.0), 0.001);
        }
        let out = l.run(Reference::Thrust(80.0), 6.0);
        assert!(out.estimate.gated > 1000, "{}", out.estimate.gated);
        assert!(
            (out.estimate.thrust_n.value - l.thrust()).abs() < 4.0,
            "{}: {:?}",
            observer.name(),
            out.estimate
        );
    }
}

/// A law that leads a shaft which is not there drives the true one at full current: it must not be left alone with what it believes for
/// longer than the shaft takes to top speed (61 ms on the stand).
#[test]
fn a_filter_that_lost_the_shaft_finds_it_before_the_shaft_is_anywhere() {
    let rig = &rigs()[0];
    for observer in [ObserverKind::Ekf, ObserverKind::Ukf] {
        let mut l = Loop::new(rig, &config(observer), 0.001);
        l.run(Reference::Thrust(80.0), 4.0);
        let elsewhere = -l.plant.sensed().shaft_speed_rad_s;
        let mut believed = 0.0;
        for _ in 0..80 {
            let shown = Measurement { shaft_speed_rad_s: Some(elsewhere), ..l.measured() };
            let out = l.controller.tick(&shown, Reference::Thrust(80.0), 0.001);
            believed = out.estimate.shaft_speed_rad_s.value;
        }
        assert!((believed / elsewhere - 1.0).abs() < 0.1, "{}: {believed} at {elsewhere}", observer.name());
    }
}

/// Another observer, or adaptation that is switched on, goes on from where the thruster is.
#[test]
fn a_change_of_observer_or_estimator_under_way_hardly_moves_the_thrust() {
    let rig = Rig::from_toml(common::STAND).unwrap();
    for from in ObserverKind::ALL {
        for to in ObserverKind::ALL {
            for estimator in EstimatorKind::ALL {
                let law = LawKind::Model2Inversion;
                let mut l = Loop::new(&rig, &ControllerConfig { law, ..config(from) }, 0.004);
                let asked = 0.6 * l.controller.model().thrust_max_n;
                l.run(Reference::Thrust(asked), 3.0);
                l.controller.configure(&ControllerConfig { law, estimator, ..config(to) });
                for tick in 0..250 {
                    l.tick(Reference::Thrust(asked));
                    let off = (l.thrust() - asked).abs();
                    assert!(
                        off < 0.05 * asked,
                        "{} to {} with {}: {off} N off {asked} N after {tick} ticks",
                        from.name(),
                        to.name(),
                        estimator.name()
                    );
                }
            }
        }
    }
}
