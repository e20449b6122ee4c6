//! A disk without space: the recording ends, says why, stays readable, and the thrust is untouched.

use std::time::{Duration, Instant};

use serde_json::json;

use crate::common::{Site, Stack, wait};
use crate::table::Table;

/// The guard of free space refuses at once; a file that may not grow is followed by others and then ends.
pub fn full(table: &mut Table) {
    let site = Site::new();
    site.add("[gateway]", "recording = { file_bytes_max = 65536, files_max = 2, free_bytes_min = 0 }");
    let mut stack = Stack::start_at(site);
    stack.thrust(30.0, 60_000);
    let began = Instant::now();
    let url = |path: &str| format!("http://127.0.0.1:{}{path}", stack.site.port);
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let started = agent.post(url("/v1/recordings")).send_json(json!({"name": "long", "rate_hz": 500}));
    assert_eq!(started.expect("an answer").status(), 201);
    let list = wait("the recording to end", || {
        let list = stack.get("/v1/recordings")?;
        let last = list.as_array()?.last()?.clone();
        (last["state"] == "complete" && last["cause"].is_string()).then_some(list)
    });
    let took = began.elapsed();
    assert_eq!(list.as_array().map(Vec::len), Some(2), "{list}");
    assert!(list[1]["cause"].as_str().is_some_and(|cause| cause.contains("files_max")), "{list}");
    let metrics = stack.text("/metrics").expect("metrics");
    assert!(metrics.contains("kort_recording_active{thruster=\"t1\"} 0"), "{metrics}");
    for part in list.as_array().expect("a list") {
        let name = part["name"].as_str().expect("a name");
        let file = stack.site.folder.path().join(format!("recordings/{name}.mcap"));
        let recording = kort_recording::Recording::read(&file, None).expect("it reads");
        assert!(
            recording.losses.is_empty() && recording.rows() as u64 == part["rows"].as_u64().expect("rows")
        );
    }
    let t = stack.watch().next();
    assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
    table.row("recording at its limit", "ends with its cause, reads whole", Duration::from_secs(60), &[took]);
}
