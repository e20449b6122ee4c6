//! When was each sensor read? A log says it to its own grain only.
//!
//! Controller, sensors and logger take turns within a control tick, and nobody writes down in which order: a
//! sample may belong to an instant up to a tick before or after its stamp. A sensor slower than the log shows
//! each sample at the next row. Such a shift is constant over a recording, so it is one number a channel with
//! a narrow prior, not noise; left out, it would look like a lag or a delay of physics.

use kort_thruster::plant::Sensed;
use kort_thruster::real::Real;

use crate::data::{Driving, Prepared, Response};
use crate::hypothesis::{Free, Target};

/// What the sensors show at a log instant, and just before it.
pub struct Instant<'a, T> {
    /// At the instant.
    pub now: &'a Sensed<T>,
    /// At the two ends of the step of the simulation that it lies in.
    pub step: (&'a Sensed<T>, &'a Sensed<T>),
    /// Length of that step, s.
    pub step_s: f64,
    /// At the log instant before.
    pub last_row: &'a Sensed<T>,
    /// Time since then, s.
    pub row_s: f64,
    /// Whether every control period is logged.
    pub every_period: bool,
}

impl<T: Real> Instant<'_, T> {
    /// Rate of change of a response, over the last row for a slow sensor, else over the step; for a speed that is a bare
    /// difference of counts, from its mean over the control period to its end. A rig that states the counts does not say whether
    /// its drive shows that mean or the speed of an instant: half a period earlier it is exactly that, steps of the command
    /// included, across which the rate over a step would not tell. Where not every period is logged it is the lesser part of
    /// what is not known of the instant.
    pub fn rate(&self, response: Response, slow: bool) -> T {
        if let (Response::ShaftSpeed, false, true, Some(rate)) =
            (response, slow, self.every_period, self.now.since_mean_rad_s2)
        {
            return rate;
        }
        let (from, to, span) = if slow {
            (self.last_row, self.now, self.row_s)
        } else {
            (self.step.0, self.step.1, self.step_s)
        };
        (response.of(to) - response.of(from)) / span
    }
}

/// Delays of all channels.
pub struct Delays<T>([Option<(T, bool)>; Response::ALL.len()]);

impl<T: Real> Delays<T> {
    /// Those among the free numbers of a hypothesis.
    pub fn of(free: &[Free], values: &[T]) -> Self {
        let mut all = [None; Response::ALL.len()];
        for (free, value) in free.iter().zip(values) {
            if let Target::Sampling { response, slow } = free.target {
                all[response as usize] = Some((*value, slow));
            }
        }
        Self(all)
    }

    /// A response as it was sampled.
    pub fn sampled(&self, response: Response, instant: &Instant<T>) -> T {
        let now = response.of(instant.now);
        match self.0[response as usize] {
            Some((delay, slow)) => now - delay * instant.rate(response, slow),
            None => now,
        }
    }
}

/// A free number for every channel of the recordings.
pub fn free(recordings: &[Prepared]) -> Vec<Free> {
    Response::ALL
        .into_iter()
        .filter_map(|response| {
            let grains = recordings.iter().filter_map(|r| grain(r, response));
            // The coarsest of several recordings.
            let (slow, grain_s) = grains.max_by(|a, b| a.1.total_cmp(&b.1))?;
            // Anywhere within the grain: before the stamp where the sensor is slow, on either side else. A command
            // acts up to a tick before or after its own stamp, which shifts all that answers.
            let (low, high) = if slow { (0.0, grain_s) } else { (-grain_s, grain_s) };
            let command_s = recordings.iter().map(command_grain_s).fold(0.0, f64::max);
            let width_s = (high - low).hypot(2.0 * command_s);
            Some(Free {
                target: Target::Sampling { response, slow },
                name: "sampling_delay_s",
                unit: "s",
                stated: false,
                mean: 0.5 * (low + high),
                sigma: width_s / 12.0_f64.sqrt(),
                low: low - command_s,
                high: high + command_s,
                acts: None,
            })
        })
        .collect()
}

/// How far a logged command may lie from when it acted, s.
fn command_grain_s(recording: &Prepared) -> f64 {
    if matches!(recording.driving, Driving::Command(_)) { recording.grain_s.command_s } else { 0.0 }
}

/// Whether a channel is slower than the log, and how far its samples may lie from their stamps, s.
fn grain(recording: &Prepared, response: Response) -> Option<(bool, f64)> {
    let channel = recording.channels.iter().find(|c| c.response == response)?;
    let times: Vec<f64> = channel.rows.iter().map(|row| recording.time_s[*row]).collect();
    let row_s = crate::spectrum::median_interval(&recording.time_s);
    let slow = crate::spectrum::is_slow(crate::spectrum::median_interval(&times), row_s);
    Some((slow, if slow { row_s } else { recording.grain_s.sample_s }))
}

#[cfg(test)]
mod tests {
    use kort_thruster::plant::Sensed;
    use kort_thruster::rig::Rig;

    use super::{Delays, Instant, free};
    use crate::data::{Prepared, Response, Series};
    use crate::hypothesis::{Free, Target};

    /// A speed at every row of 10 ms and a thrust at every fifth, under a current.
    fn numbers() -> Vec<Free> {
        let rows = 400;
        let wave = |k: usize| (k as f64 * 0.1).sin();
        let columns = vec![
            ("current_cmd_a".into(), (0..rows).map(wave).collect()),
            ("shaft_speed_rad_s".into(), (0..rows).map(wave).collect()),
            (
                "thrust_n".into(),
                (0..rows).map(|k| if k.is_multiple_of(5) { wave(k) } else { f64::NAN }).collect(),
            ),
        ];
        let rig =
            Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let time_s = (0..rows).map(|k| 0.01 * k as f64).collect();
        free(&[Prepared::new(&Series { name: "log".into(), time_s, columns }, &rig, false).unwrap()])
    }

    #[test]
    fn a_channel_is_read_within_its_grain() {
        let numbers = numbers();
        let bounds = |response| {
            let one = numbers
                .iter()
                .find(|f| matches!(f.target, Target::Sampling { response: r, .. } if r == response));
            one.map(|f| (f.low, f.high)).unwrap()
        };
        let (low, high) = bounds(Response::ShaftSpeed);
        assert!(
            low == -high && high <= 0.004,
            "within a control tick of its own and one of the command: {low} to {high}"
        );
        let (low, high) = bounds(Response::Thrust);
        assert!(
            (low + 0.002).abs() < 1e-9 && (high - 0.012).abs() < 1e-9,
            "a slow sensor, within a row before: {low} to {high}"
        );
    }

    #[test]
    fn a_late_sample_lies_behind_by_its_delay_times_the_rate() {
        let at = |speed| Sensed { shaft_speed_rad_s: speed, ..Sensed::default() };
        let (now, before, last_row) = (at(5.0), at(4.0), at(1.0));
        let instant = Instant {
            now: &now,
            step: (&before, &now),
            step_s: 0.002,
            last_row: &last_row,
            row_s: 0.01,
            every_period: true,
        };
        let of = |slow| {
            let target = Target::Sampling { response: Response::ShaftSpeed, slow };
            let late = vec![Free { target, ..numbers()[0].clone() }];
            Delays::of(&late, &[0.001]).sampled(Response::ShaftSpeed, &instant)
        };
        assert!((of(false) - 4.5_f64).abs() < 1e-12);
        assert!((of(true) - 4.6_f64).abs() < 1e-12);
        assert_eq!(Delays::<f64>::of(&[], &[]).sampled(Response::ShaftSpeed, &instant), 5.0);
        // A bare difference of counts: half a tick on it is the speed at the tick's end, however it came there.
        let now = Sensed { true_speed_rad_s: 5.3, since_mean_rad_s2: Some(300.0), ..now };
        let free = vec![Free {
            target: Target::Sampling { response: Response::ShaftSpeed, slow: false },
            ..numbers()[0].clone()
        }];
        let shown =
            Delays::of(&free, &[-0.001]).sampled(Response::ShaftSpeed, &Instant { now: &now, ..instant });
        assert!((shown - now.true_speed_rad_s).abs() < 1e-12, "{shown}");
    }
}
