//! Electrical power in, speed out: a log without a command.

use kort_identify::data::{DataError, Driving, Prepared, Series};
use kort_identify::identify::{Options, identify};
use kort_identify::noise::Criterion;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;

const TICK_S: f64 = 0.002;
const RIG: &str = r#"
[rig]
name = "air propeller"
[propeller]
radius_m = 0.1016
duct_length_m = 0.03
pitch_rad = 0.28
lift_max = 0.7
drag_max = { value = 0.6, tol = 0.6 }
[flow]
density_kg_m3 = 1.2
flux_coefficient = 2.0
added_mass_coefficient = 1.0
[motor]
inertia_kg_m2 = 6e-5
torque_constant_nm_a = 0.009
winding_resistance_ohm = 0.1
[amplifier]
kind = "voltage"
supply_v = 16.5
[sensors]
log_rate_hz = 125
"#;

/// Telemetry of a drive that does not brake: power and speed, not what was asked for.
fn telemetry(drag_max: f64) -> Series {
    let mut truth = RIG.replace("drag_max = { value = 0.6, tol = 0.6 }", &format!("drag_max = {drag_max}"));
    truth = truth.replace("\"voltage\"", "\"current\"");
    let rig = Rig::from_toml(&truth).unwrap();
    let mut plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], TICK_S);
    let levels = [4.0, 12.0, 7.0, 18.0, 3.0, 14.0];
    let (mut time_s, mut power_w, mut speed) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..6000_u32 {
        let t = f64::from(k) * TICK_S;
        let command = levels[(t / 1.7) as usize % levels.len()];
        let at = *plant.truth();
        if k % 4 == 0 {
            let volt = 0.1 * at.current_a + 0.009 * at.shaft_speed_rad_s;
            time_s.push(t);
            power_w.push(volt * at.current_a);
            speed.push(at.shaft_speed_rad_s);
        }
        plant.step(&Tick { time_s: t, command, ..Tick::default() });
    }
    let columns = vec![("power_w".into(), power_w), ("shaft_speed_rad_s".into(), speed)];
    Series { name: "telemetry".into(), time_s, columns }
}

#[test]
fn the_load_is_found_from_power_and_speed_alone() {
    let rig = Rig::from_toml(RIG).unwrap();
    let series = [telemetry(0.8)];
    let criterion = Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 100.0, timing_s: 0.001 };
    let options = Options {
        model: ModelName::Model2,
        seed: 1,
        starts: 1,
        open_friction: false,
        with: Vec::new(),
        criterion,
    };
    let report = identify(&series, &rig, &options, &|_| ()).unwrap();
    let drag = report.parameters.iter().find(|p| p.name == "drag_max").unwrap().value;
    // How power runs between its samples, 8 ms apart, nobody recorded.
    assert!((drag / 0.8 - 1.0).abs() < 0.06, "{drag}");
    assert!(report.channels["shaft_speed_rad_s"].nrmse_train < 0.02, "{:?}", report.channels);
}

#[test]
fn power_drives_only_where_nothing_better_does() {
    let rig = Rig::from_toml(RIG).unwrap();
    let mut series = telemetry(0.6);
    let driving = |series: &Series| Prepared::new(series, &rig, false).unwrap().driving;
    assert_eq!(driving(&series), Driving::Power);
    // Voltage and current of the supply are a power too.
    let power = series.columns[0].1.clone();
    series.columns[0] = ("supply_current_a".into(), power.iter().map(|p| p / 16.0).collect());
    series.columns.push(("supply_v".into(), vec![16.0; power.len()]));
    assert_eq!(driving(&series), Driving::Power);
    series.columns.push(("thrust_n".into(), series.columns[1].1.iter().map(|s| 1e-5 * s * s).collect()));
    assert_eq!(driving(&series), Driving::Speed);
}

#[test]
fn without_the_windings_resistance_the_way_out_is_named() {
    let text = RIG.replace("winding_resistance_ohm = 0.1\n", "").replace("\"voltage\"", "\"current\"");
    let found = Prepared::new(&telemetry(0.6), &Rig::from_toml(&text).unwrap(), false).unwrap_err();
    assert!(matches!(&found, DataError::NoResponse { .. }));
    assert!(found.to_string().contains("motor.winding_resistance_ohm"), "{found}");
}

#[test]
fn a_command_for_a_drive_of_another_kind_is_named_with_the_kind_that_is_needed() {
    let mut series = telemetry(0.6);
    series.columns[0] = ("speed_cmd_rad_s".into(), series.columns[1].1.clone());
    let found = Prepared::new(&series, &Rig::from_toml(RIG).unwrap(), false).unwrap_err();
    assert!(
        matches!(&found, DataError::OtherDrive { column: "speed_cmd_rad_s", kind: "voltage", .. }),
        "{found}"
    );
    assert!(found.to_string().contains("amplifier.kind"), "{found}");
}
