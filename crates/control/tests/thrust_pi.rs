//! What a force sensor may do to the law that closes a loop on it: right, it brings the thrust wherever the water flows;
//! wrong, it costs a factor.

mod common;

use common::{Loop, rigs};
use kort_control::{ControllerConfig, LawKind, Reference};
use kort_thruster::parameters::Parameter;
use kort_thruster::rig::{AmplifierKind, Rig};

fn driven() -> impl Iterator<Item = Rig> {
    rigs().into_iter().filter(|rig| rig.amplifier.kind != AmplifierKind::Speed)
}

fn start(rig: &Rig, factors: &[(Parameter, f64)]) -> (Loop, f64) {
    let l = Loop::with_truth(rig, &ControllerConfig::with_law(LawKind::ThrustPi), 0.002, factors);
    let full_n = l.controller.model().thrust_max_n;
    (l, full_n)
}

/// In a stream from either side of up to half of the flow at full thrust, and with blades known to a fifth, the thrust comes.
#[test]
fn under_inflow_the_setpoint_is_reached() {
    for rig in driven() {
        for (lift, drag) in [(1.0, 1.0), (0.8, 1.2), (1.2, 0.8)] {
            for inflow in [-0.5, 0.25, 0.5] {
                for share in [0.1, 0.4] {
                    let factors = [(Parameter::LiftMax, lift), (Parameter::DragMax, drag)];
                    let (mut l, full_n) = start(&rig, &factors);
                    let model = l.controller.model();
                    let slow = model.poles_per_rad().0 * model.map.speed_rad_s(share * full_n).abs();
                    l.ambient_m_s = inflow * model.map.flow_m * model.speed_max_rad_s;
                    l.run(Reference::Thrust(share * full_n), 4.0 + 20.0 / slow);
                    let (off, asked) = (l.thrust() - share * full_n, share * full_n);
                    assert!(
                        off.abs() < 0.02 * full_n,
                        "{}: {off} N off {asked} in {inflow}, blades {lift} {drag}",
                        rig.name
                    );
                }
            }
        }
    }
}

/// What a sensor shows of the true thrust, where another one was asked for.
type Shown = fn(f64, f64) -> f64;

/// Reversed, dead, in a wrong unit either way, or frozen a little low: at most twice the thrust, and not less than half,
/// beside what moves about zero.
#[test]
fn a_sensor_that_is_wrong_costs_a_factor_of_two() {
    let lies: [(&str, Shown); 6] = [
        ("reversed", |t, _| -t),
        ("dead", |_, _| 0.0),
        ("kgf", |t, _| t / 9.806_65),
        ("N", |t, _| t * 9.806_65),
        ("frozen", |_, asked| 0.95 * asked),
        ("beyond", |_, _| 1e300),
    ];
    for rig in driven() {
        for share in [0.1, -0.25] {
            for (what, shown) in lies {
                let (mut l, full_n) = start(&rig, &[]);
                let asked = share * full_n;
                l.run(Reference::Thrust(asked), 3.0);
                let (mut least, mut most) = (f64::INFINITY, 0.0f64);
                for n in 0..6_000 {
                    let mut measured = l.measured();
                    measured.thrust_n = measured.thrust_n.map(|t| shown(t, asked));
                    l.tick_with(&measured, Reference::Thrust(asked));
                    if n > 2500 {
                        let along = l.thrust() * asked.signum();
                        (least, most) = (least.min(along), most.max(along));
                    }
                }
                let floor = 0.06 * full_n;
                let allowed = ((0.45 * asked.abs() - floor), (2.0 * asked.abs()).max(asked.abs() + floor));
                assert!(
                    least > allowed.0 && most < 1.15 * allowed.1,
                    "{}, {what} at {asked} N: {least} to {most}, allowed {allowed:?}",
                    rig.name
                );
            }
        }
    }
}
