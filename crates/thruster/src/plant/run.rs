//! Runs a plant over prepared inputs and collects the response at log instants.

use super::{Plant, Sensed, Tick};

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
pub struct Response {
    /// One entry a log instant.
    pub rows: Vec<Sensed>,
}

/// Steps the plant through all ticks.
pub fn simulate(plant: &mut Plant, stimulus: &Stimulus) -> Response {
    let mut rows = Vec::with_capacity(stimulus.logs.len());
    let mut next = stimulus.logs.iter().peekable();
    let mut before = *plant.sensed();
    // An instant on the grid shows the state before that tick's command acts.
    while let Some((_, part)) = next.next_if(|(tick, part)| *tick == 0 && *part == 0.0) {
        debug_assert_eq!(*part, 0.0);
        rows.push(before);
    }
    for (i, tick) in stimulus.ticks.iter().enumerate() {
        if next.peek().is_none() {
            break;
        }
        plant.step(tick);
        let after = *plant.sensed();
        while let Some((_, part)) =
            next.next_if(|(at, part)| *at == i && *part > 0.0 || *at == i + 1 && *part == 0.0)
        {
            rows.push(if *part == 0.0 { after } else { before.between(&after, *part) });
        }
        before = after;
    }
    // Instants past the last tick see the last state.
    rows.resize(stimulus.logs.len(), before);
    Response { rows }
}
