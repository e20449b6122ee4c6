//! The crate's Model 2, and the composed plant, against the self-contained one in `examples/`.

#[path = "../examples/plain.rs"]
mod plain;

use kort_thruster::models::{DriveInput, Model, Model2, ModelName, ShaftFlowState};
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{Quantity, Rig, Sensors};

fn paper() -> Rig {
    Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap()
}

/// A torque programme through all four quadrants.
fn torque(k: usize) -> f64 {
    [9.2, -11.0, 1.5, 0.0, -4.0, 11.0, -0.3, 6.0][k / 250 % 8]
}

#[test]
fn loads_agree_in_all_quadrants() {
    let model = Model2::new(&Parameters::stated(&paper()));
    for i in -40..=40 {
        for j in -20..=20 {
            let (om, vp) = (2.0 * f64::from(i), 0.1 * f64::from(j));
            let state = ShaftFlowState { shaft_speed_rad_s: om, axial_m_s: vp };
            let ours = model.load(state, &DriveInput::torque(0.0));
            let (thrust, torque) = plain::blades(om, vp);
            assert!((ours.thrust_n - thrust).abs() < 1e-9, "{om} {vp}: {} {thrust}", ours.thrust_n);
            assert!((ours.torque_n_m - torque).abs() < 1e-9, "{om} {vp}");
        }
    }
}

#[test]
fn trajectories_agree_to_1e_9() {
    let model = Model2::new(&Parameters::stated(&paper()));
    let mut ours = ShaftFlowState::default();
    let (mut om, mut vp) = (0.0, 0.0);
    for k in 0..4000 {
        ours = model.step(ours, &DriveInput::torque(torque(k)), 0.001);
        (om, vp) = plain::step(om, vp, torque(k), 0.001);
        assert!((ours.shaft_speed_rad_s - om).abs() < 1e-9 * om.abs().max(1.0), "step {k}: {ours:?} {om}");
        assert!((ours.axial_m_s - vp).abs() < 1e-9, "step {k}: {ours:?} {vp}");
    }
    assert!(om.abs() > 1.0, "the programme must move the shaft");
}

#[test]
fn the_composed_plant_runs_the_same_model() {
    let mut rig = paper();
    rig.sensors = Sensors::IDEAL;
    rig.amplifier.time_constant_s = Quantity::exact(0.0);
    let parameters = Parameters::stated(&rig);
    let kt = rig.motor.torque_constant_nm_a.value;
    // From moving states in all quadrants, the current already where the command holds it.
    for (speed, flow, torque) in
        [(20.0, 0.3, 9.2), (-40.0, 0.8, 3.0), (-10.0, -0.9, -8.0), (50.0, -0.5, -1.0)]
    {
        let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[], 0.001);
        plant.start(0.0, speed, flow, torque / kt, 0.0);
        let (mut om, mut vp) = (speed, flow);
        for k in 0..1000 {
            plant.step(&Tick { time_s: f64::from(k) * 0.001, command: torque / kt, ..Tick::default() });
            (om, vp) = plain::step(om, vp, torque, 0.001);
            let truth = plant.truth();
            assert!(
                (truth.shaft_speed_rad_s - om).abs() < 1e-7,
                "tick {k}: {} {om}",
                truth.shaft_speed_rad_s
            );
            assert!((truth.axial_m_s - vp).abs() < 1e-8, "tick {k}: {} {vp}", truth.axial_m_s);
        }
    }
}
