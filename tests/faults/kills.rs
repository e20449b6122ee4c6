//! Processes killed and stopped at random instants.

use std::cell::Cell;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use kort_proto::faults::Fault;
use kort_proto::transport::monotonic_ns;

use rustix::process::{Pid, Signal, kill_process};

use crate::common::{PERIOD_NS, Stack, Stalls, at_zero, in_real_time, wait};
use crate::table::Table;

const LEASE_MS: u64 = 60_000;
/// The bounds of docs/operations.md; a sample of the servo comes every 2 ms.
const CONTROLLER: Duration = Duration::from_nanos(5 * PERIOD_NS);
/// The controller's part, at its ticks: the silence and the end of the ramp are each seen up to a period late, and the
/// servo is stopped with the tick after.
const GATEWAY: Duration = Duration::from_nanos(400_000_000 + 4 * PERIOD_NS);
/// A controller whose ticks come late waits longer, twice: for the silence to be seen and for the ramp to end. Each time
/// for 2.5 periods at most, or the servo's own time-out of 3.5 periods ends the thrust.
const GATEWAY_LATE: Duration = Duration::from_nanos(400_000_000 + 9 * PERIOD_NS);
/// At once, or after many quick ends 2 s later.
const SUCCESSOR: Duration = Duration::from_millis(3000);
/// A process is silent for 2 s, is ended, and its successor starts.
const REPLACED: Duration = Duration::from_millis(3500);

/// At this instant: starting a program that kills takes longer than some of the bounds.
fn kill(process: u32, signal: Signal) {
    let pid = i32::try_from(process).ok().and_then(Pid::from_raw).expect("a process");
    kill_process(pid, signal).expect("it is there");
}

/// What the campaign was asked for by the environment.
fn asked(name: &str) -> Option<usize> {
    std::env::var(name).ok().and_then(|n| n.parse().ok())
}

/// The processes of a deployment.
const ROLES: [&str; 3] = ["servo", "controller", "gateway"];

/// Kills between two fresh deployments: some at once after another, and one that the supervisor answers later. More of
/// those at every so many batches, and it answers later and later.
const SHORT: usize = 6;
const LONG: usize = 12;
const LONG_EVERY: usize = 5;

/// A number that looks random and is the same in every run.
fn scatter(n: usize, below: u64) -> u64 {
    (n as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(31) % below
}

/// So many kills in batches, each for a deployment of its own.
fn batches(kills: usize) -> impl Iterator<Item = Vec<usize>> {
    let mut numbers = 0..kills;
    (1..).map_while(move |batch: usize| {
        let size = if batch.is_multiple_of(LONG_EVERY) { LONG } else { SHORT };
        Some(numbers.by_ref().take(size).collect()).filter(|batch: &Vec<usize>| !batch.is_empty())
    })
}

/// Kill -9 under way, at instants spread over a controller period and more. Lanes take batch after batch, each on a
/// deployment of its own, side by side; a batch in which the machine stood still is gone through again.
pub fn killed(table: &mut Table) {
    let (kills, lanes) = (asked("KORT_FAULT_KILLS").unwrap_or(200), asked("KORT_FAULT_LANES").unwrap_or(8));
    let end = asked("KORT_FAULT_MINUTES").map(|m| Instant::now() + Duration::from_secs(60 * m as u64));
    // The three in turn, so that whatever the machine does falls on all alike.
    let mut waiting = ROLES.map(|role| batches(kills).map(move |batch| (role, batch)));
    let waiting = std::iter::from_fn(move || {
        let turn: Vec<_> = waiting.iter_mut().filter_map(Iterator::next).collect();
        (!turn.is_empty()).then_some(turn)
    });
    let (waiting, measured) = (Mutex::new(waiting.flatten()), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..lanes.max(1) {
            scope.spawn(|| {
                while end.is_none_or(|end| Instant::now() < end) {
                    let Some((role, batch)) = lock(&waiting).next() else { return };
                    let killed = killed_at(role, &batch);
                    lock(&measured).extend(killed.into_iter().map(|killed| (role, killed)));
                }
            });
        }
    });
    let measured = lock(&measured);
    for role in ROLES {
        let mut of_role: Vec<Killed> =
            measured.iter().filter(|(of, _)| *of == role).map(|(_, killed)| *killed).collect();
        table.append(rows_of(role, &of_role));
        if role == "gateway" {
            of_role.sort_by_key(|kill| std::cmp::Reverse(kill.late));
            for Killed { took, late, stood_ms } in of_role.iter().take(3) {
                println!(
                    "gateway killed, at zero after {took:.0?}: commands late by {late:.0?}, a sleeping real-time thread by {stood_ms} ms"
                );
            }
        }
    }
}

/// What is promised of a process killed, beside what was measured.
fn rows_of(role: &str, killed: &[Killed]) -> Table {
    let mut rows = Table::default();
    let took: Vec<Duration> = killed.iter().map(|kill| kill.took).collect();
    match role {
        "servo" => rows.row("servo killed (-9)", "successor at zero, fault latched", SUCCESSOR, &took),
        "controller" => rows.row("controller killed (-9)", "zero torque, fault latched", CONTROLLER, &took),
        _ => {
            let in_time: Vec<Duration> =
                killed.iter().map(|kill| kill.took.saturating_sub(kill.late)).collect();
            let what = "ramped to zero, fault latched";
            rows.row("gateway killed (-9), the controller's ticks in time", what, GATEWAY, &in_time);
            rows.row("gateway killed (-9), however late its ticks", what, GATEWAY_LATE, &took);
        }
    }
    rows
}

/// What a lane that failed held stays usable for the others: the scope tells the failure.
fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What came of a kill.
#[derive(Clone, Copy)]
struct Killed {
    /// Until the thruster was at zero.
    took: Duration,
    /// By so much did the controller's commands come late meanwhile, all together.
    late: Duration,
    /// So long was a real-time thread that only sleeps held up at once, ms.
    stood_ms: f64,
}

/// What each of these kills of a process took, on a deployment of its own.
fn killed_at(role: &str, numbers: &[usize]) -> Vec<Killed> {
    let measured = std::cell::RefCell::new(Vec::new());
    in_real_time(|| {
        let (mut stack, stalls) = (Stack::start(), Stalls::watch_in_real_time());
        let ordinary = Stalls::watch();
        let killed: Vec<_> = numbers.iter().map(|n| kill_once(&mut stack, &stalls, role, *n)).collect();
        let mut rows = rows_of(role, &killed);
        rows.stalled(ordinary.take_ms());
        assert!(rows.holds(), "a bound does not hold:\n{rows}");
        *measured.borrow_mut() = killed;
    });
    measured.into_inner()
}

/// Kills a process under way; how long it took until the thruster was at zero.
fn kill_once(stack: &mut Stack, stalls: &Stalls, role: &str, n: usize) -> Killed {
    stack.thrust(30.0, LEASE_MS);
    std::thread::sleep(Duration::from_micros(scatter(n, 60_000)));
    let mut watch = stack.watch();
    let first = watch.next();
    let session = first.header.session;
    let victim = stack.process_of(role);
    stalls.take_ms();
    let killed_ns = monotonic_ns();
    kill(victim, Signal::KILL);
    let (last, late_ns) = (Cell::new(first), Cell::new(0));
    let zero = match role {
        "servo" => watch.until("a successor", |t| t.header.session != session),
        _ => watch.until("zero", |t| {
            let before = last.replace(*t);
            // From one sample to the next: over a gap in what this test read nothing can be said.
            if t.header.sequence == before.header.sequence + 1 {
                let apart_ns = t.command_stamp_ns.saturating_sub(before.command_stamp_ns);
                late_ns.set(late_ns.get() + apart_ns.saturating_sub(PERIOD_NS));
            }
            at_zero(t)
        }),
    };
    let stood_ms = stalls.take_ms();
    assert!(at_zero(&zero), "{role}: {zero:?}");
    wait("the fault to be shown", || {
        let faults = stack.state()?["faults"].as_array()?.len();
        (faults > 0).then_some(())
    });
    wait("a successor", || stack.process(role).filter(|pid| *pid != victim));
    stack.wait_until_up();
    Killed {
        took: Duration::from_nanos(zero.time_ns.saturating_sub(killed_ns)),
        late: Duration::from_nanos(late_ns.get()),
        stood_ms,
    }
}

/// A stopped process is ended and replaced; the thrust ends long before.
pub fn stopped(table: &mut Table) {
    let mut stack = Stack::start();
    std::thread::sleep(Duration::from_secs(6)); // a start is given that long to be heard
    for (role, bound) in [("controller", CONTROLLER), ("gateway", GATEWAY), ("servo", SUCCESSOR)] {
        stack.thrust(30.0, LEASE_MS);
        let mut watch = stack.watch();
        let session = watch.next().header.session;
        let victim = stack.process_of(role);
        let (stopped, stopped_ns) = (Instant::now(), monotonic_ns());
        kill(victim, Signal::STOP);
        if role != "servo" {
            let zero = watch.until("zero", at_zero);
            let took = Duration::from_nanos(zero.time_ns.saturating_sub(stopped_ns));
            table.row(format!("{role} stopped (SIGSTOP)"), "zero, fault latched", bound, &[took]);
        }
        wait("a successor", || stack.process(role).filter(|pid| *pid != victim));
        table.row(format!("{role} stopped (SIGSTOP)"), "ended and replaced", REPLACED, &[stopped.elapsed()]);
        if role == "servo" {
            let fresh = watch.until("a successor", |t| t.header.session != session);
            assert!(at_zero(&fresh) && fresh.faults & Fault::ServoRestarted.bit() != 0, "{fresh:?}");
        }
        stack.wait_until_up();
        std::thread::sleep(Duration::from_secs(6));
    }
}
