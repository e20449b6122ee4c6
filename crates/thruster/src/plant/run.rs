//! Runs a plant over prepared inputs and collects the response at log instants.

use super::{Plant, Sensed, Tick};
use crate::real::Real;

/// Inputs on the control grid and the log instants, as ticks after the start.
#[derive(Clone, Debug, Default)]
pub struct Stimulus {
    /// One entry a control tick.
    pub ticks: Vec<Tick>,
    /// Log instants as (tick, part of the tick after it in [0, 1)).
    pub logs: Vec<(usize, f64)>,
}

/// What the sensors show at the log instants; a column a channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response<T = f64> {
    /// One entry a log instant.
    pub rows: Vec<Sensed<T>>,
}

/// Steps the plant through all ticks.
pub fn simulate<T: Real>(plant: &mut Plant<T>, stimulus: &Stimulus) -> Response<T> {
    let mut rows = Vec::with_capacity(stimulus.logs.len());
    let mut next = stimulus.logs.iter().peekable();
    // An instant on the grid shows the state before that tick's command acts.
    while next.next_if(|(tick, part)| *tick == 0 && *part == 0.0).is_some() {
        rows.push(*plant.sensed());
    }
    for (i, tick) in stimulus.ticks.iter().enumerate() {
        let Some((at, part)) = next.peek() else { break };
        // Numbers with derivatives are large: copied only where an instant lies within the tick.
        let before = (*at == i && *part > 0.0).then(|| *plant.sensed());
        plant.step(tick);
        let after = plant.sensed();
        while let Some((_, part)) =
            next.next_if(|(at, part)| *at == i && *part > 0.0 || *at == i + 1 && *part == 0.0)
        {
            rows.push(before.filter(|_| *part > 0.0).map_or(*after, |before| before.between(after, *part)));
        }
    }
    // Instants past the last tick see the last state.
    rows.resize(stimulus.logs.len(), *plant.sensed());
    Response { rows }
}
