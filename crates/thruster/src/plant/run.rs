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
    simulate_each(plant, stimulus, |_, sensed| rows.push(*sensed));
    Response { rows }
}

/// Steps the plant through all ticks and hands every log instant's number and what the sensors show on.
pub fn simulate_each<T: Real>(
    plant: &mut Plant<T>,
    stimulus: &Stimulus,
    mut show: impl FnMut(usize, &Sensed<T>),
) {
    let mut next = stimulus.logs.iter().enumerate().peekable();
    // An instant on the grid shows the state before that tick's command acts.
    while let Some((row, _)) = next.next_if(|(_, (tick, part))| *tick == 0 && *part == 0.0) {
        show(row, &plant.sensed());
    }
    for (i, tick) in stimulus.ticks.iter().enumerate() {
        let Some((_, (at, part))) = next.peek() else { break };
        let before = (*at == i && *part > 0.0).then(|| plant.sensed());
        plant.step(tick);
        while let Some((row, (_, part))) =
            next.next_if(|(_, (at, part))| *at == i && *part > 0.0 || *at == i + 1 && *part == 0.0)
        {
            match &before {
                Some(before) if *part > 0.0 => show(row, &before.between(&plant.sensed(), *part)),
                _ => show(row, &plant.sensed()),
            }
        }
    }
    // Instants past the last tick see the last state.
    for (row, _) in next {
        show(row, &plant.sensed());
    }
}
