//! What a rig leaves open of how its log is to be read: each reading is tried on the baseline, and the likelier stays.

use kort_thruster::rig::Rig;

use crate::data::{Prepared, Series, loaded, row_means};
use crate::held;
use crate::hypothesis::Hypothesis;
use crate::lag_on_command::{self, lag_on_command};
use crate::simulate::Problem;

/// Steps of a fit of the baseline under one reading: enough for stated numbers that are honestly rough.
const STEPS: usize = 8;
/// Odds beyond which a reading takes the place of the one that the docs say: twenty to one.
const PLAINLY: f64 = 20.0;

/// A way to read recordings, and the baseline under it.
struct Reading<'a> {
    recordings: Vec<Prepared>,
    problem: Problem<'a>,
    baseline: Hypothesis,
    /// Of the baseline, once somebody asked.
    cost: Option<f64>,
}

impl<'a> Reading<'a> {
    fn new(recordings: Vec<Prepared>, compared: impl Fn(Vec<Prepared>) -> (Problem<'a>, Hypothesis)) -> Self {
        let (problem, baseline) = compared(recordings.clone());
        Self { recordings, problem, baseline, cost: None }
    }

    fn cost(&mut self) -> f64 {
        let (problem, baseline) = (&self.problem, &self.baseline);
        *self.cost.get_or_insert_with(|| problem.settle_from_stated(baseline, STEPS).cost())
    }

    /// Whether another reading took its place, by these odds.
    fn gave_way(&mut self, mut other: Self, odds: f64) -> bool {
        let better = other.cost() + 2.0 * odds.ln() < self.cost();
        if better {
            *self = other;
        }
        better
    }
}

/// The problem and its baseline under the likeliest reading, and what was taken for true.
pub fn likeliest<'a>(
    recordings: Vec<Prepared>,
    series: &[Series],
    rig: &Rig,
    compared: impl Fn(Vec<Prepared>) -> (Problem<'a>, Hypothesis),
) -> (Problem<'a>, Hypothesis, Vec<String>) {
    let read = |recordings| Reading::new(recordings, &compared);
    let (mut reading, mut words, mut load) = (read(recordings), Vec::new(), None);
    for sign in loaded::SIGNS {
        let Some(loaded) = loaded::loaded(&reading.recordings, series, rig, sign) else { break };
        if reading.gave_way(read(loaded), 1.0) {
            load = Some(loaded::words(sign));
        }
    }
    words.extend(load);
    if held::held(&reading.recordings, rig).is_some_and(|held| reading.gave_way(read(held), 1.0)) {
        words.push(held::words(&reading.recordings));
    }
    let means = row_means::row_means(&reading.recordings, series);
    if means.is_some_and(|means| reading.gave_way(read(means), PLAINLY)) {
        words.push(row_means::words().into());
    }
    let lagging = lag_on_command(&reading.recordings, rig);
    if lagging.is_some_and(|lagging| reading.gave_way(read(lagging), PLAINLY)) {
        words.push(lag_on_command::words().into());
    }
    (reading.problem, reading.baseline, words)
}

#[cfg(test)]
pub mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use crate::data::{Prepared, Series};
    use crate::noise::Criterion;
    use crate::setup::Setup;

    /// Whether a log with rows at this interval is read so, and whether the report says so in these words.
    pub fn read_and_said<const N: usize>(
        rig: &str,
        row_s: f64,
        columns: [(&str, Vec<f64>); N],
        read: fn(&Prepared) -> bool,
        words: &str,
    ) -> (bool, bool) {
        let time_s = (0..columns[0].1.len()).map(|k| row_s * k as f64).collect();
        let columns = columns.map(|(name, column)| (name.to_owned(), column)).into();
        let log = Series { name: "log".into(), time_s, columns };
        let criterion =
            Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 10.0, timing_s: 0.001 };
        let rig = Rig::from_toml(rig).unwrap();
        let setup = Setup::new(&[log], &rig, ModelName::Model2, criterion).unwrap();
        (read(&setup.problem.recordings[0]), setup.notes.iter().any(|note| note.contains(words)))
    }
}
