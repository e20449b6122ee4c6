//! The commands that pages of docs show, run in their order; README and tutorial are followed beside the diagnoses.

use crate::common::{self, Stack, pages};

/// Pages followed here, and in `tests/diagnoses/main.rs`.
const FOLLOWED: [&str; 7] = [
    "README.md",
    "docs/tutorial.md",
    "docs/operations.md",
    "docs/recordings.md",
    "docs/measured-recordings.md",
    "docs/console.md",
    "docs/hardware.md",
];

#[test]
fn every_command_in_the_docs_is_run() {
    pages::none_is_forgotten(&FOLLOWED);
}

#[test]
fn operations_and_the_console_as_a_reader_follows_them() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let said = pages::follow("docs/operations.md", stack.site.port);
        assert!(said.contains("\"difference\":"), "{said}");
        assert!(said.contains("\"ended_by\":\"bench ended it\""), "the test signal is ended: {said}");
        let said = pages::follow("docs/console.md", stack.site.port);
        let asked = pages::follow("docs/hardware.md", stack.site.port);
        assert!(asked.contains("\"asks\":\"listens to every sensor"), "{asked}");
        assert!(said.contains("phase_margin_deg") && said.contains("\"tags\":[\"bollard\"]"), "{said}");
    });
}

#[test]
fn logs_of_others_as_a_reader_brings_them_in() {
    let mut flight = Vec::new();
    let log = std::fs::File::open("tests/recordings/logs/px4-uavcan-escs.ulg.gz").unwrap();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(log), &mut flight).unwrap();
    let mut bench = String::from("t_s,Motor speed (rpm),thrust_gf\n");
    for k in 0..200 {
        bench += &format!("{},{},{}\n", 0.02 * f64::from(k), 100 * (k % 7), k);
    }
    let given = [("flight.ulg", flight.as_slice()), ("bench.csv", bench.as_bytes())];
    let said = pages::follow_with("docs/recordings.md", 0, &given);
    for words in ["PX4 ULog", "esc_status", "\"schema\": \"kort.columns/1\"", "364 rows of"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let said = pages::follow("docs/measured-recordings.md", 0);
    assert!(said.contains("MISMATCH UNEXPLAINED"), "{said}");
}
