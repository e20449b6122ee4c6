//! The one clock of all processes, and a loop on absolute deadlines.

use crate::messages::Timing;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// CLOCK_MONOTONIC now, ns.
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    (now.tv_sec as u64).saturating_mul(1_000_000_000).saturating_add(now.tv_nsec as u64)
}

/// Wakes at absolute deadlines; missed ones are skipped and counted.
#[derive(Debug)]
pub struct Ticker {
    next_ns: u64,
    /// What the loop has done so far.
    pub timing: Timing,
}

impl Ticker {
    /// First deadline one period from now.
    pub fn new(period_ns: u64) -> Self {
        Self {
            next_ns: monotonic_ns() + period_ns,
            timing: Timing { period_ns: period_ns.max(1), ..Timing::default() },
        }
    }

    /// Sleeps to the next deadline and returns it together with the number of deadlines missed
    /// since the last call.
    pub fn wait(&mut self) -> (u64, u64) {
        let mut deadline = self.next_ns;
        sleep_until(deadline);
        let late = monotonic_ns().saturating_sub(deadline);
        let missed = late / self.timing.period_ns;
        self.timing.overruns += missed;
        deadline += missed * self.timing.period_ns;
        self.timing.count(late);
        self.next_ns = deadline + self.timing.period_ns;
        (deadline, missed)
    }

    /// The next deadline on CLOCK_MONOTONIC, ns.
    pub fn next_ns(&self) -> u64 {
        self.next_ns
    }

    /// Notes the work of this tick: time since its wake-up.
    pub fn worked(&mut self, woke_ns: u64) {
        self.timing.busy_ns = monotonic_ns().saturating_sub(woke_ns);
    }
}

/// Sleeps to an instant of CLOCK_MONOTONIC; interruptions by signals do not shorten it.
fn sleep_until(at_ns: u64) {
    let at = Timespec { tv_sec: (at_ns / 1_000_000_000) as _, tv_nsec: (at_ns % 1_000_000_000) as _ };
    // EINTR is retried; other errors cannot happen for a valid timespec and would at worst make
    // the loop spin for one tick.
    while rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &at) == Err(rustix::io::Errno::INTR) {}
}

/// Makes the calling thread a real-time one as far as the system permits: SCHED_FIFO with this
/// priority, all memory of the process locked (if `lock_memory`), timer slack of 1 ns.
///
/// Returns what was not permitted, in words fit for a warning.
pub fn realtime(priority: i32, lock_memory: bool) -> Vec<String> {
    let mut missing = Vec::new();
    // First, as the ordinary thread it still is: fetching every page takes milliseconds, for which nothing else would
    // run on this core.
    if lock_memory {
        use rustix::mm::{MlockAllFlags, mlockall};
        if let Err(e) = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
            missing.push(format!(
                "memory cannot be locked ({e}): a page fault may delay a tick\nhint: grant CAP_IPC_LOCK or raise the memlock limit"
            ));
        }
    }
    // SAFETY: sched_setscheduler only reads the parameter; 0 is the calling thread.
    let done = unsafe {
        let parameter = libc::sched_param { sched_priority: priority };
        libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameter)
    };
    if done != 0 {
        missing.push(format!(
            "SCHED_FIFO is not permitted ({}): expect wake-ups late by milliseconds under load\nhint: run as root, or grant CAP_SYS_NICE or an rtprio limit",
            std::io::Error::last_os_error()
        ));
    }
    if let Err(e) = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1)) {
        missing.push(format!("timer slack cannot be set ({e}): wake-ups come about 50 us later"));
    }
    missing
}

/// Keeps the calling thread, and those that it starts from now on, on these cores, counted from zero; none named: wherever
/// the system likes.
///
/// Returns what was not done, in words fit for a warning.
pub fn keep_on(cores: &[usize]) -> Option<String> {
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
    if cores.is_empty() {
        return None;
    }
    let mut wanted = CpuSet::new();
    cores.iter().filter(|core| **core < CpuSet::MAX_CPU).for_each(|core| wanted.set(*core));
    // The kernel leaves out cores that are not there, or not this process's, and refuses only if none is left.
    let words = match sched_setaffinity(None, &wanted).and_then(|()| sched_getaffinity(None)) {
        Err(e) => format!("cannot be kept on cores {cores:?} ({e}): it runs wherever the system likes"),
        Ok(got) if cores.iter().all(|core| *core < CpuSet::MAX_CPU && got.is_set(*core)) => return None,
        Ok(_) => format!("of the cores {cores:?} not all are there: it is kept on the others"),
    };
    Some(format!(
        "{words}\nhint: `nproc --all` says how many there are, counted from 0; containers and services have fewer"
    ))
}

/// Makes the calling thread an ordinary one, whatever it inherited: a service manager (or `chrt`)
/// that starts a process as a real-time one makes all its threads so, and one that works at the
/// priority of a loop keeps the loop waiting.
pub fn ordinary() {
    // SAFETY: as above. A thread may always give up its priority.
    unsafe {
        let parameter = libc::sched_param { sched_priority: 0 };
        libc::sched_setscheduler(0, libc::SCHED_OTHER, &parameter);
    }
}

/// Lets the calling thread, and those that it starts from now on, run only where nothing else wants the processor.
///
/// Returns what was not permitted, in words fit for a warning.
pub fn idle() -> Option<String> {
    // SAFETY: as above.
    let done = unsafe {
        let parameter = libc::sched_param { sched_priority: 0 };
        libc::sched_setscheduler(0, libc::SCHED_IDLE, &parameter)
    };
    (done != 0).then(|| format!("SCHED_IDLE is not permitted ({})", std::io::Error::last_os_error()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_and_those_it_starts_stay_on_their_core_and_one_that_is_not_there_is_said() {
        let cores = || {
            let set = rustix::thread::sched_getaffinity(None).expect("a set");
            (0..rustix::thread::CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect::<Vec<_>>()
        };
        let all = cores();
        let last = *all.last().expect("a core");
        std::thread::spawn(move || {
            assert_eq!(keep_on(&[]), None);
            assert_eq!(cores(), all);
            assert_eq!(keep_on(&[last]), None);
            assert_eq!(std::thread::spawn(cores).join().expect("a thread"), [last]);
            let words = keep_on(&[last, 1023]).expect("words");
            assert!(words.contains("not all are there") && words.contains("hint: "), "{words}");
            assert!(keep_on(&[1023]).expect("words").contains("wherever the system likes"));
            assert_eq!(cores(), [last], "what was not done changes nothing");
        })
        .join()
        .expect("a thread");
    }

    #[test]
    fn a_thread_that_a_real_time_one_starts_can_be_made_ordinary() {
        // SAFETY: 0 is the calling thread.
        let policy = || unsafe { libc::sched_getscheduler(0) };
        let started = std::thread::spawn(move || {
            // Where it is not permitted both stay ordinary.
            let _ = realtime(1, false);
            assert_eq!(std::thread::spawn(policy).join().expect("a thread"), policy());
            std::thread::spawn(move || {
                ordinary();
                policy()
            })
            .join()
            .expect("a thread")
        });
        assert_eq!(started.join().expect("a thread"), libc::SCHED_OTHER);
    }
}
