//! What the state shows between two readings of a slow sensor.

use kort_proto::messages::Telemetry;
use kort_proto::signals::{Kind, SIGNALS};

/// The last value of each signal and when it was taken, ns: a flow meter of 20 Hz shows a value in one row of
/// fifty, and the state should show it in between.
#[derive(Default)]
pub struct Held(Vec<(f64, u64)>);

impl Held {
    /// Longest time a value is shown after it was taken, ns.
    const LIFE_NS: u64 = 1_000_000_000;

    /// Remembers what this sample measured.
    pub fn take(&mut self, telemetry: &Telemetry) {
        self.0.resize(SIGNALS.len(), (f64::NAN, 0));
        for (held, signal) in self.0.iter_mut().zip(SIGNALS) {
            let value = (signal.get)(&telemetry.signals);
            if !value.is_nan() {
                *held = (value, telemetry.time_ns);
            }
        }
    }

    /// The sample with what it did not measure itself.
    pub fn fill(&self, mut telemetry: Telemetry) -> Telemetry {
        for ((value, at_ns), signal) in self.0.iter().zip(SIGNALS) {
            if signal.kind == Kind::Measured && telemetry.time_ns.saturating_sub(*at_ns) < Self::LIFE_NS {
                (signal.set)(&mut telemetry.signals, *value);
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

    #[test]
    fn a_slow_meter_shows_between_its_readings_and_a_silent_one_for_a_second() {
        let mut held = Held::default();
        held.take(&sample(5_000, 0.7));
        for (time_ms, shown) in [(5_001, 0.7), (5_999, 0.7), (6_000, f64::NAN), (60_000, f64::NAN)] {
            held.take(&sample(time_ms, f64::NAN));
            let flow = held.fill(sample(time_ms, f64::NAN)).signals.flow_m_s;
            assert!(flow == shown || flow.is_nan() && shown.is_nan(), "{time_ms} ms: {flow}");
        }
        held.take(&sample(60_001, 0.2));
        assert_eq!(held.fill(sample(60_001, 0.2)).signals.flow_m_s, 0.2);
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
