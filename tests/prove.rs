//! `kort prove`, black box: cases to look at, seeds and their ledger, measured recordings with a key.
//! The proof itself takes minutes; `docs/proof.md` is its page.

#[path = "common/lab.rs"]
mod lab;

use lab::{folder, kort, stderr};

const KINDS: [&str; 6] = ["single", "clean", "pair", "several", "confounded", "outside"];

/// Cases are written with the answer beside them; where stderr is no terminal no bar is drawn.
#[test]
fn cases_of_every_kind_are_written() {
    let cases = folder().join("cases");
    let run =
        kort(&["prove", "--tuning", "--seed", "3", "--write-cases", cases.to_str().unwrap(), "--cases", "6"]);
    let said = stderr(&run);
    assert_eq!(run.status.code(), Some(0), "{said}");
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("wrote ") && !said.contains(['\r', '\x1b']), "{said:?}");
    for kind in KINDS {
        let case = cases.join(format!("{kind}-3"));
        for file in ["recording.csv", "rig.toml", "answer.json"] {
            assert!(case.join(file).is_file(), "{}: no {file}", case.display());
        }
    }
}

/// What stands in a recording and a rig file is what `kort diagnose` reads.
#[test]
fn a_written_case_can_be_diagnosed() {
    let cases = folder().join("dry");
    let place = cases.to_str().unwrap();
    let words = ["--kind", "single", "--family", "coulomb_friction", "--machine", "dry", "--cases", "1"];
    let run = kort(&[&["prove", "--tuning", "--seed", "2", "--write-cases", place], &words[..]].concat());
    assert_eq!(run.status.code(), Some(0), "{}", stderr(&run));
    let case = cases.join("single-2");
    let [recording, rig] =
        ["recording.csv", "rig.toml"].map(|file| case.join(file).to_str().unwrap().to_owned());
    let output = kort(&["diagnose", &recording, "--rig", &rig, "--json"]);
    // 3: done, though rows of a sensor that misbehaves were left out.
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["verdict"].is_string(), "{report}");
}

#[test]
fn seeds_that_were_used_are_refused_and_new_ones_entered() {
    let place = folder().join("ledger.toml");
    std::fs::write(&place, "[[used]]\nfirst = 5000000\nlast = 5000099\ncommit = \"abc\"\n").unwrap();
    let ledger = place.to_str().unwrap();
    let cases = folder().join("sealed");
    let write = |seed: &str, more: &[&str]| {
        let words = ["prove", "--ledger", ledger, "--seed", seed, "--cases", "1", "--kind", "clean"];
        kort(&[&words[..], &["--write-cases", cases.to_str().unwrap()], more].concat())
    };
    let again = write("5000042", &[]);
    assert_eq!(again.status.code(), Some(1));
    assert!(stderr(&again).contains("hint: --seed 6000000"), "{}", stderr(&again));
    let tuning = write("12", &[]);
    assert_eq!(tuning.status.code(), Some(1));
    assert!(stderr(&tuning).contains("hint: say --tuning"), "{}", stderr(&tuning));
    let fresh = write("5000100", &[]);
    assert_eq!(fresh.status.code(), Some(0), "{}", stderr(&fresh));
    assert_eq!(write("5000100", &[]).status.code(), Some(1), "entered by the run before");
    assert!(std::fs::read_to_string(&place).unwrap().contains("first = 5000100"));
}

#[test]
fn what_may_be_named_is_said() {
    let run = kort(&["prove", "--family", "friction"]);
    assert_eq!(run.status.code(), Some(2));
    assert!(stderr(&run).contains("coulomb_friction"), "{}", stderr(&run));
}
