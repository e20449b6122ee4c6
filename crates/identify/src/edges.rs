//! Where inside a log interval did each step of the command happen?
//!
//! Commands change on control ticks, the log samples more slowly: a step lies anywhere in the interval
//! before the row that first shows it. Each takes the tick at which the hypothesis fits the rows after it
//! best; a wrong tick would look like a lag or a delay.

use std::sync::Arc;

use crate::data::{Channel, Driving, Prepared};
use crate::fit::Fit;
use crate::hypothesis::{Hypothesis, Inputs};
use crate::simulate::Problem;

/// Rows after an edge that decide where it was.
const WINDOW_ROWS: usize = 12;
/// Places tried for a step that fell into a gap of the log.
const MOST_PLACES: usize = 24;
/// Least noise of a channel over its full scale: rounding of a log.
const LEAST: f64 = 1e-4;

impl Problem<'_> {
    /// The command with its steps where they suit a fit best; none if that is where they are.
    pub fn place_edges(&self, fit: &Fit) -> Option<Inputs> {
        let movable =
            |r: &Prepared| r.driving != Driving::Speed && r.edges.iter().any(|row| r.ticks_before(*row) > 1);
        let places = self.recordings.iter().filter(|r| movable(r)).map(Prepared::places).max()?;
        let level = self.levels(fit);
        // Cost of every edge for every tick it may lie on, all edges moved together.
        let costs: Vec<Vec<Vec<f64>>> = (0..places)
            .map(|place| {
                let edges = self.recordings.iter().map(|r| r.edges_at(place));
                let inputs = Arc::new(Inputs::new(&self.recordings, edges.collect()));
                let residual = self.residual(&Hypothesis { inputs, ..fit.hypothesis.clone() }, &fit.values);
                let of = |(r, one): (usize, &Prepared)| edge_costs(one, &residual[r], &level[r]);
                self.recordings.iter().enumerate().map(of).collect()
            })
            .collect();
        let mut edges = fit.hypothesis.inputs.edges.clone();
        for (r, recording) in self.recordings.iter().enumerate().filter(|(_, r)| movable(r)) {
            for (e, before) in edges[r].iter_mut().enumerate() {
                let place =
                    (0..recording.places()).min_by(|a, b| costs[*a][r][e].total_cmp(&costs[*b][r][e]));
                *before = recording.edge_at(e, place.unwrap_or(0));
            }
        }
        (edges != fit.hypothesis.inputs.edges).then(|| Inputs::new(&self.recordings, edges))
    }

    /// Noise of each channel from one sample to the next, in its own unit: its usual size, which the few samples
    /// about a misplaced step do not raise.
    fn levels(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let residual = self.residual(&fit.hypothesis, &fit.values);
        let usual = |(channel, left): (&Channel, &Vec<f64>)| {
            let mut steps: Vec<f64> = left.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
            steps.sort_by(f64::total_cmp);
            // Of normal noise the median step is 0.95 standard deviations.
            let median = steps.get(steps.len() / 2).copied().unwrap_or(0.0) / 0.95;
            median.max(LEAST * channel.full_scale)
        };
        self.recordings
            .iter()
            .zip(&residual)
            .map(|(recording, left)| recording.channels.iter().zip(left).map(usual).collect())
            .collect()
    }
}

impl Prepared {
    /// Control ticks between a row and the one before it; in a pause nothing can be placed.
    fn ticks_before(&self, row: usize) -> usize {
        if self.after_pause(row) {
            return 1;
        }
        ((self.time_s[row] - self.time_s[row - 1]) / self.tick_s).round().max(1.0) as usize
    }

    /// Places that are tried for a step: every tick of a log interval, as many in a gap.
    fn places(&self) -> usize {
        let longest = self.edges.iter().map(|row| self.ticks_before(*row)).max().unwrap_or(1);
        longest.min(self.ticks_per_row.max(MOST_PLACES))
    }

    /// Ticks before its row at which a step lies in one of its places.
    fn edge_at(&self, edge: usize, place: usize) -> usize {
        let (ticks, places) = (self.ticks_before(self.edges[edge]), self.places());
        let place = place.min(places - 1);
        if ticks <= places { place.min(ticks - 1) } else { place * (ticks - 1) / (places - 1).max(1) }
    }

    /// All steps in one of their places.
    fn edges_at(&self, place: usize) -> Vec<usize> {
        (0..self.edges.len()).map(|edge| self.edge_at(edge, place)).collect()
    }
}

fn edge_costs(recording: &Prepared, residual: &[Vec<f64>], level: &[f64]) -> Vec<f64> {
    let mut costs = vec![0.0; recording.edges.len()];
    for (c, channel) in recording.channels.iter().enumerate() {
        for (e, row) in recording.edges.iter().enumerate() {
            let next = recording.edges.get(e + 1).copied().unwrap_or(usize::MAX);
            let end = (row + WINDOW_ROWS).min(next);
            let from = channel.rows.partition_point(|r| r < row);
            let to = channel.rows.partition_point(|r| *r < end);
            costs[e] += (from..to).map(|k| (residual[c][k] / level[c]).powi(2)).sum::<f64>();
        }
    }
    costs
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use crate::data::{Prepared, Series};

    /// Steps of a command logged at 100 Hz, the second of them just after half a second without rows.
    fn prepared() -> Prepared {
        let rows: Vec<usize> = (0..400).filter(|k| !(150..200).contains(k)).collect();
        let time_s = rows.iter().map(|k| 0.01 * *k as f64).collect();
        let command: Vec<f64> = rows.iter().map(|k| if (50..200).contains(k) { 1.0 } else { -1.0 }).collect();
        let columns = vec![
            ("current_cmd_a".into(), command),
            ("shaft_speed_rad_s".into(), rows.iter().map(|k| (*k as f64).sin()).collect()),
        ];
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let rig = Rig::from_toml(rig).unwrap();
        Prepared::new(&Series { name: "log".into(), time_s, columns }, &rig, false).unwrap()
    }

    #[test]
    fn a_step_is_looked_for_on_every_tick_of_its_interval_and_all_over_a_gap() {
        let recording = prepared();
        assert_eq!(recording.edges, [50, 150]);
        let places: Vec<Vec<usize>> = (0..recording.places()).map(|p| recording.edges_at(p)).collect();
        let first: Vec<usize> = places.iter().map(|p| p[0]).collect();
        let in_gap: Vec<usize> = places.iter().map(|p| p[1]).collect();
        let ticks = recording.ticks_per_row;
        assert!(first[..ticks].iter().copied().eq(0..ticks), "{first:?}");
        assert_eq!((first.iter().max(), in_gap[0]), (Some(&(ticks - 1)), 0));
        assert_eq!(in_gap.last(), Some(&(recording.ticks_before(150) - 1)), "{in_gap:?}");
        assert!(in_gap.windows(2).all(|w| w[1] > w[0]) && in_gap.len() <= 24);
    }
}
