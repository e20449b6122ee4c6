//! The fault campaign: the built program under kill -9 at random instants, stopped processes, rival commanders, slow
//! peers, foreign messages, lying sensors and a full disk. Each line of the table it prints is a fault, the bound that
//! docs/operations.md promises, and the worst that was measured; a bound that does not hold fails the campaign.
//!
//! `KORT_FAULT_KILLS` says how often each process is killed (CI: 12; `just faults`: 1000), `KORT_FAULT_LANES` on how many
//! deployments side by side (1), `KORT_FAULT_MINUTES` after how long no more is begun (never), `KORT_FAULT_GROUPS` which
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

#[test]
fn every_fault_ends_within_its_bound() {
    let groups: [(&str, &[Fault]); 5] = [
        ("processes", &[kills::stopped, version::foreign_peer, version::foreign_owner, version::rival]),
        ("network", &[network::rivals, network::slow_reader, network::half_open]),
        ("disk", &[disk::at_its_limit, disk::full, disk::slow, disk::log_full]),
        ("shared_memory", &[shared_memory::full_at_the_start, shared_memory::full_under_way]),
        ("sensors", &[sensors::lying]),
    ];
    let only = std::env::var("KORT_FAULT_GROUPS").ok();
    let table = std::cell::RefCell::new(Table::default());
    let stalls = Stalls::watch();
    let wanted = |name: &str| only.as_ref().is_none_or(|only| only.split(',').any(|wanted| wanted == name));
    if wanted("kills") {
        let mut rows = Table::default();
        kills::killed(&mut rows);
        table.borrow_mut().append(rows, stalls.take_ms());
    }
    for (name, faults) in groups {
        if wanted(name) {
            for fault in faults {
                // Rows of a trial in which the machine stood still are dropped with it.
                common::in_real_time(|| {
                    let mut rows = Table::default();
                    stalls.take_ms();
                    fault(&mut rows);
                    table.borrow_mut().append(rows, stalls.take_ms());
                });
            }
        }
    }
    let table = table.into_inner();
    println!("{table}");
    assert!(table.holds(), "a bound does not hold:\n{table}");
}
