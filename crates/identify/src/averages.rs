//! Readings of sensors that are slower than the log: means over a while, and handed on late.
//!
//! Between two of its readings the telemetry of a drive collects what it measures; an amplifier of a load cell does so too. How
//! long, nobody writes down: anything from an instant to the whole interval. What it shows then is the mean over that window,
//! which ends where the reading was taken. Left out, it would look like a lag or a delay of physics in whichever channel moves fast.

use std::collections::VecDeque;

use kort_thruster::plant::Sensed;
use kort_thruster::real::Real;

use crate::data::{Channel, Response};
use crate::hypothesis::{Free, Target};

/// The past of the responses that are read as means.
pub struct Averages<T>(Vec<Average<T>>);

/// The past of one response, straight from each point to the next, and how it is read.
struct Average<T> {
    response: Response,
    window_s: T,
    delay_s: T,
    /// How far back a reading may reach, s.
    reach_s: f64,
    past: VecDeque<Point<T>>,
}

/// A response at an instant, and its integral until then.
#[derive(Clone, Copy)]
struct Point<T> {
    time_s: f64,
    value: T,
    integral: T,
}

/// A reading, and how it changes.
#[derive(Clone, Copy, Debug)]
pub struct Reading<T> {
    /// Mean over the window.
    pub mean: T,
    /// Change with the delay, 1/s.
    pub by_delay: T,
    /// Change with the window, 1/s.
    pub by_window: T,
}

impl<T: Real> Averages<T> {
    /// Those that the free numbers of a hypothesis tell of and a recording has.
    pub fn of(free: &[Free], values: &[T], channels: &[Channel]) -> Self {
        let slow = |wanted| channels.iter().any(|c| c.response == wanted && c.slow_s.is_some());
        let number = |wanted| free.iter().zip(values).find(|(f, _)| f.target == wanted);
        let windows = free.iter().zip(values).filter_map(|(f, window_s)| {
            let Target::Averaging { response } = f.target else { return None };
            if !slow(response) {
                return None;
            }
            let delay = number(Target::Sampling { response });
            Some(Average {
                response,
                window_s: *window_s,
                delay_s: delay.map_or(T::ZERO, |(_, delay_s)| *delay_s),
                reach_s: f.high + delay.map_or(0.0, |(f, _)| f.high),
                past: VecDeque::new(),
            })
        });
        Self(windows.collect())
    }

    /// Whether nothing is read as a mean.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// What the sensors would show at an instant.
    pub fn push(&mut self, time_s: f64, sensed: &Sensed<T>) {
        for average in &mut self.0 {
            average.push(time_s, average.response.of(sensed));
        }
    }

    /// What is shown at an instant of a response that is read as a mean.
    pub fn reading(&self, response: Response, time_s: f64) -> Option<Reading<T>> {
        self.0.iter().find(|average| average.response == response).map(|average| average.reading(time_s))
    }
}

impl<T: Real> Average<T> {
    fn push(&mut self, time_s: f64, value: T) {
        let integral = self
            .past
            .back()
            .map_or(T::ZERO, |last| last.integral + (last.value + value) * (0.5 * (time_s - last.time_s)));
        self.past.push_back(Point { time_s, value, integral });
        while self.past.get(1).is_some_and(|second| second.time_s < time_s - self.reach_s) {
            self.past.pop_front();
        }
    }

    fn reading(&self, time_s: f64) -> Reading<T> {
        let end_s = -self.delay_s + time_s;
        let (last, until) = self.at(end_s);
        let (first, from) = self.at(end_s - self.window_s);
        let mean = (until - from) / self.window_s;
        Reading { mean, by_delay: (first - last) / self.window_s, by_window: (first - mean) / self.window_s }
    }

    /// The response at an instant, and its integral until then. Before the first point and after the last one it stays as it
    /// is there.
    fn at(&self, time_s: T) -> (T, T) {
        let after = self.past.iter().rposition(|point| point.time_s <= time_s.re()).map_or(0, |k| k + 1);
        let Some(from) = self.past.get(after.saturating_sub(1)) else { return (T::ZERO, T::ZERO) };
        let since_s = time_s - from.time_s;
        let slope = match self.past.get(after) {
            Some(to) if after > 0 => (to.value - from.value) / (to.time_s - from.time_s),
            _ => T::ZERO,
        };
        (from.value + slope * since_s, from.integral + (from.value + slope * since_s * 0.5) * since_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn average(window_s: f64, delay_s: f64) -> Average<f64> {
        let mut average =
            Average { response: Response::Current, window_s, delay_s, reach_s: 0.2, past: VecDeque::new() };
        // Unevenly spaced points of a parabola in each of whose halves the mean is known.
        for k in 0..=1000 {
            let t = 1e-3 * f64::from(k) + if k % 2 == 1 { 2e-4 } else { 0.0 };
            average.push(t, 3.0 * t * t);
        }
        average
    }

    #[test]
    fn a_reading_is_the_mean_over_its_window_late_by_its_delay() {
        let mean = |a: f64, b: f64| (b.powi(3) - a.powi(3)) / (b - a);
        let shown = average(0.1, 0.02).reading(1.0).mean;
        assert!((shown - mean(0.88, 0.98)).abs() < 1e-6, "{shown}");
        let short = average(1e-6, 0.1).reading(1.0).mean;
        assert!((short - 3.0 * 0.81).abs() < 1e-5, "{short}");
        assert!(average(0.1, 0.02).past.len() < 250, "what nobody reads is forgotten");
    }

    #[test]
    fn its_changes_are_its_derivatives() {
        let (by, at) = (1e-5, average(0.1, 0.02).reading(1.0));
        let later = (average(0.1, 0.02 + by).reading(1.0).mean - at.mean) / by;
        let longer = (average(0.1 + by, 0.02).reading(1.0).mean - at.mean) / by;
        assert!((at.by_delay - later).abs() < 1e-2 * later.abs(), "{} {later}", at.by_delay);
        assert!((at.by_window - longer).abs() < 1e-2 * longer.abs(), "{} {longer}", at.by_window);
    }

    #[test]
    fn before_the_first_point_and_after_the_last_it_stays() {
        let mut average = Average {
            response: Response::Current,
            window_s: 0.1,
            delay_s: 0.0,
            reach_s: 1.0,
            past: VecDeque::new(),
        };
        average.push(0.0, 2.0);
        assert!((average.reading(0.0).mean - 2.0).abs() < 1e-12);
        average.push(0.1, 4.0);
        assert!((average.reading(0.1).mean - 3.0).abs() < 1e-12);
        assert!((average.reading(0.15).mean - 3.75).abs() < 1e-12);
    }
}
