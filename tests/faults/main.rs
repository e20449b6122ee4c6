//! The fault campaign: the built program under kill -9 at random instants, stopped processes, rival commanders, slow
//! peers, foreign messages, lying sensors and a full disk. Each line of the table it prints is a fault, the bound that
//! docs/operations.md promises, and the worst that was measured; a bound that does not hold fails the campaign.
//!
//! `KORT_FAULT_KILLS` says how often each process is killed (200; `just faults`: 1000), `KORT_FAULT_LANES` on how many
//! deployments side by side (8), `KORT_FAULT_MINUTES` after how long no more is begun (never), `KORT_FAULT_GROUPS` which
//! groups are gone through (all; kills, processes, network, disk, shared_memory, sensors).

#[path = "../common/mod.rs"]
mod common;
mod disk;
mod kills;
mod network;
mod sensors;
mod shared_memory;
mod table;
mod version;

use common::Stalls;
use table::Table;

/// Makes a fault, and notes what follows from it.
type Fault = fn(&mut Table);

/// Each group on a thread of its own: most of its time a fault waits for what follows.
const GROUPS: [(&str, &[Fault]); 5] = [
    ("processes", &[kills::stopped, version::foreign_peer, version::foreign_owner, version::rival]),
    ("network", &[network::rivals, network::slow_reader, network::half_open]),
    ("disk", &[disk::at_its_limit, disk::full, disk::slow, disk::log_full]),
    ("shared_memory", &[shared_memory::full_at_the_start, shared_memory::full_under_way]),
    ("sensors", &[sensors::lying]),
];

#[test]
fn every_fault_ends_within_its_bound() {
    let only = std::env::var("KORT_FAULT_GROUPS").ok();
    let wanted = |name: &str| only.as_ref().is_none_or(|only| only.split(',').any(|wanted| wanted == name));
    let mut table = Table::default();
    std::thread::scope(|scope| {
        // Kills are gone through again batch by batch where the machine stood still.
        let kills = wanted("kills").then(|| scope.spawn(|| tried(kills::killed, &Stalls::watch())));
        let groups = GROUPS.into_iter().filter(|(name, _)| wanted(name));
        let groups = groups.map(|(_, faults)| scope.spawn(|| gone_through(faults)));
        for rows in kills.into_iter().chain(groups).collect::<Vec<_>>() {
            table.append(rows.join().unwrap_or_else(|why| std::panic::resume_unwind(why)));
        }
    });
    println!("{table}");
    assert!(table.holds(), "a bound does not hold:\n{table}");
    let page = include_str!("../../docs/operations.md");
    let missing = table.missing_from(page);
    assert!(missing.is_empty(), "docs/operations.md promises something else than {missing:#?}");
}

/// One fault after the other. A bound that does not hold, or a trial that fails, while the machine stood still says
/// nothing of the service: it is tried again, twice at most, and its rows are dropped.
fn gone_through(faults: &[Fault]) -> Table {
    let table = std::cell::RefCell::new(Table::default());
    let stalls = Stalls::watch();
    for fault in faults {
        common::in_real_time(|| {
            let rows = tried(*fault, &stalls);
            assert!(rows.holds(), "a bound does not hold:\n{rows}");
            table.borrow_mut().append(rows);
        });
    }
    table.into_inner()
}

/// Makes a fault; its rows, and by how much the machine added to them.
fn tried(fault: Fault, stalls: &Stalls) -> Table {
    let mut rows = Table::default();
    stalls.take_ms();
    fault(&mut rows);
    rows.stalled(stalls.take_ms());
    rows
}
