//! The lab's commands from outside: runs, recordings to run them on, and the diagnosis report's
//! contract.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

pub const STAND: &str = "whitcomb-yoerger-1999";

pub fn kort(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kort"))
        .args(args)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    serde_json::from_slice(&output.stdout).expect("exactly one JSON document on stdout")
}

/// A folder for all tests of this program; recordings in it are made once.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| tempfile::tempdir().unwrap()).path()
}

pub fn path(name: &str) -> String {
    folder().join(name).to_str().unwrap().to_string()
}

pub fn write(name: &str, text: impl AsRef<[u8]>) -> String {
    std::fs::write(folder().join(name), text).unwrap();
    path(name)
}

/// Twelve seconds of random levels between shares of the drive's limit, after half a second at rest.
pub fn random_levels(low: f64, high: f64, more: &str) -> String {
    format!(
        "command = \"share\"\n{more}\n[[segments]]\nkind = \"hold\"\nvalue = 0\nduration_s = 0.5\n\
         [[segments]]\nkind = \"random_levels\"\nlow = {low}\nhigh = {high}\nshortest_s = 0.3\nlongest_s = 1.2\nduration_s = 12\n"
    )
}

/// An effect with its parameters, for the end of a scenario.
pub fn effect(id: &str, parameters: &str) -> String {
    format!("[[effects]]\neffect = \"{id}\"\nparameters = {{ {parameters} }}\n")
}

/// Simulates a scenario into `name`.
pub fn simulate(name: &str, rig: &str, scenario: &str) -> String {
    let file = write(&format!("{name}.toml"), scenario);
    let out = path(name);
    let output = kort(&["simulate", "--rig", rig, "--scenario", &file, "-o", &out]);
    assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
    out
}

/// The paper's stand with nothing hidden.
pub fn clean() -> &'static str {
    static MADE: OnceLock<String> = OnceLock::new();
    MADE.get_or_init(|| simulate("clean.csv", STAND, &random_levels(-0.95, 0.95, "")))
}

/// The paper's stand with swirl.
pub fn swirl() -> &'static str {
    static MADE: OnceLock<String> = OnceLock::new();
    MADE.get_or_init(|| {
        let hidden = effect("rotational_flow", "swirl_yield = 0.15, swirl_lag_ratio = 0.1");
        simulate("swirl.csv", STAND, &(random_levels(-0.95, 0.95, "") + &hidden))
    })
}

/// A CSV file as header and rows of cells.
pub struct Table {
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn read(path: &str) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(String::from).collect::<Vec<_>>());
        Self { header: lines.next().unwrap(), rows: lines.collect() }
    }

    pub fn keep(mut self, columns: &[&str]) -> Self {
        let at: Vec<usize> = columns.iter().map(|c| self.at(c)).collect();
        for row in self.rows.iter_mut().chain([&mut self.header]) {
            *row = at.iter().map(|i| row[*i].clone()).collect();
        }
        self
    }

    pub fn at(&self, column: &str) -> usize {
        self.header.iter().position(|c| c == column).unwrap_or_else(|| panic!("{column}: no such column"))
    }

    /// Rewrites the cells of a column; the row's number and the cell are given.
    pub fn map(mut self, column: &str, change: impl Fn(usize, &str) -> String) -> Self {
        let at = self.at(column);
        self.rows.iter_mut().enumerate().for_each(|(k, row)| row[at] = change(k, &row[at]));
        self
    }

    pub fn save(&self, name: &str) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows).map(|row| row.join(",") + "\n");
        write(name, lines.collect::<String>())
    }
}

/// A dry shaft on a current drive.
pub fn dry_rig() -> &'static str {
    static MADE: OnceLock<String> = OnceLock::new();
    MADE.get_or_init(|| {
        let text = "[rig]\nname = \"dry shaft\"\n[propeller]\nkind = \"none\"\n\
            [motor]\ninertia_kg_m2 = { value = 0.01, tol = 0.2 }\ntorque_constant_nm_a = { value = 1.2, tol = 0.05 }\n\
            viscous_friction_nm_s = { value = 0.05, tol = 0.3 }\n\
            [amplifier]\nkind = \"current\"\ntime_constant_s = 0.002\ncurrent_limit_a = 9.0\nsupply_v = 120.0\n\
            [sensors]\nlog_rate_hz = 100.0\ncontrol_rate_hz = 500.0\nencoder_counts_per_rev = 4096\n\
            speed_filter_time_constant_s = 0.01\n";
        write("dry.rig.toml", text)
    })
}

/// One of the example cases shipped with the tests: recording and rig.
pub fn example(name: &str) -> [PathBuf; 2] {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/example-cases");
    [folder.join(format!("{name}.csv.gz")), folder.join(format!("{name}.rig.toml"))]
}

/// The keys of an object, at least these.
fn keys<'a>(at: &str, value: &'a Value, wanted: &[&str]) -> &'a serde_json::Map<String, Value> {
    let object = value.as_object().unwrap_or_else(|| panic!("{at} is no object: {value}"));
    for key in wanted {
        assert!(object.contains_key(*key), "{at}.{key} is missing in {value}");
    }
    object
}

fn number(at: &str, value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{at} is no number: {value}"))
}

fn words<'a>(at: &str, value: &'a Value) -> &'a str {
    let text = value.as_str().unwrap_or_else(|| panic!("{at} is no text: {value}"));
    assert!(!text.trim().is_empty(), "{at} is empty");
    text
}

fn list<'a>(at: &str, value: &'a Value) -> &'a [Value] {
    value.as_array().unwrap_or_else(|| panic!("{at} is no list: {value}"))
}

fn share(at: &str, value: &Value) {
    let x = number(at, value);
    assert!((0.0..=1.0).contains(&x), "{at} = {x} is no share");
}

/// `parameters` of the baseline or of a fit.
pub fn check_parameters(at: &str, value: &Value) {
    for one in list(at, value) {
        keys(at, one, &["name", "value", "unit", "std_error", "stated", "at_bound"]);
        check_parameter(at, one);
        assert!(one["stated"].is_null() || one["stated"].is_number(), "{at}.stated: {one}");
        assert!(one["at_bound"].is_boolean(), "{at}.at_bound: {one}");
    }
}

fn check_parameter(at: &str, one: &Value) {
    keys(at, one, &["name", "value", "unit", "std_error"]);
    words(at, &one["name"]);
    words(at, &one["unit"]);
    number(&format!("{at}.value of {one}"), &one["value"]);
    assert!(number(&format!("{at}.std_error of {one}"), &one["std_error"]) >= 0.0, "{at}: {one}");
}

/// `channels` of the baseline or of a fit.
pub fn check_channels(at: &str, value: &Value) {
    let channels = keys(at, value, &[]);
    assert!(!channels.is_empty(), "{at} is empty");
    for (name, one) in channels {
        let at = format!("{at}.{name}");
        keys(&at, one, &["nrmse_train", "nrmse_heldout", "noise_floor", "white"]);
        for key in ["nrmse_train", "nrmse_heldout", "noise_floor"] {
            assert!(number(&format!("{at}.{key}"), &one[key]) >= 0.0, "{at}: {one}");
        }
        assert!(one["white"].is_boolean(), "{at}: {one}");
    }
}

fn check_heldout(at: &str, value: &Value) {
    keys(at, value, &["channels", "excess_error_removed", "interval_95"]);
    for (name, one) in keys(at, &value["channels"], &[]) {
        for key in ["nrmse_before", "nrmse_after"] {
            assert!(number(&format!("{at}.{name}.{key}"), &one[key]) >= 0.0);
        }
    }
    let removed = number(at, &value["excess_error_removed"]);
    assert!(removed <= 1.0, "{at}: {removed}");
    let interval: Vec<f64> = list(at, &value["interval_95"]).iter().map(|v| number(at, v)).collect();
    assert!(interval.len() == 2 && interval[0] <= interval[1], "{at}: {interval:?}");
}

/// The whole report against shared/contracts.md, and what its verdict promises.
pub fn check_diagnosis(report: &Value) {
    keys(
        "report",
        report,
        &[
            "schema",
            "kort_version",
            "recordings",
            "rig",
            "seed",
            "seconds",
            "verdict",
            "summary",
            "baseline",
            "mismatch",
            "findings",
            "explanations",
            "remainder",
            "alternatives",
            "empirical_term",
            "next_experiment",
        ],
    );
    assert_eq!(report["schema"], "kort.diagnosis/2");
    words("kort_version", &report["kort_version"]);
    assert!(!list("recordings", &report["recordings"]).is_empty());
    list("recordings", &report["recordings"]).iter().for_each(|r| {
        words("recordings", r);
    });
    words("rig", &report["rig"]);
    assert!(report["seed"].is_u64());
    assert!(number("seconds", &report["seconds"]) > 0.0);
    words("summary", &report["summary"]);

    let baseline = &report["baseline"];
    keys("baseline", baseline, &["model", "parameters", "channels"]);
    words("baseline.model", &baseline["model"]);
    check_parameters("baseline.parameters", &baseline["parameters"]);
    check_channels("baseline.channels", &baseline["channels"]);

    let mismatch = list("mismatch", &report["mismatch"]);
    for one in mismatch {
        keys(
            "mismatch",
            one,
            &["path", "channel", "regime", "time_s", "significance_sigma", "share_of_excess_error"],
        );
        check_path(&one["path"]);
        words("mismatch.channel", &one["channel"]);
        words("mismatch.regime", &one["regime"]);
        for span in list("mismatch.time_s", &one["time_s"]) {
            let ends: Vec<f64> = list("span", span).iter().map(|v| number("span", v)).collect();
            assert!(ends.len() == 2 && ends[0] <= ends[1], "{span}");
        }
        assert!(number("significance_sigma", &one["significance_sigma"]) >= 0.0);
        share("share_of_excess_error", &one["share_of_excess_error"]);
    }

    let findings = list("findings", &report["findings"]);
    for one in findings {
        keys(
            "finding",
            one,
            &[
                "effect",
                "path",
                "probability",
                "statement",
                "equation",
                "parameters",
                "heldout",
                "confounded_with",
                "evidence",
            ],
        );
        words("finding.effect", &one["effect"]);
        check_path(&one["path"]);
        share("finding.probability", &one["probability"]);
        words("finding.statement", &one["statement"]);
        words("finding.equation", &one["equation"]);
        assert!(!list("finding.parameters", &one["parameters"]).is_empty());
        list("", &one["parameters"]).iter().for_each(|p| check_parameter("finding.parameters", p));
        check_heldout("finding.heldout", &one["heldout"]);
        list("confounded_with", &one["confounded_with"]).iter().for_each(|w| {
            words("confounded_with", w);
        });
        list("evidence", &one["evidence"]).iter().for_each(|w| {
            words("evidence", w);
        });
    }
    // Several effects at once go by what they explain; those that cannot be told apart by probability.
    for (first, next) in findings.iter().zip(findings.iter().skip(1)) {
        if list("confounded_with", &first["confounded_with"]).contains(&next["effect"]) {
            let probability = |f: &Value| f["probability"].as_f64().unwrap();
            assert!(probability(first) >= probability(next), "best first: {first} {next}");
        }
    }

    let explanations = list("explanations", &report["explanations"]);
    let (mut last, mut listed) = (1.0, 0.0);
    for one in explanations {
        keys("explanation", one, &["effects", "probability"]);
        list("explanation.effects", &one["effects"]).iter().for_each(|w| {
            words("explanation.effects", w);
        });
        share("explanation.probability", &one["probability"]);
        let probability = number("explanation.probability", &one["probability"]);
        assert!(probability <= last, "likeliest first: {explanations:?}");
        last = probability;
        listed += probability;
    }
    assert!(listed >= 0.95, "until 0.95 is reached: {explanations:?}");
    let left = &report["remainder"];
    if !left.is_null() {
        keys("remainder", left, &["share_of_excess_error", "path", "channel", "regime", "nrmse"]);
        share("remainder.share_of_excess_error", &left["share_of_excess_error"]);
        check_path(&left["path"]);
        words("remainder.channel", &left["channel"]);
        words("remainder.regime", &left["regime"]);
    }
    for one in list("alternatives", &report["alternatives"]) {
        keys("alternative", one, &["effect", "probability", "why_not"]);
        words("alternative.effect", &one["effect"]);
        share("alternative.probability", &one["probability"]);
        words("alternative.why_not", &one["why_not"]);
    }
    let term = &report["empirical_term"];
    if !term.is_null() {
        keys("empirical_term", term, &["path", "enters", "expression", "variables", "heldout"]);
        check_path(&term["path"]);
        words("enters", &term["enters"]);
        words("expression", &term["expression"]);
        list("variables", &term["variables"]).iter().for_each(|v| {
            words("variables", v);
        });
        check_heldout("empirical_term.heldout", &term["heldout"]);
    }
    let next = &report["next_experiment"];
    if !next.is_null() {
        keys("next_experiment", next, &["separates", "excitation", "why", "scenario"]);
        assert!(!list("separates", &next["separates"]).is_empty());
        words("excitation", &next["excitation"]);
        words("why", &next["why"]);
        keys("scenario", &next["scenario"], &["segments"]);
    }
    check_verdict(report, findings, mismatch);
}

fn check_path(path: &Value) {
    assert!(
        ["drive", "shaft", "blade", "flow", "sensor"].contains(&path.as_str().unwrap_or("")),
        "{path} is no path"
    );
}

fn check_verdict(report: &Value, findings: &[Value], mismatch: &[Value]) {
    match report["verdict"].as_str().unwrap_or("") {
        "no_mismatch" | "insufficient_data" => assert!(findings.is_empty() && mismatch.is_empty()),
        "partly_explained" => {
            assert!(!findings.is_empty() && !mismatch.is_empty());
        }
        "explained" => {
            assert!(!findings.is_empty() && !mismatch.is_empty());
            assert!(findings.iter().all(|f| f["confounded_with"].as_array().unwrap().is_empty()));
        }
        "ambiguous" => {
            let rivals: Vec<&Value> =
                findings.iter().filter(|f| !f["confounded_with"].as_array().unwrap().is_empty()).collect();
            assert!(rivals.len() >= 2 && !mismatch.is_empty());
            for one in &rivals {
                for other in one["confounded_with"].as_array().unwrap() {
                    let named = rivals.iter().find(|f| f["effect"] == *other);
                    let back = named.map(|f| f["confounded_with"].as_array().unwrap());
                    assert!(
                        back.is_some_and(|b| b.contains(&one["effect"])),
                        "{other} does not name {}",
                        one["effect"]
                    );
                }
            }
        }
        "unexplained" => assert!(!mismatch.is_empty()),
        other => panic!("{other:?} is no verdict"),
    }
}
