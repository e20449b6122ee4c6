//! How slow a loop may be: at the longest period that is not warned of, the default law brings every shipped rig to rest at its
//! thrust; at twice that one of them swings.

use kort_control::advice::TimeScales;
use kort_control::model::ControlModel;
use kort_control::{Controller, Measurement, Reference, advise};
use kort_controller::pace::LONGEST_PERIOD;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

const TICK_S: f64 = 1e-3;

/// How far the thrust still swings, share of the largest, seconds after a step to a share of it; the plant is as the model says.
fn swing(rig: &Rig, ticks: u64, share: f64) -> f64 {
    let period_s = ticks as f64 * TICK_S;
    let advice = advise(rig, period_s).unwrap();
    let mut controller = Controller::new(rig, &advice.config, period_s).unwrap();
    let largest_n = ControlModel::from_rig(rig, period_s).unwrap().thrust_max_n;
    let mut plant = Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), &[], TICK_S);
    let (mut low, mut high, mut command) = (f64::MAX, f64::MIN, 0.0);
    for tick in 0..6000u64 {
        let truth = *plant.truth();
        if tick % ticks == 0 {
            let (sensors, kind) = (&rig.sensors, rig.amplifier.kind);
            let measured = Measurement {
                shaft_speed_rad_s: Some(truth.shaft_speed_rad_s),
                current_a: (kind != AmplifierKind::Speed).then_some(truth.current_a),
                thrust_n: sensors.thrust_sensor.then_some(truth.thrust_n),
                flow_m_s: sensors.flow_meter.then_some(truth.axial_m_s),
                ambient_m_s: sensors.ambient_flow_recorded.then_some(0.0),
                supply_v: rig.amplifier.supply_v,
                shaft_angle_rad: None,
            };
            let drive = controller.tick(&measured, Reference::Thrust(share * largest_n), period_s).command;
            command = match kind {
                AmplifierKind::Current => drive.current_a,
                AmplifierKind::Voltage => drive.voltage_v.unwrap_or_default(),
                AmplifierKind::Speed => drive.speed_rad_s.unwrap_or_default(),
            };
        }
        plant.step(&Tick { time_s: tick as f64 * TICK_S, command, ..Tick::default() });
        if tick > 4000 {
            (low, high) = (low.min(truth.thrust_n), high.max(truth.thrust_n));
        }
    }
    (high - low) / largest_n
}

#[test]
fn the_thrust_comes_to_rest_at_the_longest_period_that_is_not_warned_of() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/thrusters");
    let mut twice = 0.0f64;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let rig = Rig::from_toml(&std::fs::read_to_string(&path).unwrap()).unwrap();
        // A rig that states no numbers of its water has no controller.
        let Ok(model) = ControlModel::from_rig(&rig, 4.0 * TICK_S) else { continue };
        let longest = LONGEST_PERIOD * TimeScales::of(&model).shaft_s / TICK_S;
        for share in [0.25, 0.5, 0.9] {
            let swings = swing(&rig, longest as u64, share);
            assert!(swings < 0.06, "{}: {swings} of the largest at {share}", path.display());
            // Beyond 100 ms there is no controller.
            twice = twice.max(swing(&rig, (2 * longest as u64).min(100), share));
        }
    }
    assert!(twice > 0.1, "{twice}: the bound is wider than it need be");
}
