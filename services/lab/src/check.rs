//! What kind of configuration a file is, and what is wrong with it, as the laboratory would read it.

use std::path::Path;

use kort_control::ControllerConfig;
use kort_control::known::uses;
use kort_recording::ColumnMap;
use kort_thruster::rig::Rig;

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
            Kind::Soak => kort_soak::Scenario::from_toml(text).map(drop),
            Kind::Scenario => {
                let wrong = match kort_scenario::Scenario::from_toml_with_all(text) {
                    Ok(scenario) => scenario.check(),
                    Err(wrong) => wrong,
                };
                if wrong.is_empty() { Ok(()) } else { Err(all(wrong)) }
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
}
