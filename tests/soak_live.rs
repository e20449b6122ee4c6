//! `kort soak --live`, black box: the same script and the same scores on a running service.

mod common;

use std::path::PathBuf;
use std::process::{Command, Output};

use common::{KORT, Stack};
use serde_json::{Value, json};

fn scenario(stack: &Stack) -> PathBuf {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/whitcomb-yoerger-1999.toml");
    let path = stack.site.folder.path().join("short.toml");
    let text = format!(
        "name = \"short\"\nwhat = \"a test\"\nrig = {rig:?}\nduration_s = 5\nsettle_s = 1\n\
         controllers = [\"velocity_servo\", \"model3_inversion\"]\n\
         [[reference]]\nkind = \"steps\"\nlevels = [0.3, 0.5]\nhold_s = 2.5\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn soak(stack: &Stack) -> Output {
    let url = format!("http://127.0.0.1:{}", stack.site.port);
    let mut command = Command::new(KORT);
    command.arg("soak").arg(scenario(stack)).args(["--json", "--live", &url]);
    command.current_dir(stack.site.folder.path());
    common::run(&mut command)
}

#[test]
fn a_running_service_is_driven_scored_and_given_back() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let run = soak(&stack);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.success(), "{said}");
        let report: Value = serde_json::from_slice(&run.stdout).expect("one JSON document");
        assert_eq!(report["schema"], "kort.soak/1");
        assert_eq!(report["virtual_seconds"], 10.0);
        let laws = report["scenarios"][0]["laws"].as_array().expect("laws");
        let names: Vec<&str> = laws.iter().filter_map(|l| l["name"].as_str()).collect();
        assert_eq!(names, ["velocity_servo", "model3_inversion"]);
        for law in laws {
            let of = |score: &str| law["scores"][score]["mean"].as_f64();
            // A thruster that never turned would be about 75 N off.
            assert!(of("thrust_rms_n").is_some_and(|rms| rms > 0.0 && rms < 60.0), "{law}");
            assert!(of("useful_impulse_n_s").is_some_and(|impulse| impulse > 50.0), "{law}");
            assert!(of("energy_j").is_some_and(|energy| energy > 0.0), "{law}");
        }
        let state = stack.state().expect("the service goes on");
        assert_eq!(state["controller"], "model3_inversion", "{state}");
        assert_eq!((&state["armed"], &state["lease"]), (&json!(false), &Value::Null), "{state}");
    });
}

#[test]
fn a_thruster_in_other_hands_is_left_alone() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(30.0, 60_000);
        let run = soak(&stack);
        assert_eq!(run.status.code(), Some(1));
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(said.contains("lease") && said.contains("test") && said.contains("hint:"), "{said}");
        assert!(run.stdout.is_empty());
        assert_eq!(stack.state().expect("state")["armed"], true);
    });
}
