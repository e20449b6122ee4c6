//! What must hold of the published models whatever the numbers.

use kort_thruster::blade::Blade;
use kort_thruster::models::{
    DriveInput, Model, Model0, Model1, Model2, Model3, RotationalFlow, ShaftFlowState, SpeedInput,
};
use kort_thruster::motor::Drive;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::rig::Rig;
use proptest::prelude::*;

fn paper() -> Parameters {
    Parameters::stated(
        &Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap(),
    )
}

/// Thrusters from a hand-held to a work-class one.
fn thruster() -> impl Strategy<Value = Parameters> {
    (0.03..0.3f64, 0.25..0.55f64, 0.3..1.2f64, 0.3..2.0f64, 1.4..2.4f64, 0.5..4.0f64, 0.2..5.0f64).prop_map(
        |(r, pitch, cl, cd, flux, gamma, inertia)| {
            let mut p = paper();
            p.set(P::RadiusM, r);
            p.set(P::DuctLengthM, r);
            p.set(P::PitchRad, pitch);
            p.set(P::LiftMax, cl);
            p.set(P::DragMax, cd);
            p.set(P::FluxCoefficient, flux);
            p.set(P::AddedMassCoefficient, gamma);
            // Inertia and friction in proportion to the size of the thruster.
            p.set(P::InertiaKgM2, inertia * 0.01 * (r / 0.13).powi(5));
            let (thrust, torque) = p.bollard_coefficients();
            p.set(P::ThrustCoefficientNS2, thrust);
            p.set(P::TorqueCoefficientNmS2, torque);
            p
        },
    )
}

fn blade() -> impl Strategy<Value = Blade> {
    thruster().prop_map(|p| p.blade())
}

/// Torque, N m, at which a thruster turns at a speed in bollard pull.
fn torque_at(p: &Parameters, speed: f64) -> f64 {
    p.bollard_coefficients().1 * speed * speed.abs()
}

fn close(a: f64, b: f64, relative: f64, absolute: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs()) + absolute
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn loads_are_odd_under_reversal(b in blade(), om in -100.0..100.0f64, vp in -3.0..3.0f64, us in -2.0..2.0f64) {
        let ahead = b.load(b.inflow(om, vp, us));
        let astern = b.load(b.inflow(-om, -vp, -us));
        prop_assert_eq!(ahead.thrust_n, -astern.thrust_n);
        prop_assert_eq!(ahead.torque_n_m, -astern.torque_n_m);
    }

    #[test]
    fn motion_is_odd_under_reversal(p in thruster(), speed in 1.0..80.0f64, va in -0.5..0.5f64) {
        let torque = torque_at(&p, speed);
        let run = |sign: f64| {
            let input = DriveInput { drive: Drive::Torque(sign * torque), ambient_m_s: sign * va };
            let model = RotationalFlow::new(&p);
            let mut x = [sign * 3.0, sign * -0.2, sign * 0.1].into();
            for _ in 0..200 { x = model.step(x, &input, 1e-3); }
            <[f64; 3]>::from(x)
        };
        prop_assert_eq!(run(1.0), run(-1.0).map(|x| -x));
    }

    #[test]
    fn no_thrust_without_flow_normal_to_the_chord(b in blade(), om in -100.0..100.0f64) {
        let ut = b.lever_m() * om;
        let load = b.load(b.inflow(om, ut * b.pitch_rad.tan(), 0.0));
        let scale = b.density_kg_m3 * b.area_m2() * ut * ut;
        prop_assert!(load.thrust_n.abs() <= 1e-12 * scale && load.torque_n_m.abs() <= 1e-12 * scale);
    }

    #[test]
    fn thrust_rises_with_shaft_speed_at_fixed_flow(vp in -2.0..2.0f64, om in -80.0..79.0f64, by in 0.01..1.0f64) {
        // Checked for the paper's blade: with CDmax far above CLmax it need not hold.
        let b = paper().blade();
        let thrust = |om: f64| b.load(b.inflow(om, vp, 0.0)).thrust_n;
        prop_assert!(thrust(om + by) > thrust(om), "{} {}", thrust(om + by), thrust(om));
    }

    #[test]
    fn steady_state_is_where_a_long_simulation_ends(
        p in thruster(), speed in 10.0..80.0f64, sign in prop::bool::ANY, va in -0.15..0.15f64, kind in 0..3u8,
    ) {
        let torque = torque_at(&p, if sign { speed } else { -speed });
        let mut p = p;
        // A winding that drops as much as the back-EMF: neither the stiff nor the idle case.
        let kt = p.get(P::TorqueConstantNmA);
        p.set(P::WindingResistanceOhm, kt * kt * speed / torque.abs());
        let drive = match kind {
            0 => Drive::Torque(torque),
            1 => Drive::Current(torque / kt),
            _ => Drive::Voltage(2.0 * kt * torque.signum() * speed),
        };
        // A thruster this size sees an ambient flow in proportion to its own.
        let input = DriveInput { drive, ambient_m_s: va * speed * p.get(P::RadiusM) * 0.2 };
        let model = Model2::new(&p);
        let steady = model.steady_state(&input).unwrap();
        let mut x = ShaftFlowState::default();
        // Thirty turns are about ten time constants; ten times that settles it.
        let turns = 300.0 * std::f64::consts::TAU;
        let dt = 0.02 / speed;
        for _ in 0..(turns / speed / dt) as usize { x = model.step(x, &input, dt); }
        prop_assert!(close(x.shaft_speed_rad_s, steady.shaft_speed_rad_s, 1e-6, 1e-6), "{x:?} {steady:?}");
        prop_assert!(close(x.axial_m_s, steady.axial_m_s, 1e-6, 1e-7), "{x:?} {steady:?}");
    }

    #[test]
    fn bollard_steady_state_has_one_inflow_angle(p in thruster(), speed in 0.5..90.0f64) {
        let model = Model2::new(&p);
        let x = model.steady_state(&DriveInput::torque(torque_at(&p, speed))).unwrap();
        prop_assert!(close(x.shaft_speed_rad_s, speed, 1e-6, 0.0), "{x:?} {speed}");
        // Model 3 at that speed, and the static map, must agree with it.
        let still = SpeedInput::still(speed);
        let flow = Model3::new(&p).steady_state(&still).unwrap();
        prop_assert!(close(flow.axial_m_s, x.axial_m_s, 1e-5, 0.0));
        let map = Model0::new(&p).load([], &still);
        prop_assert!(close(map.thrust_n, Model3::new(&p).load(flow, &still).thrust_n, 1e-5, 0.0));
    }
}

/// Turns of the shaft until its speed first passes 90 % of the steady value.
fn turns_to_90(torque: f64) -> f64 {
    let model = Model2::new(&paper());
    let input = DriveInput::torque(torque);
    let goal = 0.9 * model.steady_state(&input).unwrap().shaft_speed_rad_s;
    let (mut x, mut angle) = (ShaftFlowState::default(), 0.0);
    let dt = 1e-4 * (11.0 / torque).sqrt();
    loop {
        let next = model.step(x, &input, dt);
        let (now, then) = (x.shaft_speed_rad_s, next.shaft_speed_rad_s);
        let turned = 0.5 * (now + then) * dt;
        if then >= goal {
            return (angle + turned * (goal - now) / (then - now)) / std::f64::consts::TAU;
        }
        x = next;
        angle += turned;
    }
}

#[test]
fn step_responses_collapse_on_shaft_angle() {
    let turns: Vec<f64> = [0.5, 1.5, 4.0, 9.2, 11.0].map(turns_to_90).to_vec();
    for t in &turns {
        assert!((t - 1.47).abs() < 0.01, "90 % at {t} turns");
        assert!((t / turns[0] - 1.0).abs() < 2e-4, "{turns:?}");
    }
}

#[test]
fn error_falls_with_the_fourth_power_of_the_step() {
    // From a moving state: at rest |vp| has a kink.
    let model = Model2::new(&paper());
    let input = DriveInput::torque(9.2);
    let run = |steps: usize| {
        let dt = 0.1 / steps as f64;
        let start = ShaftFlowState { shaft_speed_rad_s: 20.0, axial_m_s: 0.4 };
        let x = (0..steps).fold(start, |x, _| model.step(x, &input, dt));
        <[f64; 2]>::from(x)
    };
    let exact = run(6400);
    let error = |steps| {
        let x = run(steps);
        (x[0] - exact[0]).abs().max((x[1] - exact[1]).abs())
    };
    for steps in [50, 100] {
        let order = (error(steps) / error(2 * steps)).log2();
        assert!((order - 4.0).abs() < 0.25, "order {order} at {steps} steps");
    }
}

#[test]
fn poles_of_model_2_scale_with_speed_and_match_the_shaft() {
    let p = paper();
    let model = Model2::new(&p);
    let poles = |speed: f64| {
        let input = DriveInput::torque(torque_at(&p, speed));
        model.linearise(model.steady_state(&input).unwrap(), &input).poles()
    };
    let (fast, slow) = (poles(60.0), poles(20.0));
    assert!((fast[0].re + 11.7).abs() < 0.1 && (fast[1].re + 65.6).abs() < 0.2, "{fast:?}");
    for (f, s) in fast.iter().zip(&slow) {
        assert!(f.im == 0.0 && close(f.re, 3.0 * s.re, 1e-4, 0.0), "{fast:?} {slow:?}");
    }
}

#[test]
fn gains_are_the_slopes_of_the_steady_curve() {
    let p = paper();
    let steady_thrust = |torque: f64| {
        let model = RotationalFlow::new(&p);
        let input = DriveInput::torque(torque);
        model.load(model.steady_state(&input).unwrap(), &input).thrust_n
    };
    let model = RotationalFlow::new(&p);
    let input = DriveInput::torque(6.0);
    let linear = model.linearise(model.steady_state(&input).unwrap(), &input);
    let slope = (steady_thrust(6.01) - steady_thrust(5.99)) / 0.02;
    assert!(close(linear.thrust_gain().unwrap(), slope, 1e-4, 0.0), "{:?} {slope}", linear.thrust_gain());
    // A torque on the shaft without friction ends wholly in blade torque.
    assert!(close(linear.torque_gain().unwrap(), 1.0, 1e-4, 0.0));
}

#[test]
fn model_1_has_the_fixed_point_of_equation_9() {
    let p = paper();
    let model = Model1::new(&p);
    let input = DriveInput::torque(9.2);
    let x = model.steady_state(&input).unwrap();
    let load = model.load(x, &input);
    assert!(close(load.torque_n_m, 9.2, 1e-6, 0.0), "{load:?}");
    assert!(close(load.torque_n_m, 0.5 * model.slip_m * load.thrust_n, 1e-12, 0.0));
}
