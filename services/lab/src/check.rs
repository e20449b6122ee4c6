//! What kind of configuration a file is, and what is wrong with it, as the laboratory would read it.

use std::path::Path;

use kort_control::ControllerConfig;
use kort_control::known::uses;
use kort_recording::ColumnMap;
use kort_scenario::{Excitation, Scenario, ScenarioError};
use kort_thruster::effects::{self, Scale};
use kort_thruster::rig::Rig;

use crate::commands::simulate::Files;
use crate::soak::{self, Instead};

/// Kinds of configuration beside a deployment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A rig description.
    Rig,
    /// A scenario of `kort soak`.
    Soak,
    /// A scenario of `kort simulate`.
    Scenario,
    /// A column map.
    Columns,
    /// Law, observer and estimator with their options.
    Controller,
}

impl Kind {
    /// The kind of a file, by the sections that only this kind has.
    pub fn of(table: &toml::Table) -> Kind {
        let has = |key: &str| table.contains_key(key);
        match () {
            () if has("rig") && table["rig"].is_table() || has("propeller") => Kind::Rig,
            () if has("reference") || has("controllers") => Kind::Soak,
            () if has("segments") || has("duration_s") => Kind::Scenario,
            () if has("columns") => Kind::Columns,
            () => Kind::Controller,
        }
    }

    /// Reads the text as this kind is read; words that name key, value and what is allowed: everything that is wrong.
    ///
    /// # Errors
    /// What is wrong with it, at least one.
    pub fn check(self, text: &str, path: &Path) -> Result<(), Vec<String>> {
        fn all<E: ToString>(wrong: Vec<E>) -> Vec<String> {
            wrong.iter().map(ToString::to_string).collect()
        }
        match self {
            Kind::Rig => Rig::from_toml_with_all(text).map(drop).map_err(all),
            Kind::Soak => {
                soak::of_text(text, path, &Instead::default()).map(drop).map_err(|wrong| {
                    // Its own file is named by whoever asks.
                    let own = format!("{}: ", path.display());
                    let bare = |words: String| words.strip_prefix(&own).map(str::to_owned).unwrap_or(words);
                    wrong.iter().map(ToString::to_string).map(bare).collect()
                })
            }
            Kind::Scenario => {
                let more = |scenario: &Scenario| [replays(scenario, path), values(scenario)].concat();
                let wrong = Scenario::all_wrong(text, more);
                if wrong.is_empty() { Ok(()) } else { Err(wrong) }
            }
            Kind::Columns => {
                let name = path.file_stem().unwrap_or_default().to_string_lossy();
                ColumnMap::from_toml(&name, text).map(drop).map_err(|wrong| all(wrong.0))
            }
            Kind::Controller => ControllerConfig::from_toml_with_all(text).map(drop).map_err(all),
        }
    }

    /// Effects that the text states and no control law or observer uses, each with why. A rig states such.
    pub fn left_out(self, text: &str) -> Vec<(&'static str, &'static str)> {
        match (self, Rig::from_toml(text)) {
            (Kind::Rig, Ok(rig)) => uses::left_out(&rig, uses::period_s(&rig)),
            _ => Vec::new(),
        }
    }
}

/// What a scenario replays and is not to be had.
fn replays(scenario: &Scenario, path: &Path) -> Vec<ScenarioError> {
    let mut files = Files::beside(path);
    let signals = [
        ("segments", &scenario.segments),
        ("ambient", &scenario.ambient),
        ("supply", &scenario.supply),
        ("depth", &scenario.depth),
        ("temperature", &scenario.temperature),
    ];
    let wrong = signals.into_iter().flat_map(|(name, segments)| {
        Excitation::new(name, segments, scenario.seed, &mut files).err().unwrap_or_default()
    });
    wrong.filter(|error| matches!(error, ScenarioError::Replay { .. })).collect()
}

/// Values of effects that are missing, or that no rig allows: the most of many goes by the rig, which a scenario does not name.
fn values(scenario: &Scenario) -> Vec<ScenarioError> {
    let larger = Scale {
        shaft_speed_rad_s: 2.0,
        torque_n_m: 2.0,
        thrust_n: 2.0,
        flow_m_s: 2.0,
        current_a: 2.0,
        command: 2.0,
        supply_v: 2.0,
        winding_resistance_ohm: 2.0,
        inertia_kg_m2: 2.0,
        ..Scale::ANY
    };
    let mut wrong = Vec::new();
    for (i, wanted) in scenario.effects.iter().enumerate() {
        let Some(effect) = effects::find(&wanted.effect) else { continue };
        let given = format!("effects[{i}].parameters");
        let used = kort_scenario::used_effect(("", effect.id), (&given, &wanted.parameters), &Scale::ANY);
        let missing = used.err().unwrap_or_default().into_iter().filter_map(|error| match error {
            ScenarioError::Missing { key, .. } => Some(key),
            _ => None,
        });
        let explain = format!("`kort explain {}` tells each, and its range", effect.id);
        wrong.extend(missing.map(|key| ScenarioError::Missing { key, hint: explain.clone() }));
        let specs = (effect.parameters)(&Scale::ANY);
        for (spec, of_larger) in specs.iter().zip((effect.parameters)(&larger)) {
            let Some(value) = wanted.parameters.get(spec.name) else { continue };
            let allowed = if (spec.low, spec.high) == (of_larger.low, of_larger.high) {
                (!(*value >= spec.low && *value <= spec.high))
                    .then(|| format!("{} to {}", spec.low, spec.high))
            } else if spec.low >= 0.0 {
                (!(*value >= 0.0 && value.is_finite())).then(|| "0 or above".to_owned())
            } else {
                (!value.is_finite()).then(|| "a finite number".to_owned())
            };
            wrong.extend(allowed.map(|allowed| ScenarioError::Value {
                key: format!("{given}.{}", spec.name),
                found: value.to_string(),
                allowed: if spec.unit == "1" { allowed } else { format!("{allowed} {}", spec.unit) },
            }));
        }
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_file_is_known_for_what_it_is_and_sound() {
        let config = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config"));
        for (folder, kinds) in [
            ("thrusters", &[Kind::Rig][..]),
            ("scenarios", &[Kind::Soak, Kind::Scenario]),
            ("columns", &[Kind::Columns]),
            ("controllers", &[Kind::Controller]),
        ] {
            for entry in std::fs::read_dir(config.join(folder)).unwrap() {
                let path = entry.unwrap().path();
                let text = std::fs::read_to_string(&path).unwrap();
                let kind = Kind::of(&text.parse().unwrap());
                assert!(kinds.contains(&kind), "{}: {kind:?}", path.display());
                assert_eq!(kind.check(&text, &path), Ok(()), "{}", path.display());
            }
        }
    }

    /// A scenario of `kort soak` as a tester broke it, beside the shipped ones, and what is wrong with it.
    fn said_of_soak(with: &str) -> Vec<String> {
        let text = format!(
            "name = \"x\"\nwhat = \"y\"\nrig = \"../thrusters/t200.toml\"\nduration_s = 60\ncontrollers = [\"velocity_servo\"]\n[[reference]]\nkind = \"steps\"\nlevels = [0.5]\nhold_s = 3\n{with}"
        );
        // The rig of the line above, the controller: each may be replaced by what stands in `with`.
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/scenarios/soak-towed.toml"));
        Kind::Soak.check(&text, path).err().unwrap_or_default()
    }

    #[test]
    fn a_soak_scenario_is_checked_with_all_that_it_names() {
        assert_eq!(said_of_soak(""), Vec::<String>::new());
        for (with, words) in [
            ("[[effect]]\nid = \"coulomb_frictoin\"", "did you mean `coulomb_friction`?"),
            ("[[effect]]\nid = \"coulomb_friction\"\nvalues = { coulomb_torque_nm = 0.02 }", "has no value"),
            (
                "[[effect]]\nid = \"coulomb_friction\"\nvalues = { coulomb_torque_n_m = 200 }",
                "= 200 is outside",
            ),
            (
                "[[effect]]\nid = \"coulomb_friction\"\nvalues = { coulomb_torque_n_m = 0.01 }\nshares = { coulomb_torque_n_m = 0.1 }",
                "leave one of them out",
            ),
            (
                "[[reference]]\nkind = \"replay\"\nfile = \"nofile\"\npeak = 0.7",
                "nofile: there is no such recording",
            ),
            (
                "[sensors]\nthrust = false\n[[sensor_fault]]\nchannel = \"thrust_n\"\nlie = \"gain\"\nsize = 2\nat_s = 4\nfor_s = 2",
                "what is not fitted cannot fail",
            ),
        ] {
            let said = said_of_soak(with);
            assert!(
                said.len() == 1 && said[0].contains(words) && said[0].contains("hint: "),
                "{with}: {said:?}"
            );
        }
    }

    #[test]
    fn all_that_is_wrong_with_a_soak_scenario_is_said_at_once() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/scenarios/soak-towed.toml"));
        let rest = "duration_s = 60\ncontrollers = [\"velocity_servo\", \"modle2_inversion\"]\n[[reference]]\nkind = \"replay\"\nfile = \"nofile\"\npeak = 0.7\n[[effect]]\nid = \"coulomb_frictoin\"";
        let of_rig = |rig: &str| {
            let text = format!("name = \"x\"\nwhat = \"y\"\nrig = \"../thrusters/{rig}.toml\"\n{rest}");
            Kind::Soak.check(&text, path).unwrap_err()
        };
        let said = of_rig("t200");
        assert_eq!(said.len(), 3, "{said:?}");
        // An effect is held to a rig; without one the rest is said.
        for rig in ["t20", "rosa-rotor"] {
            let said = of_rig(rig);
            assert!(said.len() == 3 && said[0].contains("hint: "), "{rig}: {said:?}");
        }
        assert!(of_rig("t20")[0].starts_with("`rig` = \"../thrusters/t20.toml\""), "{:?}", of_rig("t20"));
    }

    #[test]
    fn what_cannot_be_read_hides_nothing_else() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/scenarios/soak-towed.toml"));
        let text = "name = \"x\"\nwhat = 3\nrig = \"../thrusters/t20.toml\"\nduration_s = \"long\"\ncontrollers = [\"modle2_inversion\"]\n\
            [[reference]]\nkind = \"stairs\"\n[[reference]]\nkind = \"steps\"\nlevels = [2.0]\nhold_s = -2\nramp_s = 1\n\
            [[supply_sag]]\nat_s = 90\nfor_s = 1\nto = 3\n";
        let said = Kind::Soak.check(text, path).unwrap_err();
        for words in [
            "`what` = 3",
            "`duration_s` = \"long\"",
            "`reference[0].kind` = \"stairs\"",
            "`reference[1].levels` = 2 is outside",
            "`reference[1].hold_s` = -2 is outside",
            "`supply_sag[0].to` = 3 is outside",
            "`rig` = \"../thrusters/t20.toml\"",
            "controller `modle2_inversion`",
        ] {
            assert_eq!(said.iter().filter(|line| line.starts_with(words)).count(), 1, "{words} in {said:#?}");
        }
        assert_eq!(said.len(), 8, "{said:#?}");
        let map = "descripton = \"x\"\n[time]\nsource = \"t\"\nunit = \"sec\"\n[columns.thrust_n]\nsource = \"Force\"\nunit = \"kg\"\n";
        let said = Kind::Columns.check(map, Path::new("a.toml")).unwrap_err();
        assert_eq!(said.len(), 3, "{said:#?}");
    }

    #[test]
    fn what_is_missing_is_said_once() {
        for with in [
            "[[effect]]\nvalues = { coulomb_torque_n_m = 0.01 }",
            "[[reference]]\nkind = \"replay\"\npeak = 0.7",
            "[[reference]]\nkind = \"steps\"\nlevels = [0.5]\nhold_s = 3\n[truth]\nspread = 0.6",
        ] {
            let said = said_of_soak(with);
            assert!(said.len() == 1 && said[0].contains("hint: "), "{with}: {said:?}");
        }
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/scenarios/soak-towed.toml"));
        let towed = std::fs::read_to_string(path).unwrap();
        for rate in [0.0, -1000.0, 20_000.0] {
            let said = Kind::Soak.check(&format!("control_rate_hz = {rate:?}\n{towed}"), path).unwrap_err();
            assert!(said.len() == 1 && said[0].contains("50 to 10000"), "{rate}: {said:?}");
        }
        let map = "[time]\nsource = \"t\"\nunit = \"s\"\n";
        for (columns, words) in [("", "missing field `columns`"), ("[columns]\n", "`columns` is empty")] {
            let said = Kind::Columns.check(&format!("{map}{columns}"), Path::new("a.toml")).unwrap_err();
            assert!(said.len() == 1 && said[0].contains(words), "{columns}: {said:?}");
        }
    }

    #[test]
    fn a_scenario_without_a_rig_is_checked_for_what_no_rig_allows() {
        let said = |effects: &str, more: &str| {
            let text = format!(
                "effects = [{effects}]\n[[segments]]\nkind = \"hold\"\nvalue = 0.3\nduration_s = 3\n{more}"
            );
            Kind::Scenario.check(&text, Path::new("a.toml")).err().unwrap_or_default()
        };
        let friction = |torque: f64, rise: f64| {
            format!(
                "{{ effect = \"coulomb_friction\", parameters = {{ coulomb_torque_n_m = {torque}, stribeck_rise = {rise}, stribeck_speed_rad_s = 2.0 }} }}"
            )
        };
        assert_eq!(said(&friction(0.1, 0.1), ""), Vec::<String>::new());
        assert_eq!(said(&friction(300.0, 0.1), ""), Vec::<String>::new(), "which is too much the rig says");
        let lacking = "{ effect = \"coulomb_friction\", parameters = { coulomb_torque_n_m = 0.1 } }";
        for (effects, more, words) in [
            (friction(-0.1, 0.1), "", "`effects[0].parameters.coulomb_torque_n_m` = -0.1 is outside"),
            (friction(0.1, 1e4), "", "`effects[0].parameters.stribeck_rise` = 10000 is outside"),
            (lacking.to_owned(), "", "stribeck_speed_rad_s` is missing"),
            (
                String::new(),
                "[[segments]]\nkind = \"replay\"\nrecording = \"nofile.csv\"\ncolumn = \"thrust_n\"\n",
                "nofile.csv: there is no such",
            ),
        ] {
            let said = said(&effects, more);
            assert!(said.len() == 1 && said[0].contains(words), "{effects} {more}: {said:?}");
        }
    }
}
