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

/// Which of the rows that are kept are shown: no more a second than asked for.
#[derive(Clone, Copy, Debug)]
pub struct Due {
    gap_ns: u64,
    next_ns: u64,
}

impl Due {
    /// At most so many rows a second.
    pub fn new(rate_hz: f64) -> Due {
        Due { gap_ns: (1e9 / rate_hz) as u64, next_ns: 0 }
    }

    /// Is a row of this time one of them? To be asked in their order.
    pub fn is(&mut self, time_ns: u64) -> bool {
        // Rows are not quite evenly spaced: one may come a little early.
        let due = time_ns + self.gap_ns / 10 >= self.next_ns;
        if due {
            // On the grid of the first one, which early rows do not move; after a gap it begins anew.
            let next_ns = self.next_ns + self.gap_ns;
            self.next_ns = if time_ns >= next_ns { time_ns + self.gap_ns } else { next_ns };
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_rows_are_shown_than_were_asked_for() {
        for hz in [1.0, 5.0, 7.0, 10.0, 25.0, 100.0] {
            let mut due = Due::new(hz);
            let begins = 77_000_000_000;
            let rows =
                |span_s: u64| (0..span_s * 100).map(|row| begins + row * 10_000_000 + row % 3 * 200_000);
            let shown = rows(60).filter(|at| due.is(*at)).count() as f64;
            assert!(shown <= 60.0 * hz + 1.0 && shown >= 59.0 * hz.min(90.0), "{hz}: {shown}");
            // After a gap there is no more at once.
            assert!(due.is(begins + 600_000_000_000) && !due.is(begins + 600_000_000_001));
        }
    }

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
