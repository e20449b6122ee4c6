//! What the state shows between two readings of a slow sensor.

use kort_proto::messages::Telemetry;
use kort_proto::signals::{Kind, SIGNALS};

/// The last value of each signal: a flow meter of 20 Hz shows a value in one row of fifty, and the state should show it in
/// between.
#[derive(Default)]
pub struct Held(Vec<Last>);

#[derive(Clone, Copy)]
struct Last {
    value: f64,
    at_ns: u64,
    /// Longest of its last intervals, ns; it forgets one that does not come again.
    every_ns: u64,
}

impl Held {
    /// Intervals for which a value is shown after it was taken: what tells no more is not measured any more.
    const INTERVALS: u64 = 3;
    /// Longest and shortest time for which it is, ns.
    const LONGEST_NS: u64 = 1_000_000_000;
    const SHORTEST_NS: u64 = 20_000_000;

    /// Remembers what this sample measured.
    pub fn take(&mut self, telemetry: &Telemetry) {
        self.0.resize(SIGNALS.len(), Last { value: f64::NAN, at_ns: 0, every_ns: 0 });
        for (last, signal) in self.0.iter_mut().zip(SIGNALS) {
            let value = (signal.get)(&telemetry.signals);
            if !value.is_nan() {
                if !last.value.is_nan() {
                    let interval_ns = telemetry.time_ns.saturating_sub(last.at_ns).min(Self::LONGEST_NS);
                    last.every_ns = interval_ns.max(last.every_ns - last.every_ns / 8);
                }
                (last.value, last.at_ns) = (value, telemetry.time_ns);
            }
        }
    }

    /// The sample with what it did not measure itself.
    pub fn fill(&self, mut telemetry: Telemetry) -> Telemetry {
        for (last, signal) in self.0.iter().zip(SIGNALS) {
            let life_ns = (Self::INTERVALS * last.every_ns).clamp(Self::SHORTEST_NS, Self::LONGEST_NS);
            if signal.kind == Kind::Measured && telemetry.time_ns.saturating_sub(last.at_ns) < life_ns {
                (signal.set)(&mut telemetry.signals, last.value);
            }
        }
        telemetry
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_proto::signals::Signals;

    fn sample(time_ms: u64, flow_m_s: f64) -> Telemetry {
        let signals = Signals { flow_m_s, thrust_cmd_n: f64::NAN, ..Signals::UNKNOWN };
        Telemetry { time_ns: time_ms * 1_000_000, signals, ..Telemetry::default() }
    }

    /// What is shown so long after the last of twenty readings so far apart.
    fn shown(every_ms: u64, after_ms: u64) -> f64 {
        let mut held = Held::default();
        let last_ms = 5_000 + 20 * every_ms;
        (0..=20).for_each(|k| held.take(&sample(5_000 + k * every_ms, 0.7)));
        held.take(&sample(last_ms + after_ms, f64::NAN));
        held.fill(sample(last_ms + after_ms, f64::NAN)).signals.flow_m_s
    }

    #[test]
    fn a_slow_meter_shows_between_its_readings() {
        assert_eq!([shown(50, 49), shown(50, 140), shown(400, 399), shown(800, 799)], [0.7; 4]);
        let mut held = Held::default();
        held.take(&sample(5_000, 0.7));
        held.take(&sample(60_001, 0.2));
        assert_eq!(held.fill(sample(60_001, 0.2)).signals.flow_m_s, 0.2);
    }

    /// A drive that told at every tick and tells no more has neither current nor speed.
    #[test]
    fn what_falls_silent_is_soon_not_measured() {
        assert_eq!(shown(1, 15), 0.7);
        assert!(
            [shown(1, 25), shown(20, 130), shown(400, 1_000), shown(5_000, 1_000)].iter().all(|v| v.is_nan())
        );
    }

    #[test]
    fn a_command_that_is_not_given_is_not_held() {
        let mut held = Held::default();
        let mut given = sample(1_000, 0.7);
        given.signals.thrust_cmd_n = 50.0;
        held.take(&given);
        assert!(held.fill(sample(1_001, 0.7)).signals.thrust_cmd_n.is_nan());
    }
}
