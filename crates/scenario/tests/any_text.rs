//! Whatever stands in a rig or a scenario, reading it gives a value or an error with a hint, never
//! a panic.

use kort_scenario::Scenario;
use kort_thruster::rig::Rig;
use proptest::prelude::*;

const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
const SCENARIOS: [&str; 5] = [
    include_str!("../../../config/scenarios/identification-random-levels.toml"),
    include_str!("../../../config/scenarios/multisine.toml"),
    include_str!("../../../config/scenarios/identification-prbs.toml"),
    include_str!("../../../config/scenarios/staircase.toml"),
    include_str!("../../../config/scenarios/tow.toml"),
];

/// What may stand where a value stood.
fn odd_value() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<f64>().prop_map(|x| format!("{x:e}")),
        (-100_i64..100).prop_map(|x| x.to_string()),
        prop::sample::select(vec![
            "nan",
            "inf",
            "-inf",
            "0",
            "-1",
            "1e300",
            "5e-324",
            "9223372036854775807",
            "4294967295",
            "true",
            "\"\"",
            "\"current\"",
            "\"model0\"",
            "[]",
            "[1, 2]",
            "[[0, 1], [0, 2]]",
            "{}",
            "{ value = 1 }",
            "{ value = 0.5, tol = 3 }",
            "{ tol = 0.1 }",
            "1979-05-27",
        ])
        .prop_map(String::from),
        "[ -~]{0,12}",
    ]
}

/// A text with some of its values replaced, or lines taken out.
fn damaged(text: &'static str) -> impl Strategy<Value = String> {
    let lines = text.lines().count();
    prop::collection::vec((0..lines, prop::option::weighted(0.8, odd_value())), 1..4).prop_map(
        move |changes| {
            let mut lines: Vec<String> = text.lines().map(String::from).collect();
            for (at, value) in changes {
                lines[at] = match (value, lines[at].split_once('=')) {
                    (Some(value), Some((key, _))) => format!("{key}= {value}"),
                    (Some(value), None) => value,
                    (None, _) => String::new(),
                };
            }
            lines.join("\n")
        },
    )
}

fn read_rig(text: &str) {
    if let Err(error) = Rig::from_toml(text) {
        assert!(error.to_string().contains("hint:"), "{error}");
    }
}

fn read_scenario(text: &str) {
    if let Err(error) = Scenario::from_toml(text) {
        assert!(error.to_string().contains("hint:"), "{error}");
    }
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
        read_rig(&text);
        read_scenario(&text);
    }

    #[test]
    fn a_damaged_rig_is_read_or_refused(text in damaged(RIG)) {
        read_rig(&text);
    }

    #[test]
    fn a_damaged_scenario_is_read_or_refused(
        text in prop::sample::select(SCENARIOS.to_vec()).prop_flat_map(damaged)
    ) {
        read_scenario(&text);
    }
}
