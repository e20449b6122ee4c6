//! Where inside a log interval did each step of the command happen?
//!
//! Commands change on control ticks, the log samples more slowly: a step lies anywhere in the interval
//! before the row that first shows it. Each takes the tick at which the hypothesis fits the rows after it
//! best; a wrong tick would look like a lag or a delay.

use std::sync::Arc;

use crate::data::{Driving, Prepared};
use crate::fit::Fit;
use crate::hypothesis::{Hypothesis, Inputs};
use crate::simulate::Problem;

/// Rows after an edge that decide where it was.
const WINDOW_ROWS: usize = 12;

impl Problem<'_> {
    /// The command with its steps where they suit a fit best; none if that is where they are.
    pub fn place_edges(&self, fit: &Fit) -> Option<Inputs> {
        let movable =
            |r: &Prepared| r.driving != Driving::Speed && !r.edges.is_empty() && r.ticks_per_row > 1;
        let most = self.recordings.iter().filter(|r| movable(r)).map(|r| r.ticks_per_row).max()?;
        let level = self.levels(fit);
        // Cost of every edge for every tick it may lie on, all edges moved together.
        let costs: Vec<Vec<Vec<f64>>> = (0..most)
            .map(|ticks| {
                let edges =
                    self.recordings.iter().map(|r| vec![ticks.min(r.ticks_per_row - 1); r.edges.len()]);
                let inputs = Arc::new(Inputs::new(&self.recordings, edges.collect()));
                let residual = self.residual(&Hypothesis { inputs, ..fit.hypothesis.clone() }, &fit.values);
                let of = |(r, one): (usize, &Prepared)| edge_costs(one, &residual[r], &level[r]);
                self.recordings.iter().enumerate().map(of).collect()
            })
            .collect();
        let mut edges = fit.hypothesis.inputs.edges.clone();
        for (r, recording) in self.recordings.iter().enumerate().filter(|(_, r)| movable(r)) {
            for (e, before) in edges[r].iter_mut().enumerate() {
                *before = (0..recording.ticks_per_row)
                    .min_by(|a, b| costs[*a][r][e].total_cmp(&costs[*b][r][e]))
                    .unwrap_or(0);
            }
        }
        (edges != fit.hypothesis.inputs.edges).then(|| Inputs::new(&self.recordings, edges))
    }

    /// Noise of each channel from one sample to the next, in its own unit.
    fn levels(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let mut tops = self
            .spectrum
            .bands
            .iter()
            .zip(&fit.noise.level)
            .filter(|(band, _)| !band.continues)
            .map(|(_, level)| level.sqrt());
        self.recordings
            .iter()
            .map(|r| r.channels.iter().map(|c| tops.next().unwrap_or(1.0) * c.full_scale).collect())
            .collect()
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
