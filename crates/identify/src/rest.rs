//! What the sensors read before anything moves.
//!
//! A constant is one fact about a whole recording, and weighs little beside how far equations may err. At rest they do not
//! err: without a command no model has thrust, torque, current or flow, and what a sensor reads is its own. So the mean
//! reading before the first command is a line of its own, held to no form error: a forgotten tare shows there.

use crate::data::{Channel, Driving, Prepared, Response};

/// Fewest samples whose mean tells.
const FEWEST: usize = 20;

impl Prepared {
    /// Samples of a channel, of those in use, from before the first command; none where the machine may move by then or the
    /// model has something to say.
    pub(crate) fn at_rest(&self, channel: &Channel, masked: &[bool]) -> Vec<usize> {
        let reads_nothing = match channel.response {
            Response::Thrust | Response::Torque | Response::Current | Response::Flow => true,
            Response::ShaftSpeed | Response::ShaftAngle => false,
        };
        let still = self.stimulus.ticks.first().is_some_and(|tick| tick.ambient_m_s == (0.0, 0.0));
        if !matches!(self.driving, Driving::Command(_)) || !reads_nothing || !still || self.start[0] != 0.0 {
            return Vec::new();
        }
        let rows = self.command.iter().take_while(|c| **c == 0.0).count();
        let samples: Vec<usize> = (0..channel.rows.len())
            .filter(|k| channel.rows[*k] < rows && !masked[channel.rows[*k]])
            .collect();
        if samples.len() < FEWEST { Vec::new() } else { samples }
    }
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    const ROWS: usize = 1000;
    const CRITERION: Criterion =
        Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };

    /// What is read at rest, N, on a stand whose force cell shows 2 N too much, with so many rows before the first command.
    fn readings(rows_at_rest: usize) -> Vec<f64> {
        let rig =
            Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let moving = |k: usize| if k < rows_at_rest { 0.0 } else { (0.05 * (k - rows_at_rest) as f64).sin() };
        let noise = |k: usize| 0.1 * ((k * k * 7919) as f64 * 0.37).sin();
        let columns = vec![
            ("current_cmd_a".into(), (0..ROWS).map(|k| 6.0 * moving(k)).collect()),
            ("shaft_speed_rad_s".into(), (0..ROWS).map(|k| 20.0 * moving(k)).collect()),
            ("thrust_n".into(), (0..ROWS).map(|k| 2.0 + 90.0 * moving(k) + noise(k)).collect()),
        ];
        let time_s = (0..ROWS).map(|k| 0.01 * k as f64).collect();
        let series = [Series { name: "log".into(), time_s, columns }];
        let Setup { problem, baseline, .. } =
            Setup::new(&series, &rig, ModelName::Model2, CRITERION).unwrap();
        let lines = problem.residual_lines(&baseline, &baseline.start);
        assert_eq!(problem.spectrum.bands.last().unwrap().lines.end, problem.spectrum.lines);
        let scale = problem.recordings[0].channels.iter().find(|c| c.response.name() == "thrust_n").unwrap();
        let rests = problem.spectrum.bands.iter().zip(problem.floor.levels()).filter(|(band, _)| band.rest);
        rests
            .map(|(band, floor)| {
                assert!(floor.sqrt() * scale.full_scale < 0.1, "as good as the mean is known: {floor}");
                lines[band.lines.start] * scale.full_scale
            })
            .collect()
    }

    #[test]
    fn a_forgotten_tare_is_a_line_of_its_own() {
        let read = readings(100);
        assert!(matches!(read[..], [thrust] if (thrust - 2.0).abs() < 0.05), "{read:?}");
        assert!(readings(10).is_empty(), "too few samples");
    }
}
