//! When was each sensor read? A log says it to its own grain only.
//!
//! Controller, sensors and logger take turns within a control tick, and nobody writes down in which order: a
//! sample may belong to an instant up to a tick before or after its stamp. A sensor slower than the log shows
//! each sample at the next row. Such a shift is constant over a recording, so it is one number a channel with
//! a narrow prior, not noise; left out, it would look like a lag or a delay of physics.

use kort_thruster::plant::Sensed;
use kort_thruster::real::Real;

use crate::data::{Prepared, Response};
use crate::hypothesis::{Free, Target};

/// What the sensors show at a log instant, and just before it.
pub struct Instant<'a, T> {
    /// At the instant.
    pub now: &'a Sensed<T>,
    /// At the two ends of the control tick that it lies in.
    pub tick: (&'a Sensed<T>, &'a Sensed<T>),
    /// Length of that tick, s.
    pub tick_s: f64,
    /// At the log instant before.
    pub last_row: &'a Sensed<T>,
    /// Time since then, s.
    pub row_s: f64,
}

impl<T: Real> Instant<'_, T> {
    /// Rate of change of a response, over the last row for a slow sensor, else over the tick.
    pub fn rate(&self, response: Response, slow: bool) -> T {
        let (from, to, span) = if slow {
            (self.last_row, self.now, self.row_s)
        } else {
            (self.tick.0, self.tick.1, self.tick_s)
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
            // Anywhere within the grain: before the stamp where the sensor is slow, on either side else.
            let (low, high) = if slow { (0.0, grain_s) } else { (-grain_s, grain_s) };
            Some(Free {
                target: Target::Sampling { response, slow },
                name: "sampling_delay_s",
                unit: "s",
                stated: false,
                mean: 0.5 * (low + high),
                sigma: (high - low) / 12.0_f64.sqrt(),
                low,
                high,
                acts: None,
            })
        })
        .collect()
}

/// Whether a channel is slower than the log, and how far its samples may lie from their stamps, s.
fn grain(recording: &Prepared, response: Response) -> Option<(bool, f64)> {
    let channel = recording.channels.iter().find(|c| c.response == response)?;
    let times: Vec<f64> = channel.rows.iter().map(|row| recording.time_s[*row]).collect();
    let row_s = crate::spectrum::median_interval(&recording.time_s);
    let slow = crate::spectrum::is_slow(crate::spectrum::median_interval(&times), row_s);
    Some((slow, if slow { row_s } else { recording.tick_s }))
}
