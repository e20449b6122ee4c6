#![no_main]
#[path = "../entry_points.rs"]
#[allow(dead_code)]
mod entry_points;

use kort_gateway::bodies::Body;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for kind in Body::ALL {
        let _ = entry_points::body(kind, bytes);
    }
});
