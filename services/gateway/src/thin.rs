//! Rows at a lower rate than the servo's samples.

use kort_proto::signals::{SIGNALS, Signals};

/// Makes rows of samples. A sensor slower than the servo shows a value now and then: none is lost between two rows.
#[derive(Clone, Debug)]
pub struct Thin {
    period_ns: u64,
    due_ns: u64,
    last_ns: u64,
    row: Signals,
}

impl Thin {
    /// At most so many rows a second.
    pub fn new(rate_hz: f64) -> Thin {
        Thin { period_ns: (1e9 / rate_hz) as u64, due_ns: 0, last_ns: 0, row: Signals::UNKNOWN }
    }

    /// Takes a sample; gives a row where one is due.
    pub fn take(&mut self, time_ns: u64, signals: &Signals) -> Option<Signals> {
        for signal in SIGNALS {
            let value = (signal.get)(signals);
            if !value.is_nan() {
                (signal.set)(&mut self.row, value);
            }
        }
        // On another clock than before, or after a gap, the rows begin anew with this sample.
        let begins = time_ns < self.last_ns || time_ns >= self.due_ns + self.period_ns;
        self.last_ns = time_ns;
        if begins {
            self.due_ns = time_ns;
        }
        // The servo's period need not divide ours: a row may come a little early, and none is made up for ticks
        // that were skipped.
        if time_ns + self.period_ns / 20 < self.due_ns {
            return None;
        }
        self.due_ns = (self.due_ns + self.period_ns).max(time_ns + self.period_ns / 2);
        Some(std::mem::replace(&mut self.row, Signals::UNKNOWN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_at_their_rate_and_a_slow_sensor_is_not_lost_between_them() {
        let mut thin = Thin::new(100.0);
        let rows: Vec<Signals> = (0..1000u64)
            .filter_map(|ms| {
                let flow_m_s = if ms % 50 == 3 { ms as f64 } else { f64::NAN };
                thin.take(ms * 1_000_000, &Signals { flow_m_s, thrust_n: 1.0, ..Signals::UNKNOWN })
            })
            .collect();
        assert_eq!(rows.len(), 100);
        assert_eq!(rows.iter().filter(|row| row.flow_m_s.is_finite()).count(), 20);
        assert!(rows.iter().all(|row| row.thrust_n == 1.0));
    }
}
