//! `kort soak`, black box: short scenarios, the same bytes each time, errors that help.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn kort(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kort"))
        .args(args)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("kort runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A short scenario on the paper's stand, with `more` lines at its end.
fn scenario(folder: &Path, more: &str) -> PathBuf {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/thrusters/whitcomb-yoerger-1999.toml");
    let path = folder.join("short.toml");
    let text = format!(
        "name = \"short\"\nwhat = \"a test\"\nrig = {rig:?}\nduration_s = 12\nsettle_s = 1\nseeds = 2\n\
         controllers = [\"velocity_servo\", \"model2_inversion\"]\n\
         [[reference]]\nkind = \"steps\"\nlevels = [0.3, 0.6, -0.3]\nhold_s = 2\n{more}"
    );
    std::fs::write(&path, text).expect("scenario written");
    path
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_the_jobs() {
    let folder = tempfile::tempdir().expect("folder");
    let file = scenario(folder.path(), "[ambient]\nwander_std_m_s = 0.2\nwander_time_s = 5\n");
    let file = file.to_str().expect("utf-8");
    let one = kort(&["soak", file, "--json", "--jobs", "1"]);
    let two = kort(&["soak", file, "--json", "--jobs", "2"]);
    assert!(one.status.success(), "{}", text(&one.stderr));
    assert_eq!(one.stdout, two.stdout);
    let other = kort(&["soak", file, "--json", "--seed", "7"]);
    assert_ne!(one.stdout, other.stdout, "another seed, another sea");

    let report: Value = serde_json::from_slice(&one.stdout).expect("one JSON document");
    assert_eq!(report["schema"], "kort.soak/1");
    assert_eq!(report["virtual_seconds"], 48.0);
    let laws = report["scenarios"][0]["laws"].as_array().expect("laws");
    assert_eq!(laws.len(), 2);
    for law in laws {
        let rms = &law["scores"]["thrust_rms_n"];
        let (low, high) = (rms["ci95"][0].as_f64(), rms["ci95"][1].as_f64());
        assert!(low <= rms["mean"].as_f64() && rms["mean"].as_f64() <= high, "{law}");
        assert_eq!(law["scores"]["limits_broken"]["mean"], 0.0, "{law}");
    }
    assert!(report["scenarios"][0]["verdict"].as_str().is_some_and(|v| v.contains("least thrust error")));
}

#[test]
fn a_dead_controller_is_survived_and_a_page_is_written() {
    let folder = tempfile::tempdir().expect("folder");
    let fault = "[[process_fault]]\nkind = \"controller_restart\"\nat_s = 4\nfor_s = 0.2\n";
    let file = scenario(folder.path(), fault);
    let page = folder.path().join("soak.html");
    let run =
        kort(&["soak", file.to_str().expect("utf-8"), "--json", "--html", page.to_str().expect("utf-8")]);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    for law in report["scenarios"][0]["laws"].as_array().expect("laws") {
        assert_eq!(law["scores"]["faults_injected"]["mean"], 1.0, "{law}");
        assert_eq!(law["scores"]["faults_survived"]["mean"], 1.0, "{law}");
        assert_eq!(law["scores"]["trips"]["mean"], 1.0, "{law}");
    }
    let html = std::fs::read_to_string(page).expect("page");
    assert!(html.contains("<svg") && html.contains("model2_inversion"));
}

#[test]
fn wrong_input_is_named() {
    let folder = tempfile::tempdir().expect("folder");
    let good = scenario(folder.path(), "");
    let good = good.to_str().expect("utf-8");
    let run = kort(&["soak", good, "--controllers", "velocity_srevo"]);
    assert_eq!(run.status.code(), Some(2));
    let said = text(&run.stderr);
    assert!(
        said.contains("velocity_srevo") && said.contains("velocity_servo") && said.contains("hint:"),
        "{said}"
    );

    let bad = scenario(folder.path(), "[[effect]]\nid = \"couloumb\"\n");
    let run = kort(&["soak", bad.to_str().expect("utf-8")]);
    let said = text(&run.stderr);
    assert_eq!(run.status.code(), Some(2));
    assert!(
        said.contains("short.toml") && said.contains("couloumb") && said.contains("coulomb_friction"),
        "{said}"
    );
    assert_eq!(kort(&["soak"]).status.code(), Some(2));
    assert_eq!(kort(&["soak", "no-such-file.toml"]).status.code(), Some(2));
}
