//! The table of the campaign.

use std::fmt;
use std::time::Duration;

/// Promised and measured, fault by fault.
#[derive(Default)]
pub struct Table(Vec<Row>);

struct Row {
    fault: String,
    what: &'static str,
    unit: &'static str,
    bound: f64,
    worst: f64,
    slack: f64,
    times: usize,
    /// How many of them were beyond the bound.
    beyond: usize,
}

impl Table {
    /// Rows of another table behind this one's.
    pub fn append(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// While these rows were measured the machine stood still for up to so long.
    pub fn stalled(&mut self, ms: f64) {
        self.0.iter_mut().filter(|row| row.unit == "ms").for_each(|row| row.slack += ms);
    }

    /// Notes the times measured of one fault.
    pub fn row(
        &mut self,
        fault: impl Into<String>,
        what: &'static str,
        bound: Duration,
        measured: &[Duration],
    ) {
        let ms = |time: Duration| (time.as_secs_f64() * 1e3).floor();
        let worst = measured.iter().copied().max().map_or(f64::INFINITY, ms);
        // A machine shared with others may add two controller periods of the deployments under test, as in the
        // other tests.
        let slack = 2e-6 * crate::common::PERIOD_NS as f64;
        let (fault, bound) = (fault.into(), ms(bound));
        let beyond = measured.iter().filter(|time| ms(**time) > bound).count();
        self.0.push(Row { fault, what, unit: "ms", bound, worst, slack, times: measured.len(), beyond });
    }

    /// Notes another quantity that a fault must not let grow beyond its bound.
    pub fn quantity(
        &mut self,
        fault: impl Into<String>,
        what: &'static str,
        unit: &'static str,
        bound: f64,
        worst: f64,
    ) {
        let beyond = usize::from(worst > bound);
        self.0.push(Row { fault: fault.into(), what, unit, bound, worst, slack: 0.0, times: 1, beyond });
    }

    /// Does every bound hold?
    pub fn holds(&self) -> bool {
        self.0.iter().all(|row| row.worst <= row.bound + row.slack)
    }
}

impl Table {
    /// Rows that the table of a page lacks, or promises otherwise.
    pub fn missing_from(&self, page: &str) -> Vec<String> {
        let plain = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let lines: Vec<String> = page.lines().map(plain).collect();
        let promise = |row: &Row| {
            // Where nothing may be mounted a limit stands in for the small disk.
            let fault = row.fault.replace("files may not grow", "disk full");
            plain(&format!("| {fault} | {} | {} {} |", row.what, row.bound, row.unit))
        };
        self.0.iter().map(promise).filter(|row| !lines.iter().any(|line| line.starts_with(row))).collect()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | what follows | promised | worst | times | beyond |")?;
        writeln!(f, "| --- | --- | --- | --- | --- | --- |")?;
        for Row { fault, what, unit, bound, worst, times, beyond, .. } in &self.0 {
            let worst = (worst * 100.0).round() / 100.0;
            writeln!(f, "| {fault} | {what} | {bound} {unit} | {worst} {unit} | {times} | {beyond} |")?;
        }
        Ok(())
    }
}
