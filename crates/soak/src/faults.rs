//! Processes that fail, and how the thruster comes back after what the scenario breaks.

use crate::scenario::{ProcessFault, ProcessFaultKind, is_on};
use crate::score::Sample;

/// A fault is survived if thrust is back within this time of its end, s.
const BACK_S: f64 = 10.0;
/// How near thrust must come, share of the largest thrust.
const NEAR: f64 = 0.1;
/// Time after a fault in which a drive that is off is excused, s.
const EXCUSED_S: f64 = 1.0;

/// The faults of a run so far.
#[derive(Debug)]
pub struct Faults<'a> {
    processes: &'a [ProcessFault],
    /// End of the newest fault, s.
    until_s: f64,
    down: bool,
    injected: u32,
    survived: u32,
    /// A fault whose recovery is awaited: its end, s.
    awaited_s: Option<f64>,
}

/// What a process does at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// It ticks.
    Alive,
    /// It does not.
    Down,
    /// It went down at this tick and will come up afresh.
    Restarted,
}

impl<'a> Faults<'a> {
    /// None yet.
    pub fn new(processes: &'a [ProcessFault]) -> Self {
        Self { processes, until_s: f64::NEG_INFINITY, down: false, injected: 0, survived: 0, awaited_s: None }
    }

    /// What the controller does now.
    pub fn controller(&mut self, time_s: f64) -> Process {
        let on = |f: &&ProcessFault| is_on(f.at_s, f.for_s, f.every_s, time_s);
        let fault = self.processes.iter().find(on);
        let began = fault.filter(|_| !self.down);
        self.down = fault.is_some();
        if let Some(fault) = began {
            self.inject(time_s + fault.for_s);
            if fault.kind == ProcessFaultKind::ControllerRestart {
                return Process::Restarted;
            }
        }
        if self.down { Process::Down } else { Process::Alive }
    }

    /// A fault was put in, until then.
    pub fn inject(&mut self, until_s: f64) {
        self.injected += 1;
        self.until_s = until_s;
        self.awaited_s = Some(until_s);
    }

    /// Whether a drive that is off now is off for a fault that was put in; a trip of the law's own counts.
    pub fn excuse(&self, time_s: f64) -> bool {
        time_s < self.until_s.max(0.0) + EXCUSED_S
    }

    /// Watches thrust come back.
    pub fn watch(&mut self, s: &Sample, thrust_max_n: f64) {
        let Some(since) = self.awaited_s.map(|end| s.time_s - end).filter(|since| *since > 0.0) else {
            return;
        };
        if !s.excused && (s.thrust_n - s.reference_n).abs() < NEAR * thrust_max_n {
            self.survived += 1;
            self.awaited_s = None;
        } else if since > BACK_S {
            self.awaited_s = None;
        }
    }

    /// Faults put in and survived; one whose time is not over yet is not counted.
    pub fn counts(&self) -> (u32, u32) {
        (self.injected - u32::from(self.awaited_s.is_some()), self.survived)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_survived_once_thrust_is_back() {
        let fault =
            ProcessFault { kind: ProcessFaultKind::ControllerRestart, at_s: 1.0, for_s: 0.5, every_s: None };
        let processes = [fault];
        let mut faults = Faults::new(&processes);
        let sample = |time_s, thrust_n| Sample { time_s, reference_n: 50.0, thrust_n, ..Sample::default() };
        assert_eq!(faults.controller(0.9), Process::Alive);
        assert_eq!(faults.controller(1.0), Process::Restarted);
        assert_eq!((faults.controller(1.1), faults.counts()), (Process::Down, (0, 0)));
        assert!(faults.excuse(2.0) && !faults.excuse(2.6));
        faults.watch(&sample(2.0, 0.0), 100.0);
        assert_eq!(faults.counts(), (0, 0));
        faults.watch(&sample(3.0, 45.0), 100.0);
        assert_eq!((faults.controller(3.0), faults.counts()), (Process::Alive, (1, 1)));
    }

    #[test]
    fn a_fault_without_recovery_counts_against_the_law() {
        let mut faults = Faults::new(&[]);
        faults.inject(5.0);
        faults.watch(&Sample { time_s: 15.1, reference_n: 50.0, ..Sample::default() }, 100.0);
        assert_eq!(faults.counts(), (1, 0));
    }
}
