//! Every panel of every dashboard, asked of a real Prometheus that scrapes a real run; and the alert rules.
//!
//! Needs `prometheus` and `promtool` (Debian package `prometheus`); tests/run.sh installs them.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use common::{KORT, Site, Stack, wait};
use serde_json::Value;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Is the program there? If not the test is left out, and says so.
fn have(program: &str) -> bool {
    let there =
        Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !there {
        println!("not run: {program} is not installed");
    }
    there
}

fn promtool(arguments: &[&str]) {
    let done = Command::new("promtool")
        .args(arguments)
        .current_dir(repository().join("docker/prometheus"))
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "promtool {arguments:?}: {words}");
}

fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn get(url: &str) -> Option<String> {
    let agent: ureq::Agent = ureq::Agent::config_builder()
        .http_status_as_error(false)
        .timeout_global(Some(Duration::from_secs(10)))
        .build()
        .into();
    agent.get(url).call().ok()?.body_mut().read_to_string().ok()
}

/// A process that ends with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A Prometheus with the shipped configuration, its targets turned to where the test's programs are.
fn prometheus(folder: &Path, gateway: u16, soak: u16) -> (Ends, u16) {
    let shipped = std::fs::read_to_string(repository().join("docker/prometheus/prometheus.yml")).unwrap();
    let config = shipped
        .replace("127.0.0.1:8080", &format!("127.0.0.1:{gateway}"))
        .replace("127.0.0.1:9464", &format!("127.0.0.1:{soak}"));
    assert_eq!(
        config.matches("targets: [\"127.0.0.1").count(),
        2,
        "both targets stand in the shipped configuration"
    );
    std::fs::write(folder.join("prometheus.yml"), config).unwrap();
    std::fs::copy(repository().join("docker/prometheus/alerts.yml"), folder.join("alerts.yml")).unwrap();
    let port = free_port();
    let child = Command::new("prometheus")
        .arg(format!("--config.file={}", folder.join("prometheus.yml").display()))
        .arg(format!("--storage.tsdb.path={}", folder.join("data").display()))
        .arg(format!("--web.listen-address=127.0.0.1:{port}"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    (Ends(child), port)
}

fn ask(port: u16, query: &str) -> Value {
    let encoded: String = query.bytes().map(|b| format!("%{b:02x}")).collect();
    // It may still be starting.
    let url = format!("http://127.0.0.1:{port}/api/v1/query?query={encoded}");
    wait("Prometheus", || serde_json::from_str(&get(&url)?).ok())
}

/// The one number that a query gives.
fn number(port: u16, query: &str) -> f64 {
    let found = ask(port, query);
    let value = found["data"]["result"][0]["value"][1].as_str();
    value.unwrap_or_else(|| panic!("{query}: {found}")).parse().unwrap()
}

fn dashboards() -> Vec<(PathBuf, Value)> {
    let folder = repository().join("docker/grafana/dashboards");
    let mut found: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.clone(), serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap()))
        .collect();
    found.sort_by(|a: &(PathBuf, Value), b| a.0.cmp(&b.0));
    found
}

/// Title and query of every target, with Grafana's variables filled in.
fn queries(dashboard: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for panel in dashboard["panels"].as_array().unwrap() {
        for target in panel["targets"].as_array().into_iter().flatten() {
            let query = target["expr"]
                .as_str()
                .unwrap()
                .replace("$thruster", "t1")
                .replace("$scenario", ".*")
                .replace("$law", ".*")
                .replace("$__rate_interval", "10s");
            assert!(!query.contains('$'), "a variable is left in {query}");
            found.push((panel["title"].as_str().unwrap().to_owned(), query));
        }
    }
    found
}

/// A query that gives nothing names a metric that nobody exports.
fn assert_all_answered(port: u16, dashboard: &Value, name: &str) {
    for (title, query) in queries(dashboard) {
        let mut last = Value::Null;
        let samples = wait(&format!("{name}, panel \"{title}\": {query}"), || {
            last = ask(port, &query);
            assert_eq!(last["status"], "success", "{name}, panel \"{title}\": {query}: {last}");
            let samples = last["data"]["result"].as_array()?.clone();
            (!samples.is_empty()).then_some(samples)
        });
        for sample in &samples {
            assert!(sample["value"][1].as_str().unwrap().parse::<f64>().is_ok(), "{title}: {sample}");
        }
    }
}

/// Each rule is seen to fire by a test of its own, so that none is shipped with a metric's name wrong.
#[test]
fn every_alert_has_a_test_in_which_it_fires() {
    let read = |name: &str| {
        std::fs::read_to_string(repository().join("docker/prometheus").join(name)).expect("it is shipped")
    };
    let (rules, tests) = (read("alerts.yml"), read("alerts_test.yml"));
    let alerts: Vec<&str> = rules.lines().filter_map(|line| line.trim().strip_prefix("- alert: ")).collect();
    assert!(alerts.len() > 10, "{alerts:?}");
    for alert in alerts {
        let fires = format!("alertname: {alert}\n        exp_alerts:\n");
        assert!(tests.contains(&fires), "{alert}: no test fires it");
    }
}

#[test]
fn configuration_and_alert_rules_hold() {
    if !have("promtool") {
        return;
    }
    promtool(&["check", "config", "prometheus.yml"]);
    promtool(&["check", "rules", "alerts.yml"]);
    promtool(&["test", "rules", "alerts_test.yml"]);
}

/// Two thrusters, one of them with dry friction that its rig description does not know.
fn rubbing_beside_another() -> Stack {
    let site = Site::new();
    let effect = "id = \"coulomb_friction\", coulomb_torque_n_m = 1.2, stribeck_rise = 0.3, stribeck_speed_rad_s = 2.0";
    site.add("limits = { full_drive_s = 0.005 }", &format!("simulation = {{ effects = [{{ {effect} }}] }}"));
    Stack::start_at(site.with_t2())
}

#[test]
fn every_dashboard_of_the_service_is_answered_from_a_live_run() {
    common::in_real_time(|| {
        if !have("prometheus") {
            return;
        }
        let mut stack = rubbing_beside_another();
        let folder = tempfile::tempdir().unwrap();
        let (_prometheus, port) = prometheus(folder.path(), stack.site.port, free_port());
        stack.thrust(60.0, 60_000);

        let metrics = get(&format!("http://127.0.0.1:{}/metrics", stack.site.port)).unwrap();
        let mut check = Command::new("promtool")
            .args(["check", "metrics"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        std::io::Write::write_all(&mut check.stdin.take().unwrap(), metrics.as_bytes()).unwrap();
        let done = check.wait_with_output().unwrap();
        assert!(done.status.success(), "promtool check metrics: {}", String::from_utf8_lossy(&done.stdout));
        for line in metrics.lines().filter(|line| !line.starts_with('#')) {
            assert!(line.starts_with("kort_"), "{line}");
        }
        for signal in kort_proto::signals::SIGNALS
            .iter()
            .map(|row| row.metric)
            .filter(|m| m.contains("current") || m.contains("thrust"))
        {
            for stat in ["", "_min", "_max"] {
                let wanted = format!("kort_{signal}{stat}{{thruster=\"t1\"}}");
                wait(&wanted, || {
                    get(&format!("http://127.0.0.1:{}/metrics", stack.site.port))?
                        .contains(&wanted)
                        .then_some(())
                });
            }
        }

        for (path, dashboard) in dashboards().into_iter().filter(|(path, _)| !path.ends_with("soak.json")) {
            assert_all_answered(port, &dashboard, &path.display().to_string());
        }
        // It rubs from the start: that is no change, and no agreement either.
        let torque = number(port, r#"kort_mismatch_residual_ratio{thruster="t1",residual="torque"}"#);
        assert!(torque > 0.05, "the torque that its rig does not know: {torque}");
        assert_eq!(number(port, r#"sum(kort_mismatch_alarm{thruster="t1"})"#), 0.0);
        let value = number(port, r#"kort_thrust_newtons{thruster="t1"}"#);
        assert!((value - 60.0).abs() < 12.0, "Prometheus shows the thrust that is there: {value}");
        assert_eq!(
            ask(port, "ALERTS{alertstate=\"firing\",severity=\"critical\"}")["data"]["result"],
            serde_json::json!([])
        );
        assert_eq!(number(port, "count(kort_armed)"), 2.0, "the fleet has both thrusters");
        assert_eq!(number(port, "sum(kort_armed)"), 1.0, "and one of them is armed");
    });
}

#[test]
fn the_soak_dashboard_is_answered_while_a_soak_runs() {
    if !have("prometheus") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let soak_port = free_port();
    let scenario = repository().join("config/scenarios/soak-mixed-24h.toml");
    let log = std::fs::File::create(folder.path().join("log")).unwrap();
    let soak = Command::new(KORT)
        .arg("soak")
        .arg(scenario)
        .args([
            "--controllers",
            "velocity_servo,static_map",
            "--metrics-addr",
            &format!("127.0.0.1:{soak_port}"),
        ])
        .current_dir(repository())
        .stdout(Stdio::null())
        .stderr(log)
        .spawn()
        .unwrap();
    let _soak = Ends(soak);
    let (_prometheus, port) = prometheus(folder.path(), free_port(), soak_port);
    wait("the soak's metrics", || {
        get(&format!("http://127.0.0.1:{soak_port}/metrics")).filter(|text| text.contains("kort_soak_"))
    });
    let (path, dashboard) = dashboards().into_iter().find(|(path, _)| path.ends_with("soak.json")).unwrap();
    assert_all_answered(port, &dashboard, &path.display().to_string());
}

#[test]
fn dashboards_are_of_one_piece() {
    let all = dashboards();
    let names: Vec<_> = all.iter().map(|(path, _)| path.file_stem().unwrap().to_string_lossy()).collect();
    assert_eq!(names, ["fleet", "loop-health", "mismatch", "operation", "soak"]);
    for (path, dashboard) in all {
        let name = path.display();
        let panels: Vec<&Value> = dashboard["panels"].as_array().unwrap().iter().collect();
        let mut ids: Vec<u64> = panels.iter().map(|panel| panel["id"].as_u64().unwrap()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), panels.len(), "{name}: panels share an id");
        for panel in panels.iter().filter(|panel| panel["type"] != "row") {
            let title = panel["title"].as_str().unwrap();
            assert!(
                panel["description"].as_str().is_some_and(|words| !words.is_empty()),
                "{name}: \"{title}\" is not described"
            );
            assert_eq!(
                panel["datasource"]["uid"], "prometheus",
                "{name}: \"{title}\" names the provisioned source"
            );
            let place = &panel["gridPos"];
            assert!(
                place["x"].as_u64().unwrap() + place["w"].as_u64().unwrap() <= 24,
                "{name}: \"{title}\" is too wide"
            );
        }
    }
}
