//! `kort prove`, black box: cases to look at. The proof itself takes minutes; `docs/proof.md` is its page.

#[path = "common/lab.rs"]
mod lab;

use lab::{folder, kort, stderr};

/// Cases are written with the answer beside them; where stderr is no terminal no bar is drawn.
#[test]
fn cases_of_every_kind_are_written() {
    let cases = folder().join("cases");
    let run = kort(&["prove", "--write-cases", cases.to_str().unwrap(), "--cases", "5"]);
    let said = stderr(&run);
    assert_eq!(run.status.code(), Some(0), "{said}");
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("wrote 6 cases under") && !said.contains(['\r', '\x1b']), "{said:?}");
    for kind in ["single", "clean", "pair", "confounded", "outside"] {
        let case = cases.join(format!("{kind}-1000000"));
        for file in ["recording.csv", "rig.toml", "answer.json"] {
            assert!(case.join(file).is_file(), "{}: no {file}", case.display());
        }
    }
}
