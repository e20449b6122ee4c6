//! The engine under a chain of the least kind: a controller whose command acts one tick later.

use kort_control::{Controller, ControllerConfig, LawKind, Measurement, ModelError, Output, Reference};
use kort_proto::signals::Signals;
use kort_soak::{Chain, Driven, Knows, Outcome, Prepared, Scenario, run};
use kort_thruster::rig::{AmplifierKind, Rig};

const STAND: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

/// Controller alone: always armed.
struct Direct {
    rig: Rig,
    controller: Controller,
    output: Output,
    period_s: f64,
    command: f64,
}

impl Chain for Direct {
    fn start(rig: &Rig, config: &ControllerConfig, period_s: f64) -> Result<Self, ModelError> {
        let controller = Controller::new(rig, config, period_s)?;
        Ok(Self { rig: rig.clone(), controller, output: Output::default(), period_s, command: 0.0 })
    }

    fn tick(&mut self, measured: &Signals, thrust_n: f64, alive: bool) -> Driven {
        let driven = Driven { command: self.command, armed: true };
        if alive {
            let known = |x: f64| (!x.is_nan()).then_some(x);
            let measured = Measurement {
                shaft_speed_rad_s: known(measured.shaft_speed_rad_s),
                current_a: known(measured.current_a),
                thrust_n: known(measured.thrust_n),
                flow_m_s: known(measured.flow_m_s),
                ambient_m_s: known(measured.ambient_m_s),
                supply_v: known(measured.supply_v),
                shaft_angle_rad: known(measured.shaft_angle_rad),
            };
            self.output = self.controller.tick(&measured, Reference::Thrust(thrust_n), self.period_s);
            let told = self.output.command;
            self.command = match self.rig.amplifier.kind {
                AmplifierKind::Current => told.current_a,
                AmplifierKind::Voltage => told.voltage_v.unwrap_or(0.0),
                AmplifierKind::Speed => told.speed_rad_s.unwrap_or(0.0),
            };
        }
        driven
    }

    fn restart(&mut self) {
        if let Ok(fresh) = Self::start(&self.rig, &self.controller.config().clone(), self.period_s) {
            *self = fresh;
        }
    }

    fn controller(&self) -> &Controller {
        &self.controller
    }

    fn output(&self) -> &Output {
        &self.output
    }

    fn trips(&self) -> u32 {
        0
    }
}

fn soak(scenario: &str, law: LawKind, seed: u64, knows: Knows) -> Outcome {
    let scenario = Scenario::from_toml(scenario).unwrap();
    let rig = Rig::from_toml(STAND).unwrap();
    let prepared = Prepared {
        scenario: &scenario,
        rig: &rig,
        effects: &[],
        replayed: &vec![None; scenario.references.len()],
        thrust_max_n: 170.0,
    };
    let config =
        ControllerConfig { observer: kort_control::ObserverKind::Ekf, ..ControllerConfig::with_law(law) };
    run::<Direct>(&prepared, &config, seed, knows, &|_, _, _| {}).unwrap()
}

const STEPS: &str = r#"
name = "steps"
what = "steps"
rig = "not read here"
duration_s = 12
settle_s = 1
controllers = ["velocity_servo"]
[truth]
factors = { lift_max = 0.8 }
[[reference]]
kind = "steps"
hold_s = 2
ramp_s = 0.3
levels = [0.3, 0.5, -0.3]
"#;

#[test]
fn the_same_seed_gives_the_same_scores() {
    let of = |seed| soak(STEPS, LawKind::ThrustPi, seed, Knows::Stated).scores["thrust_rms_n"];
    assert_eq!(of(3), of(3));
    assert_ne!(of(3), of(4), "noise is drawn from the seed");
}

#[test]
fn a_law_told_the_truth_does_better() {
    let of = |knows| soak(STEPS, LawKind::VelocityServo, 1, knows).scores["thrust_rms_n"];
    assert!(of(Knows::Truth) < 0.9 * of(Knows::Stated), "{} {}", of(Knows::Truth), of(Knows::Stated));
}

/// Told everything, it knows what comes: a loop on what is now would swing about a dead time. Of a ramp a law may leave a
/// little less, which leads the reference by more than the shaft needs.
#[test]
fn a_late_drive_does_not_make_the_law_that_is_told_everything_swing() {
    for (late, of_law) in [
        ("effect = \"transport_delay\"\ndelay_s = 0.05\n", 1.2),
        ("effect = \"amplifier_lag\"\ncommand_lag_s = 0.03\n", 0.9),
    ] {
        let scenario = Scenario::from_toml(STEPS).unwrap();
        let rig = Rig::from_toml(&format!("{STAND}\n[[effects]]\n{late}")).unwrap();
        let prepared = Prepared {
            scenario: &scenario,
            rig: &rig,
            effects: &[],
            replayed: &vec![None; scenario.references.len()],
            thrust_max_n: 170.0,
        };
        let error = |outcome: Outcome| outcome.scores["thrust_rms_n"];
        let config = ControllerConfig::with_law(LawKind::Model2Inversion);
        let law = run::<Direct>(&prepared, &config, 1, Knows::Truth, &|_, _, _| {}).unwrap();
        let left = kort_soak::limits::limits(&prepared, 1, &|_, _, _| {}).unwrap();
        let (law, left) = (error(law), error(left));
        assert!(left < of_law * law, "{late}: {left} beside a law's {law}");
    }
}

#[test]
fn a_controller_that_stops_is_counted_as_a_fault() {
    let fault = "[[process_fault]]\nkind = \"controller_restart\"\nat_s = 4\nfor_s = 0.3\n";
    let outcome = soak(&format!("{STEPS}{fault}"), LawKind::VelocityServo, 1, Knows::Stated);
    assert_eq!((outcome.scores["faults_injected"], outcome.scores["faults_survived"]), (1.0, 1.0));
}

#[test]
fn a_sensor_that_lies_makes_thrust_worse_for_the_law_that_believes_it() {
    let fault = "[[sensor_fault]]\nchannel = \"thrust_n\"\nlie = \"bias\"\nsize = 0.2\nat_s = 2\nfor_s = 9\n";
    let of = |text: &str| soak(text, LawKind::ThrustPi, 1, Knows::Stated).scores["thrust_rms_n"];
    assert!(of(&format!("{STEPS}{fault}")) > 1.3 * of(STEPS));
}

#[test]
fn a_scenario_with_an_impossible_value_says_what_is_allowed() {
    let said =
        Scenario::from_toml(&STEPS.replace("duration_s = 12", "duration_s = -1")).unwrap_err().join("\n");
    assert!(said.contains("duration_s") && said.contains("1 to") && said.contains("hint:"), "{said}");
}
