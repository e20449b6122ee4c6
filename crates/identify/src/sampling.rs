//! When was each sensor read? A log says it to its own grain only.
//!
//! Controller, sensors and logger take turns within a control tick, and nobody writes down in which order: a
//! sample may belong to an instant up to a tick before or after its stamp. A sensor slower than the log shows
//! each sample at the next row, and may have taken its mean since the last one. Such a shift is constant over a recording, so it is
//! one number a channel with a narrow prior, not noise; left out, it would look like a lag or a delay of physics.

use kort_thruster::plant::Sensed;
use kort_thruster::real::Real;

use crate::averages::Averages;
use crate::data::{Driving, Prepared, Response};
use crate::hypothesis::{Free, Target};

/// What the sensors show at a log instant, and just before it.
pub struct Instant<'a, T> {
    /// The instant, s.
    pub time_s: f64,
    /// At the instant.
    pub now: &'a Sensed<T>,
    /// At the two ends of the step of the simulation that it lies in.
    pub step: (&'a Sensed<T>, &'a Sensed<T>),
    /// Length of that step, s.
    pub step_s: f64,
    /// Whether every control period is logged.
    pub every_period: bool,
    /// What is read as a mean.
    pub averages: &'a Averages<T>,
}

impl<T: Real> Instant<'_, T> {
    /// Rate of change of a response over the step; for a speed that is a bare difference of counts, from its mean over the control
    /// period to its end. A rig that states the counts does not say whether its drive shows that mean or the speed of an
    /// instant: half a period earlier it is exactly that, steps of the command included, across which the rate over a step
    /// would not tell. Where not every period is logged it is the lesser part of what is not known of the instant.
    fn rate(&self, response: Response) -> T {
        if let (Response::ShaftSpeed, true, Some(rate)) =
            (response, self.every_period, self.now.since_mean_rad_s2)
        {
            return rate;
        }
        (response.of(self.step.1) - response.of(self.step.0)) / self.step_s
    }

    /// Changes of what is shown of a response with the delay of its sampling and with the time over which its mean is taken, 1/s.
    pub fn changes(&self, response: Response) -> [T; 2] {
        self.averages
            .reading(response, self.time_s)
            .map_or_else(|| [-self.rate(response), T::ZERO], |shown| [shown.by_delay, shown.by_window])
    }
}

/// Delays of all channels.
pub struct Delays<T>([Option<T>; Response::ALL.len()]);

impl<T: Real> Delays<T> {
    /// Those among the free numbers of a hypothesis.
    pub fn of(free: &[Free], values: &[T]) -> Self {
        let mut all = [None; Response::ALL.len()];
        for (free, value) in free.iter().zip(values) {
            if let Target::Sampling { response } = free.target {
                all[response as usize] = Some(*value);
            }
        }
        Self(all)
    }

    /// A response as it was sampled.
    pub fn sampled(&self, response: Response, instant: &Instant<T>) -> T {
        if let Some(shown) = instant.averages.reading(response, instant.time_s) {
            return shown.mean;
        }
        let now = response.of(instant.now);
        self.0[response as usize].map_or(now, |delay| now - delay * instant.rate(response))
    }
}

/// Shortest mean that is tried, as a share of the longest: an instant.
const INSTANT: f64 = 0.01;

/// Free numbers for every channel of the recordings: when it was read, and over how long where its sensor is slow.
pub fn free(recordings: &[Prepared]) -> Vec<Free> {
    let averaging = Response::ALL.into_iter().filter_map(|response| {
        let slow = recordings.iter().flat_map(|r| &r.channels).filter(|c| c.response == response);
        // Up to all the time since the sample before.
        let longest_s = slow.filter_map(|channel| channel.slow_s).max_by(f64::total_cmp)?;
        Some(Free {
            target: Target::Averaging { response },
            name: "averaging_s",
            unit: "s",
            stated: false,
            mean: 0.5 * longest_s,
            sigma: longest_s / 12.0_f64.sqrt(),
            low: INSTANT * longest_s,
            high: longest_s,
            acts: None,
        })
    });
    let sampling = Response::ALL.into_iter().filter_map(|response| {
        let grains = recordings.iter().filter_map(|r| grain(r, response));
        // The coarsest of several recordings.
        let (slow, grain_s) = grains.max_by(|a, b| a.1.total_cmp(&b.1))?;
        // Anywhere within the grain: before the stamp where the sensor is slow, on either side else. A command
        // acts up to a tick before or after its own stamp, which shifts all that answers.
        let (low, high) = if slow { (0.0, grain_s) } else { (-grain_s, grain_s) };
        let command_s = recordings.iter().map(command_grain_s).fold(0.0, f64::max);
        let width_s = (high - low).hypot(2.0 * command_s);
        Some(Free {
            target: Target::Sampling { response },
            name: "sampling_delay_s",
            unit: "s",
            stated: false,
            mean: 0.5 * (low + high),
            sigma: width_s / 12.0_f64.sqrt(),
            low: low - command_s,
            high: high + command_s,
            acts: None,
        })
    });
    sampling.chain(averaging).collect()
}

/// How far a logged command may lie from when it acted, s.
fn command_grain_s(recording: &Prepared) -> f64 {
    if matches!(recording.driving, Driving::Command(_)) { recording.grain_s.command_s } else { 0.0 }
}

/// Whether a channel is slower than the log, and how far its samples may lie from their stamps, s.
fn grain(recording: &Prepared, response: Response) -> Option<(bool, f64)> {
    let channel = recording.channels.iter().find(|c| c.response == response)?;
    let row_s = crate::spectrum::median_interval(&recording.time_s);
    let slow = channel.slow_s.is_some();
    Some((slow, if slow { row_s } else { recording.grain_s.sample_s }))
}

#[cfg(test)]
mod tests {
    use kort_thruster::plant::Sensed;
    use kort_thruster::rig::Rig;

    use super::{Delays, Instant, free};
    use crate::averages::Averages;
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
            let one = numbers.iter().find(|f| f.target == Target::Sampling { response });
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
    fn a_slow_sensor_may_take_its_mean_since_its_last_sample() {
        let numbers = numbers();
        let window = |response| numbers.iter().find(|f| f.target == Target::Averaging { response });
        assert!(window(Response::ShaftSpeed).is_none());
        assert!((window(Response::Thrust).unwrap().high - 0.05).abs() < 1e-9);
    }

    #[test]
    fn a_late_sample_lies_behind_by_its_delay_times_the_rate() {
        let at = |speed| Sensed { shaft_speed_rad_s: speed, ..Sensed::default() };
        let (now, before) = (at(5.0), at(4.0));
        let averages = Averages::of(&[], &[], &[]);
        let instant = Instant {
            time_s: 0.01,
            now: &now,
            step: (&before, &now),
            step_s: 0.002,
            every_period: true,
            averages: &averages,
        };
        let target = Target::Sampling { response: Response::ShaftSpeed };
        let free = vec![Free { target, ..numbers()[0].clone() }];
        assert!(
            (Delays::of(&free, &[0.001]).sampled(Response::ShaftSpeed, &instant) - 4.5_f64).abs() < 1e-12
        );
        assert_eq!(Delays::<f64>::of(&[], &[]).sampled(Response::ShaftSpeed, &instant), 5.0);
        // A bare difference of counts: half a tick on it is the speed at the tick's end, however it came there.
        let now = Sensed { true_speed_rad_s: 5.3, since_mean_rad_s2: Some(300.0), ..now };
        let shown =
            Delays::of(&free, &[-0.001]).sampled(Response::ShaftSpeed, &Instant { now: &now, ..instant });
        assert!((shown - now.true_speed_rad_s).abs() < 1e-12, "{shown}");
    }
}
