//! Damaged logs of every format: read as far as they go, or refused in words; never a panic.

use std::io::Read;

use proptest::prelude::*;
use proptest::sample::Index;

use crate::map::ColumnMap;
use crate::{Recording, survey};

#[path = "../../../../tests/logs/writers.rs"]
mod writers;

const PX4: &[u8] = include_bytes!("../../../../tests/recordings/logs/px4-uavcan-escs.ulg.gz");

const ROS2: &[u8] = include_bytes!("../../../../tests/recordings/logs/ros2-two-thrusters.mcap");

const BAG: &[u8] = include_bytes!("../../../../tests/recordings/logs/ros2-two-thrusters.db3.gz");
const BETAFLIGHT: &[u8] = include_bytes!("../../../../tests/recordings/logs/betaflight-4.2.bfl.gz");

/// The beginning of what is packed.
fn unpacked(packed: &[u8], bytes: u64) -> Vec<u8> {
    let mut out = Vec::new();
    flate2::read::GzDecoder::new(packed).take(bytes).read_to_end(&mut out).unwrap();
    out
}

/// Logs with the map that brings each in.
fn seeds() -> Vec<(Vec<u8>, &'static str)> {
    vec![
        (unpacked(PX4, 40_000), "px4-uavcan:bank=1"),
        (unpacked(BETAFLIGHT, 20_000), "betaflight-vehicle"),
        (unpacked(BAG, u64::MAX), "ros2"),
        (writers::dataflash(60), "ardupilot"),
        (ROS2.to_vec(), "ros2"),
        (writers::candump(100).into_bytes(), "vesc-can:id=05,pole_pairs=7"),
    ]
}

/// A byte changed, some taken out, some put in, or the rest cut off.
type Damage = (Index, u8, usize, bool);

fn damaged(seed: &[u8], damages: &[Damage]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for (place, byte, kind, cut) in damages {
        let at = place.index(bytes.len().max(1)).min(bytes.len());
        match kind {
            0 if *cut => bytes.truncate(at),
            0 | 1 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b = *byte),
            2 => drop(bytes.drain(at..(at + usize::from(*byte)).min(bytes.len()))),
            _ => bytes.splice(at..at, std::iter::repeat_n(*byte, kind * 3)).for_each(drop),
        }
    }
    bytes
}

fn check(bytes: &[u8], map: &str) -> Result<(), TestCaseError> {
    if let Err(error) = survey("log", bytes) {
        prop_assert!(error.to_string().contains("hint:"));
    }
    let map = ColumnMap::find(map).unwrap();
    match Recording::decode("log", bytes, Some(&map)) {
        Ok(recording) => {
            prop_assert!(recording.rows() >= 2 && recording.time_s.windows(2).all(|w| w[0] < w[1]));
            prop_assert!(recording.columns.iter().all(|c| c.values.len() == recording.rows()));
        }
        Err(error) => prop_assert!(error.to_string().contains("hint:")),
    }
    Ok(())
}

#[test]
fn undamaged_they_read() {
    for (bytes, map) in seeds() {
        let map = ColumnMap::find(map).unwrap();
        let recording = Recording::decode("log", bytes.as_slice(), Some(&map)).unwrap();
        let kept = ["shaft_speed_rad_s", "duty_cmd"].iter().any(|name| recording.column(name).is_some());
        assert!(recording.rows() > 40 && kept);
    }
}

/// What lies behind a damaged stretch is read again, whether or not the log has marks to find it by: this one has none.
#[test]
fn a_damaged_stretch_takes_no_more_with_it() {
    let map = ColumnMap::find("px4-uavcan:bank=1").unwrap();
    let whole = unpacked(PX4, u64::MAX);
    let read = |bytes: &[u8]| Recording::decode("log", bytes, Some(&map)).unwrap();
    let (all, third) = (read(&whole).rows(), whole.len() / 3);
    let mut overwritten = whole.clone();
    overwritten[third..third + 2000].fill(0);
    let missing = [&whole[..third], &whole[third + 3333..]].concat();
    for bytes in [overwritten, missing] {
        let damaged = read(&bytes);
        assert!(damaged.rows() * 100 > all * 95 && damaged.rows() < all, "{} of {all}", damaged.rows());
        assert!(damaged.losses.iter().any(|loss| loss.contains("passed over")), "{:?}", damaged.losses);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    #[test]
    fn damage_is_survived(which in any::<Index>(), damages in prop::collection::vec((any::<Index>(), any::<u8>(), 0_usize..6, any::<bool>()), 1..6)) {
        let seeds = seeds();
        let (bytes, map) = &seeds[which.index(seeds.len())];
        check(&damaged(bytes, &damages), map)?;
    }

    #[test]
    fn nonsense_behind_a_good_beginning_is_survived(bytes in prop::collection::vec(any::<u8>(), 0..600), keep in 0_usize..400) {
        for (seed, map) in seeds() {
            let nonsense: Vec<u8> = seed[..keep].iter().chain(&bytes).copied().collect();
            check(&nonsense, map)?;
        }
    }
}
