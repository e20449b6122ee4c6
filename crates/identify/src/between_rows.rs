//! What a log that is slower than the control hides of when the drive acted.

use crate::data::{Driving, Prepared};

impl Prepared {
    /// Intervals of the log within which what drives the model stepped, at an instant that is fitted too, s.
    fn step_intervals_s(&self) -> Vec<f64> {
        let placed = self.edges.iter().filter(|row| self.ticks_before(**row) > 1);
        let intervals = placed.map(|row| self.time_s[*row] - self.time_s[*row - 1]);
        if self.driving == Driving::Speed { Vec::new() } else { intervals.collect() }
    }

    /// How long they are in the mean, s; zero where every step of the command has its tick.
    pub fn step_interval_s(&self) -> f64 {
        let intervals = self.step_intervals_s();
        intervals.iter().sum::<f64>() / intervals.len().max(1) as f64
    }

    /// The same in words; none where every step of the command has its tick.
    pub fn hidden_between_rows(&self) -> Option<String> {
        let (steps, usual_s) = (self.step_intervals_s().len(), self.step_interval_s());
        if steps == 0 {
            return None;
        }
        let (what, of) = match self.driving {
            Driving::Command(_) => ("steps of the command", "a delay of the drive"),
            _ => ("jumps of what drives the model", "a delay of the response"),
        };
        Some(format!(
            "{}: {steps} of {} {what} fell between two rows of the log, {usual_s:.3} s apart in the mean. At which instant between them is fitted too, so {of} shorter than that shows only in part: a log at the control rate would tell",
            self.name,
            self.edges.len(),
        ))
    }
}
