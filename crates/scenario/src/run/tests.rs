use kort_thruster::effects;

use super::*;
use crate::{EffectUse, NoReplays, Segment};

fn rig() -> Rig {
    Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap()
}

fn scenario(segments: Vec<Segment>) -> Scenario {
    Scenario { model: ModelName::Model2, noise: 0.0, seed: 1, segments, ..Scenario::default() }
}

fn rows(scenario: &Scenario, rig: &Rig) -> (Vec<&'static str>, Vec<(f64, Vec<f64>)>) {
    let mut run = Run::new(scenario, rig, &mut NoReplays).unwrap();
    let columns = run.columns().to_vec();
    let (mut all, mut row) = (Vec::new(), Vec::new());
    while let Some(time_s) = run.next_row(&mut row) {
        all.push((time_s, row.clone()));
    }
    assert_eq!(all.len() as u64, run.rows());
    (columns, all)
}

#[test]
fn a_torque_step_ends_in_the_steady_state() {
    let s = scenario(vec![
        Segment::Hold { value: 0.0, duration_s: 1.0 },
        Segment::Hold { value: 9.2, duration_s: 9.0 },
    ]);
    let s = Scenario { command: Command::TorqueCmdNM, ..s };
    let rig = rig();
    let (columns, rows) = rows(&s, &rig);
    assert_eq!(rows.len(), 1001);
    let at = |name: &str| columns.iter().position(|c| *c == name).unwrap();
    // Commands change on a tick: the row at 1 s shows the new one and the state before it.
    assert_eq!(rows[99].1[at("current_cmd_a")], 0.0);
    assert!((rows[100].1[at("current_cmd_a")] - 9.2 / 1.23).abs() < 1e-12);
    assert_eq!(rows[100].1[at("shaft_speed_rad_s")], 0.0);
    let (ct, cq) = Parameters::stated(&rig).bollard_coefficients();
    let speed = (9.2 / cq).sqrt();
    let last = &rows[1000].1;
    assert!((last[at("shaft_speed_rad_s")] / speed - 1.0).abs() < 0.01);
    assert!((last[at("thrust_n")] / (ct * speed * speed) - 1.0).abs() < 0.01);
    assert_eq!(rows.iter().filter(|r| !r.1[at("flow_m_s")].is_nan()).count(), 201, "20 Hz flow meter");
}

#[test]
fn the_same_seed_gives_the_same_rows_and_noise_can_be_off() {
    let rig = rig();
    let prbs = Segment::Prbs { amplitude: 0.5, mean: 0.0, each_s: 0.2, order: 7, duration_s: 5.0 };
    let noisy = Scenario { noise: 1.0, ..scenario(vec![prbs]) };
    let bits = |s: &Scenario| {
        rows(s, &rig).1.iter().flat_map(|r| r.1.iter().map(|v| v.to_bits())).collect::<Vec<_>>()
    };
    assert_eq!(bits(&noisy), bits(&noisy));
    assert_ne!(bits(&noisy), bits(&Scenario { seed: 2, ..noisy.clone() }));
    assert_ne!(bits(&noisy), bits(&Scenario { noise: 0.0, ..noisy }));
}

#[test]
fn a_thrust_command_gives_that_thrust_on_every_drive() {
    let text = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");
    for kind in ["current", "voltage", "speed"] {
        let text = text
            .replace("kind = \"current\"", &format!("kind = \"{kind}\""))
            .replace("[amplifier]", "winding_resistance_ohm = 2.2\n[amplifier]");
        let rig = Rig::from_toml(&text).unwrap();
        let s = Scenario {
            command: Command::ThrustCmdN,
            ..scenario(vec![Segment::Hold { value: -80.0, duration_s: 8.0 }])
        };
        let (columns, rows) = rows(&s, &rig);
        let thrust = columns.iter().position(|c| *c == "thrust_n").unwrap();
        let last = rows[rows.len() - 1].1[thrust];
        assert!((last + 80.0).abs() < 1.5, "{kind}: {last}");
    }
}

#[test]
fn every_effect_runs_at_its_usual_size() {
    let rig = rig();
    for descriptor in effects::ALL {
        let mut s = scenario(vec![Segment::Reversals { amplitude: 0.6, each_s: 0.5, count: 2 }]);
        s.effects = vec![EffectUse { effect: descriptor.id.into(), parameters: Default::default() }];
        let drive = DriveMap::new(Command::Share, &rig, &Parameters::stated(&rig)).unwrap();
        let scale = scale(&rig, &Parameters::stated(&rig), drive.to_drive(0.6), 0.002, 1.5);
        for spec in (descriptor.parameters)(&scale) {
            s.effects[0].parameters.insert(spec.name.into(), spec.start);
        }
        let (_, rows) = rows(&s, &rig);
        let speed = rows.iter().flat_map(|r| &r.1).filter(|v| v.is_infinite()).count();
        assert_eq!(speed, 0, "{}", descriptor.id);
    }
}

#[test]
fn a_dry_drive_has_the_torque_that_brings_it_to_speed() {
    for (drive, torque_n_m) in
        [("voltage", 0.5 * 12.0 / 2.0), ("current", 0.5 * 12.0), ("speed", 0.01 * 12.0 / 0.1)]
    {
        let text = format!(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.5\n\
             winding_resistance_ohm = 2.0\n[amplifier]\nkind = \"{drive}\"\n"
        );
        let rig = Rig::from_toml(&text).unwrap();
        let scale = scale(&rig, &Parameters::stated(&rig), 12.0, 0.002, 1.5);
        assert!((scale.torque_n_m - torque_n_m).abs() < 1e-9, "{drive}: {}", scale.torque_n_m);
    }
}

#[test]
fn errors_name_the_key() {
    let rig = rig();
    let error = |s: &Scenario| Run::new(s, &rig, &mut NoReplays).err().unwrap()[0].to_string();
    let hold = vec![Segment::Hold { value: 0.5, duration_s: 1.0 }];
    let one = |effect: &str, pairs: &[(&str, f64)]| Scenario {
        effects: vec![EffectUse {
            effect: effect.into(),
            parameters: pairs.iter().map(|(k, v)| ((*k).to_string(), *v)).collect(),
        }],
        ..scenario(hold.clone())
    };
    assert!(error(&one("coulomb_frictoin", &[])).contains("did you mean `coulomb_friction`"));
    assert!(
        error(&one("rotational_flow", &[])).contains("`effects[0].parameters.swirl_yield`, `"),
        "all of them"
    );
    assert!(error(&one("rotational_flow", &[("swirl_yield", 99.0)])).contains("0 to 3"));
    assert!(error(&one("rotational_flow", &[("yield", 0.1)])).contains("swirl_yield"));
    let duty = Scenario { command: Command::DutyCmd, ..scenario(hold.clone()) };
    assert!(error(&duty).contains("hint:"));
    assert!(error(&Scenario { noise: -1.0, ..scenario(hold.clone()) }).contains("noise"));
    assert!(error(&scenario(Vec::new())).contains("segments"));
    let long = Scenario { duration_s: Some(1e9), ..scenario(hold) };
    assert!(error(&long).contains("86400"));
}

#[test]
fn a_scenario_survives_toml_and_json() {
    let text = r#"
        name = "two"
        model = "rotational_flow"
        command = "torque_cmd_n_m"
        noise = 0
        ambient = [{ kind = "ramp", from = 0, to = 1, duration_s = 3 }]
        [turbulence]
        sigma_m_s = 0.02
        time_constant_s = 1
        [parameters]
        inertia_kg_m2 = 0.011
        [[segments]]
        kind = "steps"
        values = [1, 2]
        each_s = 1.5
        [[effects]]
        effect = "coulomb_friction"
        parameters = { coulomb_torque_n_m = 0.1 }
    "#;
    let s = Scenario::from_toml(text).unwrap();
    assert_eq!(Scenario::from_toml(&toml::to_string(&s).unwrap()).unwrap(), s);
    assert!(Scenario::from_toml("segmants = []").unwrap_err().to_string().contains("segmants"));
    assert!(
        Scenario::from_toml("[[segments]]\nkind = \"stairs\"").unwrap_err().to_string().contains("staircase")
    );
}
