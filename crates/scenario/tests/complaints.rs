//! What is said of a scenario that cannot be read: all of it, each by its place in the file.

use kort_scenario::{Scenario, ScenarioError};

const HEAD: &str = "[[segments]]\nkind = \"hold\"\nvalue = 0\nduration_s = 1\n";

fn said(text: &str) -> Vec<String> {
    let wrong = Scenario::from_toml_with_all(text).unwrap_err();
    let words = wrong.into_iter().map(|error| match error {
        ScenarioError::Syntax { message } => message,
        other => other.to_string(),
    });
    words.collect()
}

#[test]
fn the_key_meant_is_named_down_to_its_entry() {
    for (more, words) in [
        (
            "[[segments]]\nkind = \"hold\"\nvalue = \"big\"\nduration_s = 1",
            "`segments[1].value` = \"big\": invalid type: string \"big\", expected a number",
        ),
        (
            "[[segments]]\nkind = \"hold\"\nvalue = 1\nduration = 1",
            "`segments[1].duration` = 1: unknown field `duration`, expected `value` or `duration_s`",
        ),
        (
            "[[segments]]\nkind = \"steps\"\neach_s = 1\nvalues = [1, true]",
            "`segments[1].values`: invalid type: boolean `true`, expected a number",
        ),
        ("[[segments]]\nkind = \"hold\"\nvalue = 1", "`segments[1]`: missing field `duration_s`"),
        (
            "[turbulence]\nsigma_m_s = \"x\"\ntime_constant_s = 1",
            "`turbulence.sigma_m_s` = \"x\": invalid type: string \"x\", expected a number",
        ),
        (
            "[[effects]]\neffect = \"coulomb_friction\"\nparameters = { a = [] }",
            "`effects[0].parameters.a`: invalid type: sequence, expected a number",
        ),
    ] {
        assert_eq!(said(&format!("{HEAD}{more}\n")), [words]);
    }
    assert!(said(&HEAD.replace("[[segments]]", "[[segments"))[0].contains("line 1"));
    assert!(said(&format!("seed = -1\n{HEAD}"))[0].starts_with("`seed` = -1: "));
}

/// Places are those of the file, whatever was wrong before them; what is told as misspelt is not missing too.
#[test]
fn all_that_is_wrong_is_told_at_its_place() {
    let text = format!(
        "noise = \"none\"\nsede = 3\n{HEAD}[[segments]]\nkind = \"stairs\"\nvalue = 1\n[[segments]]\nkind = \"hold\"\nvalue = 1\n\
         [[segments]]\nkind = \"hold\"\nvalue = 1\nduration = 2\n[[segments]]\nkind = \"hold\"\nvalue = true\nduration_s = 1\n\
         [turbulence]\nsigma = 1\n"
    );
    let said = said(&text);
    let has = |words: &str| said.iter().filter(|line| line.contains(words)).count() == 1;
    for words in [
        "`noise` = \"none\": invalid type",
        "`sede` = 3: unknown field",
        "`segments[1].kind` = \"stairs\": unknown variant",
        "`segments[2]`: missing field `duration_s`",
        "`segments[3].duration` = 2: unknown field",
        "`segments[4].value` = true: invalid type",
        "`turbulence.sigma` = 1: unknown field",
        "`turbulence`: missing field `time_constant_s`",
    ] {
        assert!(has(words), "{words} in {said:#?}");
    }
    assert_eq!(said.len(), 8, "{said:#?}");
}

#[test]
fn all_values_that_cannot_be_meant_are_told() {
    let text = "noise = -1\nduration_s = 0\n[parameters]\ninertia_kg_m2 = -1\n[[segments]]\nkind = \"hold\"\nvalue = 1\nduration_s = -1\n\
                [[segments]]\nkind = \"steps\"\neach_s = 1\nvalues = []\n[[effects]]\neffect = \"coulomb\"\n";
    let wrong = Scenario::from_toml(text).unwrap().check();
    let said: Vec<String> = wrong.iter().map(ToString::to_string).collect();
    for key in [
        "noise",
        "duration_s",
        "parameters.inertia_kg_m2",
        "segments[0].duration_s",
        "segments[1].values",
        "effects[0].effect",
    ] {
        assert!(said.iter().any(|line| line.starts_with(&format!("`{key}` = "))), "{key} in {said:#?}");
    }
    assert_eq!(said.len(), 6, "{said:#?}");
    assert_eq!(Scenario::from_toml(HEAD).unwrap().check(), []);
}

/// What cannot be read hides neither the values that cannot be meant nor their places; what was made up to read on is no fault.
#[test]
fn values_are_told_beside_what_cannot_be_read() {
    let text = format!(
        "noise = -1\nsede = 3\n{HEAD}[[segments]]\nkind = \"stairs\"\nvalue = 1\n[[segments]]\nkind = \"hold\"\nvalue = 1\nduration_s = -2\n\
         [[segments]]\nkind = \"steps\"\neach_s = \"x\"\nvalues = []\n[turbulence]\nsigma_m_s = -1\n"
    );
    let said = Scenario::all_wrong(&text, |_| Vec::new());
    for words in [
        "`noise` = -1 is outside",
        "`sede` = 3: unknown field",
        "`segments[1].kind` = \"stairs\"",
        "`segments[2].duration_s` = -2 is outside",
        "`segments[3].each_s` = \"x\"",
        "`turbulence`: missing field `time_constant_s`",
    ] {
        assert_eq!(said.iter().filter(|line| line.starts_with(words)).count(), 1, "{words} in {said:#?}");
    }
    assert_eq!(said.len(), 6, "{said:#?}");
    assert_eq!(Scenario::all_wrong(HEAD, |_| Vec::new()), Vec::<String>::new());
}

/// Of a table that lacks several keys all are told.
#[test]
fn every_key_that_is_missing_is_told() {
    let text = "[[segments]]\nkind = \"chirp\"\n[turbulence]\n";
    for (words, times) in [
        ("`segments[0]`: missing field `amplitude`", 1),
        ("`segments[0]`: missing field `from_hz`", 1),
        ("`segments[0]`: missing field `duration_s`", 1),
        ("`turbulence`: missing field `sigma_m_s`", 1),
        ("`turbulence`: missing field `time_constant_s`", 1),
        ("missing field", 6),
    ] {
        let said = said(text);
        assert_eq!(said.iter().filter(|line| line.contains(words)).count(), times, "{words} in {said:#?}");
    }
}
