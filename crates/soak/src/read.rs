//! A scenario from its text.

use kort_thruster::place;

use crate::scenario::{LONGEST_S, Scenario};

impl Scenario {
    /// A scenario from its text, checked.
    ///
    /// # Errors
    /// All that is wrong: what cannot be read, else the values that cannot be meant. Each names the key, the value and what
    /// is allowed, with a hint.
    pub fn from_toml(text: &str) -> Result<Self, Vec<String>> {
        match Self::read(text) {
            (Some(scenario), wrong) if wrong.is_empty() => Ok(scenario),
            (_, wrong) => Err(wrong),
        }
    }

    /// A scenario as far as its text can be read, for whoever looks on for what is wrong with the rest, and all that is wrong so
    /// far: then it is not to be run, and a rig that it lacks is an empty path.
    pub fn read(text: &str) -> (Option<Self>, Vec<String>) {
        let mut read = place::text_as_far_as_it_goes::<Self>(text);
        let hinted = |said: &String| format!("{said}\nhint: docs/control.md lists every key");
        let mut wrong: Vec<String> = read.said.iter().map(hinted).collect();
        let no_length = read.made_up("duration_s");
        let scenario = read.value.take().map(|scenario| Self {
            // What must lie within the run is told once there is one.
            duration_s: if no_length { LONGEST_S } else { scenario.duration_s },
            ..scenario
        });
        let values = scenario.iter().flat_map(Self::check);
        wrong.extend(values.filter_map(|words| read.in_file(&words)));
        (scenario, wrong)
    }
}
