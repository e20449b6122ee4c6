//! What ends a recording by itself: its time, and the space that it leaves to others.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::asking::{JSON, assert_problem, send};
use crate::common::{self, Site, Stack, kill, wait};
use crate::parts::{list, record};

/// The list, once nothing in it is being written.
fn ended(port: u16) -> Vec<Value> {
    wait("the recording to end", || {
        Some(list(port)).filter(|list| list.iter().all(|info| info["state"] != "recording"))
    })
}

/// The time is that of the whole recording: one that goes on in further files would never reach it else.
#[test]
fn the_time_of_a_recording_counts_over_all_its_parts() {
    common::in_real_time(|| {
        let site = Site::new();
        site.add("[gateway]", "recording = { file_bytes_max = 65536, time_max_s = 5.0, free_bytes_min = 0 }");
        let mut stack = Stack::start_at(site);
        let port = stack.site.port;
        stack.thrust(30.0, 60_000);
        record(port, "long");
        let parts = ended(port);
        let last = parts.last().unwrap();
        assert!(parts.len() > 1, "it went on in another file: {parts:?}");
        assert_eq!(last["state"], "complete", "{last}");
        assert!(last["cause"].as_str().is_some_and(|cause| cause.contains("time_max_s = 5")), "{last}");
        let seconds: f64 = parts.iter().map(|part| part["duration_s"].as_f64().unwrap()).sum();
        assert!((4.8..5.2).contains(&seconds), "{seconds} s in {} parts", parts.len());
        let t = stack.watch().next();
        assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
    });
}

/// A servo that says nothing more does not keep a recording open for ever.
#[test]
fn a_recording_of_a_silent_servo_ends_at_its_time_too() {
    common::in_real_time(|| {
        let site = Site::new();
        site.add("[gateway]", "recording = { time_max_s = 3.0, free_bytes_min = 0 }");
        let stack = Stack::start_at(site);
        let port = stack.site.port;
        record(port, "silent");
        // The supervisor would replace it.
        let stopped = [stack.supervisor.id(), stack.process_of("servo")];
        for process in stopped {
            kill(process, "STOP");
        }
        let parts = std::panic::catch_unwind(|| ended(port));
        for process in stopped {
            kill(process, "CONT");
        }
        let parts = parts.unwrap_or_else(|why| std::panic::resume_unwind(why));
        assert_eq!((parts.len(), &parts[0]["state"]), (1, &json!("complete")), "{parts:?}");
        assert!(parts[0]["cause"].as_str().unwrap().contains("time_max_s = 3"), "{parts:?}");
    });
}

/// Others fill the disk up to what is to stay free: the recording ends with its cause and reads whole, the fault is shown,
/// the thrust goes on, and none begins until there is space again.
#[test]
fn a_recording_leaves_the_space_to_others_that_is_to_stay_free() {
    let script = r#"mkdir -p "$0" && mount -t tmpfs -o size=8m kort-test "$0" && exec "$@""#;
    let mounts = Command::new("unshare")
        .args(["--mount", "sh", "-c", script, "/mnt", "true"])
        .stderr(Stdio::null())
        .status();
    if !mounts.is_ok_and(|done| done.success()) {
        eprintln!("not tried: a disk that others fill (mounting is not permitted)");
        return;
    }
    common::in_real_time(|| {
        let site = Site::new();
        site.add("[gateway]", "recording = { free_bytes_min = 4194304 }");
        let folder = site.folder.path().join("recordings");
        let at = folder.to_str().unwrap().to_owned();
        let mut stack = Stack::start_in(&["unshare", "--mount", "sh", "-c", script, &at], site);
        let port = stack.site.port;
        stack.thrust(30.0, 60_000);
        record(port, "guarded");
        std::thread::sleep(Duration::from_millis(1200));
        // Seen from outside its mounts.
        let inside = std::path::PathBuf::from(format!("/proc/{}/root{at}", stack.supervisor.id()));
        std::fs::write(inside.join("others"), vec![1; 5 << 20]).unwrap();
        let filled = Instant::now();
        let parts = ended(port);
        assert!(filled.elapsed() < Duration::from_secs(3), "it took {:?}", filled.elapsed());
        let info = &parts[0];
        assert_eq!((parts.len(), &info["state"]), (1, &json!("failed")), "{info}");
        let cause = info["cause"].as_str().unwrap();
        assert!(cause.contains("free_bytes_min = 4194304") && cause.contains("bytes are free"), "{info}");
        let kept = kort_recording::Recording::read(&inside.join("guarded.mcap"), None).unwrap();
        assert!(kept.losses.is_empty(), "it has its end: {:?}", kept.losses);
        assert_eq!(
            (kept.rows() as u64, 0),
            (info["rows"].as_u64().unwrap(), info["lost_samples"].as_u64().unwrap())
        );
        let latched = |stack: &Stack| {
            stack.state()?["faults"].as_array()?.iter().find(|f| f["name"] == "recording_failed").cloned()
        };
        let shown = wait("the fault", || latched(&stack));
        assert_eq!(shown["code"], 49, "{shown}");
        let t = stack.watch().next();
        assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
        let refused = send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "next"}"#);
        assert_problem(&refused, 507, "recording-failed", "too little space");
        std::fs::remove_file(inside.join("others")).unwrap();
        record(port, "next");
        assert_eq!(send(port, "DELETE", "/v1/recordings/next", &[], b"").json()["state"], "complete");
        // The next gateway shows it as it was, the one after it was cleared no more.
        let succeeded = |stack: &Stack| {
            let before = stack.process_of("gateway");
            kill(before, "KILL");
            wait("a successor", || stack.process("gateway").filter(|process| *process != before));
            wait("its state", || stack.state())
        };
        succeeded(&stack);
        assert_eq!(latched(&stack), Some(shown));
        // The lease went with the gateway; the servo's faults can be cleared once its controller hears the next one.
        wait("it to be cleared", || {
            let answer = send(port, "POST", "/v1/thrusters/t1/clear-faults", &[], b"");
            (answer.status == 200).then_some(())
        });
        assert_eq!(latched(&stack), None);
        wait("the clearing to be written", || {
            let events =
                std::fs::read_to_string(stack.site.folder.path().join("events/events.jsonl")).ok()?;
            events.contains("faults_cleared").then_some(())
        });
        succeeded(&stack);
        assert_eq!(latched(&stack), None);
    });
}
