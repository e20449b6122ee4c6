//! What each law, observer and estimator says of itself: the head of its own file, so that words and
//! code stay in one place. `kort explain NAME` prints it.

/// A law, an observer or an estimator.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// "law", "observer" or "estimator".
    pub kind: &'static str,
    /// Name as in configuration files and the service.
    pub name: &'static str,
    source: &'static str,
}

impl About {
    /// Whole text: reference, assumptions, what must be measured, how it fails.
    pub fn text(&self) -> String {
        let lines = self.source.lines().map_while(|line| line.strip_prefix("//!"));
        let text: Vec<&str> = lines.map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
        text.join("\n").replace("[`super::", "`").replace("`]", "`")
    }

    /// First sentence: what it is.
    pub fn title(&self) -> &'static str {
        self.source.lines().next().unwrap_or_default().trim_start_matches("//!").trim()
    }

    /// The law, observer or estimator of that name.
    pub fn find(name: &str) -> Option<Self> {
        ALL.iter().find(|a| a.name == name).copied()
    }
}

macro_rules! about {
    ($($kind:literal in $folder:literal: $($name:literal)*;)*) => {
        &[$($(About { kind: $kind, name: $name, source: include_str!(concat!($folder, "/", $name, ".rs")) }),*),*]
    };
}

/// Every one of them.
pub const ALL: &[About] = about! {
    "law" in "laws": "static_map" "velocity_servo" "model1_inversion" "model2_inversion" "model3_inversion"
        "rotational_flow_inversion" "torque_control" "power_control" "combined_anti_spin" "thrust_pi"
        "trimmed_model2_inversion" "look_ahead";
    "observer" in "observers": "open_loop" "luenberger" "ekf" "ukf";
    "estimator" in "estimators": "gradient" "rls";
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EstimatorKind, LawKind, ObserverKind};

    #[test]
    fn every_kind_is_here_under_its_name() {
        let names: Vec<&str> = LawKind::ALL
            .map(LawKind::name)
            .into_iter()
            .chain(ObserverKind::ALL.map(ObserverKind::name))
            .chain(EstimatorKind::ALL.map(EstimatorKind::name).into_iter().filter(|n| *n != "off"))
            .collect();
        assert_eq!(ALL.iter().map(|a| a.name).collect::<Vec<_>>(), names);
    }

    #[test]
    fn each_says_where_it_comes_from_and_how_it_fails() {
        for about in ALL {
            let text = about.text();
            for word in ["Reference:", "Assumes:", "Needs measured:", "Fails:"] {
                assert!(text.contains(word), "{}: {word}\n{text}", about.name);
            }
            assert!(text.starts_with(about.title()) && about.title().ends_with(['.', ':']), "{text}");
        }
    }
}
