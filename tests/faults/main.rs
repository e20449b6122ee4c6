//! The fault campaign: the built program under kill -9 at random instants, stopped processes, rival commanders, slow
//! peers, foreign messages, lying sensors and a full disk. Each line of the table it prints is a fault, the bound that
//! docs/operations.md promises, and the worst that was measured; a bound that does not hold fails the campaign.
//!
//! `KORT_FAULT_KILLS` says how often each process is killed (CI: 12; `just faults`: 1000).

#[path = "../common/mod.rs"]
mod common;
mod disk;
mod kills;
mod network;
mod sensors;
mod table;

use table::Table;

#[test]
fn every_fault_ends_within_its_bound() {
    let mut table = Table::default();
    kills::killed(&mut table);
    kills::stopped(&mut table);
    kills::foreign_version(&mut table);
    network::rivals(&mut table);
    network::slow_reader(&mut table);
    network::half_open(&mut table);
    disk::full(&mut table);
    sensors::lying(&mut table);
    println!("{table}");
    assert!(table.holds(), "a bound does not hold:\n{table}");
}
