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
            rows.push(if *part == 0.0 { after } else { between(&before, &after, *part) });
        }
        before = after;
    }
    // Instants past the last tick see the last state.
    rows.resize(stimulus.logs.len(), before);
    Response { rows }
}

fn between(a: &Sensed, b: &Sensed, part: f64) -> Sensed {
    let mix = |x: f64, y: f64| x + (y - x) * part;
    Sensed {
        current_a: mix(a.current_a, b.current_a),
        shaft_angle_rad: mix(a.shaft_angle_rad, b.shaft_angle_rad),
        shaft_speed_rad_s: mix(a.shaft_speed_rad_s, b.shaft_speed_rad_s),
        thrust_n: mix(a.thrust_n, b.thrust_n),
        torque_n_m: mix(a.torque_n_m, b.torque_n_m),
        flow_m_s: mix(a.flow_m_s, b.flow_m_s),
        true_speed_rad_s: mix(a.true_speed_rad_s, b.true_speed_rad_s),
        true_thrust_n: mix(a.true_thrust_n, b.true_thrust_n),
        supply_v: mix(a.supply_v, b.supply_v),
    }
}
