//! The interface against its own description: schemathesis reads `/openapi.json` of a live stack and sends what the
//! schemas allow and what they forbid, alone and in sequences.
//!
//! Needs schemathesis, which tests/run.sh installs and names in `KORT_SCHEMATHESIS`.

mod common;

use std::process::Command;

use common::Stack;

/// What no schema can say: which texts are a rig description or a controller file, and which fields exclude each other. Such
/// a body is refused with 422 for its meaning. DELETE of a recording, a diagnosis, a fit or a calibration that runs ends it,
/// and it stays. A command without `Lease-Id` is refused with 403 while nobody holds the lease, and with 409 and the
/// holder's name while somebody does.
const BY_MEANING: &str = "[checks.missing_required_header]\nexpected-statuses = [\"400\", \"403\", \"409\", \"415\", \"422\"]\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/rig\"\ninclude-method = \"POST\"\n\
    checks.positive_data_acceptance.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/excitation\"\ninclude-method = \"POST\"\n\
    checks.positive_data_acceptance.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/controller/file\"\ninclude-method = \"PUT\"\n\
    checks.positive_data_acceptance.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/diagnoses\"\ninclude-method = \"POST\"\n\
    checks.positive_data_acceptance.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/fits\"\ninclude-method = \"POST\"\n\
    checks.positive_data_acceptance.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/recordings/{name}\"\n\
    checks.use_after_free.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/diagnoses/{diagnosis}\"\n\
    checks.use_after_free.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/fits/{fit}\"\n\
    checks.use_after_free.enabled = false\n\
    [[operations]]\ninclude-path = \"/v1/thrusters/{id}/calibrations/{calibration}\"\n\
    checks.use_after_free.enabled = false\n";

#[test]
fn schemathesis_finds_no_answer_that_the_document_does_not_promise() {
    let program = std::env::var("KORT_SCHEMATHESIS").unwrap_or_else(|_| "schemathesis".into());
    if Command::new(&program).arg("--version").output().is_err() {
        println!("not run: {program} is not installed");
        return;
    }
    let stack = Stack::start();
    std::fs::write(stack.site.folder.path().join("schemathesis.toml"), BY_MEANING).unwrap();
    let run = || {
        let done = Command::new(&program)
            .args(["run", &format!("http://127.0.0.1:{}/openapi.json", stack.site.port)])
            .args(["--max-examples", "20", "--seed", "1", "--request-timeout", "10", "--no-color"])
            .current_dir(stack.site.folder.path())
            .output()
            .unwrap();
        (done.status.success(), String::from_utf8_lossy(&done.stdout).into_owned(), done.stderr)
    };
    // A machine that holds the servo up gets the 503 that the document promises, which schemathesis counts as an
    // error of the server: then once more.
    let (mut passed, mut words, mut talk) = run();
    if !passed && words.contains("urn:kort:problem:not-ready") {
        (passed, words, talk) = run();
    }
    assert!(passed, "{words}{}", String::from_utf8_lossy(&talk));
    let paths = stack.get("/openapi.json").expect("the document")["paths"].as_object().unwrap().clone();
    let methods = ["get", "put", "post", "delete", "patch"];
    let others = paths.iter().filter(|(path, _)| *path != "/openapi.json").map(|(_, operations)| operations);
    // Schemathesis does not ask for the document that it has read.
    let operations =
        others.flat_map(|path| methods.iter().filter(|method| path.get(method).is_some())).count();
    assert!(operations > 40, "the document holds the interface: {operations} operations");
    assert!(
        words.contains(&format!("{operations} selected / {operations} total")),
        "every operation is tried: {words}"
    );
}
