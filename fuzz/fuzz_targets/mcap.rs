#![no_main]
#[path = "../entry_points.rs"]
#[allow(dead_code)]
mod entry_points;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    file.extend_from_slice(bytes);
    let _ = entry_points::recording(&file);
    let _ = entry_points::recording(bytes);
});
