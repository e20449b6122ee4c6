//! The table of the campaign.

use std::fmt;
use std::time::Duration;

/// Promised and measured, fault by fault.
#[derive(Default)]
pub struct Table(Vec<Row>);

struct Row {
    fault: String,
    what: &'static str,
    bound: Duration,
    worst: Duration,
    times: usize,
}

impl Table {
    /// Notes what was measured of one fault.
    pub fn row(
        &mut self,
        fault: impl Into<String>,
        what: &'static str,
        bound: Duration,
        measured: &[Duration],
    ) {
        let worst = measured.iter().copied().max().unwrap_or(Duration::MAX);
        self.0.push(Row { fault: fault.into(), what, bound, worst, times: measured.len() });
    }

    /// Every bound holds; a machine shared with others may add two controller periods of the deployments under
    /// test, as in the other tests.
    pub fn holds(&self) -> bool {
        let slack = Duration::from_nanos(2 * crate::common::PERIOD_NS);
        self.0.iter().all(|row| row.worst <= row.bound + slack)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | what follows | promised, ms | worst, ms | times |")?;
        writeln!(f, "| --- | --- | --- | --- | --- |")?;
        for Row { fault, what, bound, worst, times } in &self.0 {
            let (bound, worst) = (bound.as_millis(), worst.as_millis());
            writeln!(f, "| {fault} | {what} | {bound} | {worst} | {times} |")?;
        }
        Ok(())
    }
}
