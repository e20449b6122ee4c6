//! A speed drive's log is two experiments in one: what shaft and thrust do under the speed that was asked for, and what
//! the shaft does under the current that the drive gave it. How the drive came to that current, its loop, is nobody's to
//! guess; what it moved with it is the shaft's torque balance, which the commanded speed alone does not show.

use std::borrow::Cow;

use kort_thruster::rig::{AmplifierKind, Rig};

use super::driving::choose_driving;
use super::{Driving, Series};

/// What the drive did to the shaft.
const ON_THE_SHAFT: [&str; 3] = ["current_a", "power_w", "supply_current_a"];
/// What was asked for, and what is measured in the water: compared under the command.
const UNDER_THE_COMMAND: [&str; 4] = ["speed_cmd_rad_s", "thrust_n", "torque_n_m", "flow_m_s"];

/// What is compared of a recording.
pub struct Experiment<'s> {
    /// The recording.
    pub recorded: &'s Series,
    /// What is read of it.
    pub read: Cow<'s, Series>,
    /// Whether the same recording stands before as another.
    pub second: bool,
}

/// The recordings, each of a speed drive that holds the drive's current or power beside the shaft's speed as two: the one
/// under its command first.
pub fn experiments<'s>(series: &'s [Series], rig: &Rig, speed_driven: bool) -> Vec<Experiment<'s>> {
    let read = |recorded| {
        let Some(shaft) = shaft_alone(recorded, rig, speed_driven) else {
            return vec![Experiment { recorded, read: Cow::Borrowed(recorded), second: false }];
        };
        let commanded = without(recorded, &ON_THE_SHAFT);
        [(commanded, false), (shaft, true)]
            .map(|(read, second)| Experiment { recorded, read: Cow::Owned(read), second })
            .into()
    };
    series.iter().flat_map(read).collect()
}

/// What was taken for true, where a recording is two experiments.
pub fn words(recorded: &[Series], experiments: &[Experiment]) -> Option<String> {
    (experiments.len() > recorded.len()).then(|| {
        "the speed drive's own current is recorded: beside what shaft and thrust do under the commanded speed, what the shaft does under that current is compared"
            .into()
    })
}

/// The shaft under the current or power that a speed drive gave it. On a dry shaft a measured torque is a load.
fn shaft_alone(one: &Series, rig: &Rig, speed_driven: bool) -> Option<Series> {
    if rig.amplifier.kind != AmplifierKind::Speed {
        return None;
    }
    let commanded = matches!(choose_driving(one, rig, speed_driven), Some(Driving::Command(_)));
    let left_out = |name: &&str| rig.propeller.is_some() || *name != "torque_n_m";
    let names: Vec<&str> = UNDER_THE_COMMAND.into_iter().filter(left_out).collect();
    let shaft = without(one, &names);
    let driven = matches!(choose_driving(&shaft, rig, false), Some(Driving::Current | Driving::Power));
    (commanded && driven).then_some(shaft)
}

fn without(one: &Series, names: &[&str]) -> Series {
    let kept = one.columns.iter().filter(|column| !names.contains(&column.0.as_str()));
    Series { name: one.name.clone(), time_s: one.time_s.clone(), columns: kept.cloned().collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(kind: &str, columns: &[&str]) -> Vec<Vec<String>> {
        let rig = format!(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n[amplifier]\nkind = \"{kind}\"\n"
        );
        let wave = |shift: usize| (0..100).map(|k| ((k + shift) as f64 * 0.1).sin()).collect::<Vec<f64>>();
        let columns = columns.iter().enumerate().map(|(k, name)| ((*name).to_owned(), wave(k))).collect();
        let time_s = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let series = [Series { name: "log".into(), time_s, columns }];
        let both = experiments(&series, &Rig::from_toml(&rig).unwrap(), false);
        both.iter().map(|one| one.read.columns.iter().map(|column| column.0.clone()).collect()).collect()
    }

    #[test]
    fn a_speed_drive_that_tells_its_current_is_two_experiments() {
        let columns = ["speed_cmd_rad_s", "shaft_speed_rad_s", "current_a", "thrust_n"];
        let both = names("speed", &columns);
        assert_eq!(both[0], ["speed_cmd_rad_s", "shaft_speed_rad_s", "thrust_n"]);
        assert_eq!(both[1], ["shaft_speed_rad_s", "current_a"]);
        assert_eq!(both.len(), 2);
        assert_eq!(names("current", &columns).len(), 1, "a current drive's command makes the current");
        assert_eq!(names("speed", &columns[..2]).len(), 1, "nobody knows the current");
        assert_eq!(names("speed", &columns[1..]).len(), 1, "nobody knows the command");
    }
}
