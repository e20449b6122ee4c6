//! False alarms of the monitor of mismatch: a day of driving in which nothing is off, on four rigs, or on those that
//! `KORT_CLEAN` names with their seeds (`whitcomb-yoerger-1999:41,small-10n:201`), two at a time.

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
    let one = |(name, seed): &(String, u64)| {
        let mut watched: Watched = learnt_on(&rig(name), Some(*seed));
        let (until_s, mut highest, mut alarms, mut off) = (watched.time_s + CLEAN_S, [0.0_f64; 5], 0, None);
        while watched.time_s < until_s {
            let told = watched.tick();
            highest.iter_mut().zip(told.level).for_each(|(most, level)| *most = most.max(level));
            alarms += u32::from(told.alarm.is_some() && told.alarm != off);
            off = told.alarm;
        }
        println!("{name}:{seed}: {alarms} alarms in {:.0} h, highest levels {highest:.2?}", CLEAN_S / 3600.0);
        alarms
    };
    let asked = std::env::var("KORT_CLEAN").ok();
    let rig_and_seed = |one: &str| -> (String, u64) {
        let (rig, seed) = one.split_once(':').expect("KORT_CLEAN: RIG:SEED,…");
        (rig.into(), seed.parse().expect("KORT_CLEAN: a seed is a whole number"))
    };
    let rigs: Vec<(String, u64)> = match &asked {
        Some(list) => list.split(',').map(rig_and_seed).collect(),
        None => RIGS.map(|(rig, seed)| (rig.into(), seed)).into(),
    };
    let mut alarms = 0;
    for pair in rigs.chunks(2) {
        alarms += std::thread::scope(|threads| {
            let running: Vec<_> = pair.iter().map(|rig| threads.spawn(|| one(rig))).collect();
            running.into_iter().map(|t| t.join().unwrap()).sum::<u32>()
        });
    }
    assert_eq!(alarms, 0);
}
