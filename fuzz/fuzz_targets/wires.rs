#![no_main]
#[path = "../entry_points.rs"]
#[allow(dead_code)]
mod entry_points;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| entry_points::wire(bytes));
