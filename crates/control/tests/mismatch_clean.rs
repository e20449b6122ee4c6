//! False alarms of the monitor of mismatch: a day of driving in which nothing is off, on four rigs.

mod common;

use common::watched::{Watched, learnt_on, rig};

/// Virtual time on each rig, s.
const CLEAN_S: f64 = 6.0 * 3600.0;
/// Rigs with a force sensor and a flow meter, and the seed of reference and noise.
const RIGS: [(&str, u64); 4] =
    [("whitcomb-yoerger-1999", 51), ("ducted-small-vessel", 52), ("tunnel-10kw", 53), ("t500-class", 54)];

/// Prints how near each path came to an alarm.
#[test]
#[ignore = "a minute or more; cargo test -p kort-control --test mismatch_clean -- --ignored --nocapture"]
fn a_clean_day_gives_no_alarm() {
    let one = |(name, seed): (&str, u64)| {
        let mut watched: Watched = learnt_on(&rig(name), Some(seed));
        let (until_s, mut highest, mut alarms, mut off) = (watched.time_s + CLEAN_S, [0.0_f64; 5], 0, None);
        while watched.time_s < until_s {
            let told = watched.tick();
            highest.iter_mut().zip(told.level).for_each(|(most, level)| *most = most.max(level));
            alarms += u32::from(told.alarm.is_some() && told.alarm != off);
            off = told.alarm;
        }
        println!("{name}: {alarms} alarms in {:.0} h, highest levels {highest:.2?}", CLEAN_S / 3600.0);
        alarms
    };
    let alarms: u32 = std::thread::scope(|threads| {
        let running = RIGS.map(|rig| threads.spawn(move || one(rig)));
        running.map(|t| t.join().unwrap()).iter().sum()
    });
    assert_eq!(alarms, 0);
}
