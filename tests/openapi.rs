//! The interface against its own description: schemathesis reads `/openapi.json` of a live stack and sends what the
//! schemas allow and what they forbid, alone and in sequences.
//!
//! Needs schemathesis, which tests/run.sh installs and names in `KORT_SCHEMATHESIS`.

mod common;

use std::process::Command;

use common::Stack;

#[test]
fn schemathesis_finds_no_answer_that_the_document_does_not_promise() {
    let program = std::env::var("KORT_SCHEMATHESIS").unwrap_or_else(|_| "schemathesis".into());
    if Command::new(&program).arg("--version").output().is_err() {
        println!("not run: {program} is not installed");
        return;
    }
    let stack = Stack::start();
    let done = Command::new(program)
        .args(["run", &format!("http://127.0.0.1:{}/openapi.json", stack.site.port)])
        .args(["--max-examples", "20", "--seed", "1", "--request-timeout", "10", "--no-color"])
        .current_dir(stack.site.folder.path())
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&done.stdout);
    assert!(done.status.success(), "{words}{}", String::from_utf8_lossy(&done.stderr));
    assert!(words.contains("24 selected"), "every operation is tried: {words}");
}
