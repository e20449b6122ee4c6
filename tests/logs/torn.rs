//! Logs that were cut off, plain or packed: read up to where they end.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::lab::{kort, stderr, write};
use crate::{read, writers};

fn unpacked(name: &str) -> Vec<u8> {
    let mut whole = Vec::new();
    let file = std::fs::File::open(format!("tests/recordings/logs/{name}")).unwrap();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(file), &mut whole).unwrap();
    whole
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(bytes).unwrap();
    gzip.finish().unwrap()
}

#[test]
fn a_log_that_was_cut_off_is_read_up_to_its_end_packed_or_not() {
    for (name, whole, map) in [
        ("torn.bfl", unpacked("betaflight-4.2.bfl.gz"), "betaflight-vehicle"),
        ("torn.bin", writers::dataflash(400), "ardupilot"),
        ("torn.db3", unpacked("ros2-two-thrusters.db3.gz"), "ros2"),
        ("torn.ulg", unpacked("px4-uavcan-escs.ulg.gz"), "px4-uavcan:bank=1"),
        ("torn.log", writers::candump(400).into_bytes(), "vesc-can:id=05,pole_pairs=7"),
    ] {
        let all = read(&write(&format!("whole-{name}"), &whole), map).rows();
        let gzip = packed(&whole);
        for (log, bytes, why) in [
            (name.to_owned(), &whole[..whole.len() * 59 / 100], ""),
            (format!("{name}.gz"), &gzip[..gzip.len() * 59 / 100], "the file ends in the middle of its data"),
        ] {
            let log = write(&log, bytes);
            let said = kort(&["columns", &log, "--json"]);
            assert_eq!(said.status.code(), Some(3), "{log}: {}", stderr(&said));
            assert!(stderr(&said).contains(why), "{log}: {}", stderr(&said));
            let rows = read(&log, map).rows();
            assert!(rows * 10 > all * 3 && rows < all, "{log}: {rows} of {all}");
        }
    }
}
