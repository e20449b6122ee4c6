//! What plots need beyond the report: every channel measured, as the baseline has it, and explained.

use kort_identify::simulate::{Problem, Stack};

use crate::locate::since_edge;

/// Curves of a diagnosis.
pub struct Traces {
    /// One entry a recording and channel.
    pub channels: Vec<Trace>,
}

/// One channel of one recording, measured and simulated.
pub struct Trace {
    /// Recording's name.
    pub recording: String,
    /// What drives the model, where it is a recording's second experiment.
    pub under: Option<&'static str>,
    /// Column.
    pub channel: &'static str,
    /// Time of each sample, s.
    pub time_s: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// Simulated by the re-fitted baseline.
    pub baseline: Vec<f64>,
    /// Simulated with everything found.
    pub explained: Vec<f64>,
    /// Shaft speed simulated at each sample, rad/s.
    pub shaft_speed_rad_s: Vec<f64>,
    /// Time since the last step of the command at each sample, s; infinite before the first.
    pub since_step_s: Vec<f64>,
}

/// From the residuals (measured less simulated) before and after, and the simulated speed at each row.
pub fn traces(problem: &Problem, before: &Stack, after: &Stack, speed: &[Vec<f64>]) -> Traces {
    let mut channels = Vec::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        let since = since_edge(recording);
        for (c, channel) in recording.channels.iter().enumerate() {
            // A run-in is left out: the state before the first row is not known.
            let masked = &problem.masked[r];
            let from = channel.rows.iter().position(|k| !masked[*k]).unwrap_or(0);
            let from = if masked[..channel.rows[from]].iter().all(|m| *m) { from } else { 0 };
            let minus = |residual: &[f64]| {
                channel.values[from..].iter().zip(&residual[from..]).map(|(m, e)| m - e).collect()
            };
            channels.push(Trace {
                recording: recording.name.clone(),
                under: recording.second.then(|| recording.driving.column()),
                channel: channel.response.name(),
                time_s: channel.rows[from..].iter().map(|k| recording.time_s[*k]).collect(),
                measured: channel.values[from..].to_vec(),
                baseline: minus(&before[r][c]),
                explained: minus(&after[r][c]),
                shaft_speed_rad_s: channel.rows[from..].iter().map(|k| speed[r][*k]).collect(),
                since_step_s: channel.rows[from..].iter().map(|k| since[*k]).collect(),
            });
        }
    }
    Traces { channels }
}
