//! The record of a session.

use kort_proto::signals::{SIGNALS, Signals};

/// Every tick of a session.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// Instants, s after the session's start.
    pub time_s: Vec<f64>,
    /// Rows in the order of the signal table.
    pub rows: Vec<Signals>,
    /// The command whose steps the rows are laid on, as a place in the table.
    driving: usize,
}

impl Log {
    /// An empty record of a drive whose commands stand in this column.
    pub fn new(driving: &str) -> Self {
        let driving = SIGNALS.iter().position(|s| s.name == driving).unwrap_or(0);
        Self { driving, ..Self::default() }
    }

    /// A further tick; one that is not later than the last is left out.
    pub fn push(&mut self, time_s: f64, signals: &Signals) {
        if self.time_s.last().is_none_or(|last| time_s > *last) {
            self.time_s.push(time_s);
            self.rows.push(*signals);
        }
    }

    /// Every `n`th row, laid so that as many steps of the command as can be fall on one, and the columns that hold
    /// anything. What a slow instrument showed in between is put on the next row.
    pub fn thinned(&self, n: usize) -> (Vec<f64>, Vec<(&'static str, Vec<f64>)>) {
        let n = n.max(1);
        let phase = self.phase(n);
        let mut time_s = Vec::new();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); Signals::COUNT];
        let mut waiting = [f64::NAN; Signals::COUNT];
        for (k, row) in self.rows.iter().enumerate() {
            let values = row.values();
            let taken = k % n == phase;
            for (j, value) in values.iter().enumerate() {
                // A flow meter's reading between two rows is not thrown away; a fast sensor's is.
                if value.is_finite() {
                    waiting[j] = *value;
                }
                if taken {
                    columns[j].push(std::mem::replace(&mut waiting[j], f64::NAN));
                }
            }
            if taken {
                time_s.push(self.time_s[k]);
            }
        }
        let columns = SIGNALS
            .iter()
            .map(|s| s.name)
            .zip(columns)
            .filter(|(_, values)| values.iter().any(|v| v.is_finite()))
            .collect();
        (time_s, columns)
    }

    /// The remainder at which most large steps of the command happen.
    fn phase(&self, n: usize) -> usize {
        let get = SIGNALS[self.driving].get;
        let most = self.rows.iter().map(|r| get(r).abs()).fold(0.0, f64::max);
        let mut steps = vec![0_usize; n];
        for (k, pair) in self.rows.windows(2).enumerate() {
            if (get(&pair[1]) - get(&pair[0])).abs() > 0.05 * most {
                steps[(k + 1) % n] += 1;
            }
        }
        // The first of equals.
        (0..n).rev().max_by_key(|k| steps[*k]).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_fall_on_the_steps_and_slow_readings_are_kept() {
        let mut log = Log::new("current_cmd_a");
        for k in 0..100 {
            let flow_m_s = if k % 20 == 3 { 1.0 } else { f64::NAN };
            let current_cmd_a = if ((k + 8) / 10) % 2 == 1 { 2.0 } else { 0.0 };
            log.push(f64::from(k) * 1e-3, &Signals { current_cmd_a, flow_m_s, ..Signals::UNKNOWN });
        }
        let (time_s, columns) = log.thinned(5);
        assert_eq!((time_s.len(), columns.len()), (20, 2));
        assert!((time_s[0] - 2e-3).abs() < 1e-12, "steps are at 2, 12, 22 ms: {time_s:?}");
        assert_eq!(columns[1].1.iter().filter(|v| v.is_finite()).count(), 5, "{columns:?}");
    }
}
