//! Where inside a log interval did each step of the command happen?
//!
//! Commands change on control ticks, the log samples more slowly: a step lies anywhere in the
//! interval before the row that first shows it. Each edge takes the tick at which the model fits
//! the rows after it best; a wrong tick would look like a lag or a delay.

use crate::data::{Driving, Prepared};
use crate::fit::{Hypothesis, Problem};

/// Rows after an edge that decide where it was.
const WINDOW_ROWS: usize = 12;

impl Problem<'_> {
    /// Places the edges of every recording for a hypothesis; true if any moved.
    pub fn place_edges(&mut self, hypothesis: &Hypothesis, values: &[f64]) -> bool {
        let longest =
            self.recordings.iter().map(|r| if r.edges.is_empty() { 1 } else { r.ticks_per_row }).max();
        let before: Vec<Vec<usize>> = self.recordings.iter().map(offsets).collect();
        // Cost of every edge for every tick it may lie on, all edges moved together.
        let mut costs: Vec<Vec<Vec<f64>>> = Vec::new();
        for ticks in 0..longest.unwrap_or(1) {
            for recording in &mut self.recordings {
                if recording.driving != Driving::Speed && ticks < recording.ticks_per_row {
                    recording.edges.iter_mut().for_each(|e| e.ticks_before = ticks);
                    recording.lay_command();
                }
            }
            let residual = self.residual(&self.respond(hypothesis, values));
            costs.push(
                self.recordings
                    .iter()
                    .enumerate()
                    .map(|(r, recording)| {
                        edge_costs(recording, &residual[r], |c, k| self.whiteners[r][c].level()[k])
                    })
                    .collect(),
            );
        }
        let mut moved = false;
        for (r, recording) in self.recordings.iter_mut().enumerate() {
            if recording.driving == Driving::Speed || recording.edges.is_empty() {
                continue;
            }
            for (e, edge) in recording.edges.iter_mut().enumerate() {
                let best = (0..recording.ticks_per_row)
                    .min_by(|a, b| costs[*a][r][e].total_cmp(&costs[*b][r][e]))
                    .unwrap_or(0);
                edge.ticks_before = best;
                moved |= best != before[r][e];
            }
            recording.lay_command();
        }
        moved
    }
}

fn offsets(recording: &Prepared) -> Vec<usize> {
    recording.edges.iter().map(|e| e.ticks_before).collect()
}

fn edge_costs(recording: &Prepared, residual: &[Vec<f64>], level: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut costs = vec![0.0; recording.edges.len()];
    for (c, channel) in recording.channels.iter().enumerate() {
        for (e, edge) in recording.edges.iter().enumerate() {
            let next = recording.edges.get(e + 1).map_or(usize::MAX, |n| n.row);
            let end = (edge.row + WINDOW_ROWS).min(next);
            let from = channel.rows.partition_point(|r| *r < edge.row);
            let to = channel.rows.partition_point(|r| *r < end);
            costs[e] += (from..to).map(|k| (residual[c][k] / level(c, k)).powi(2)).sum::<f64>();
        }
    }
    costs
}
