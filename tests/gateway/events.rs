//! The event log as a client follows it.

use kort_proto::events::{Event, EventKind, EventLog};
use kort_proto::faults::Fault;

use crate::asking::send;
use crate::common::{self, Site, Stack};

/// Who asks on from the last event it knows is told the next ones, not the newest: nothing is lost in between. Without a
/// place to begin it is told the newest.
#[test]
fn a_client_that_asks_on_from_the_last_it_knows_misses_none() {
    common::in_real_time(|| {
        let site = Site::new();
        let log = EventLog::open(&site.folder.path().join("events")).unwrap();
        let old = Event::now(EventKind::FaultInherited, Some("t1"), "supervisor", "old")
            .fault(Fault::ServoLost)
            .since("2026-01-01T12:00:00.000000Z".into());
        log.append(&old).unwrap();
        let written: Vec<String> = (0..30).map(|n| format!("event {n}")).collect();
        for words in &written {
            log.append(&Event::now(EventKind::LeaseTaken, Some("t1"), "bench", words)).unwrap();
        }
        let stack = Stack::start_at(site);
        let events = |query: &str| {
            let answer = send(stack.site.port, "GET", &format!("/v1/events?{query}"), &[], b"");
            assert_eq!(answer.status, 200, "{query}: {}", answer.text());
            answer.json().as_array().unwrap().clone()
        };
        let first = &events("since=0&limit=1")[0];
        assert_eq!(
            (&first["detail"], &first["since"]),
            (&"old".into(), &"2026-01-01T12:00:00.000000Z".into())
        );
        let (mut last, mut told) = (old.id, Vec::new());
        while told.len() < written.len() {
            let next = events(&format!("since={last}&limit=7"));
            last = next.last().expect("more of them")["id"].as_u64().unwrap();
            told.extend(next.iter().map(|event| event["detail"].as_str().unwrap().to_owned()));
        }
        assert_eq!(told[..written.len()], written);
        let newest = events("limit=1")[0]["id"].as_u64().unwrap();
        assert!(newest >= last, "without a place to begin the newest are told");
    });
}

/// Whoever stops again and again, with nothing armed, leaves the log to what matters: repeats are one event with a count.
/// The stop that had something to stop is an event of its own.
#[test]
fn stops_without_end_are_told_once_and_counted() {
    common::in_real_time(|| {
        let mut stack = Stack::start_at(Site::new());
        stack.thrust(40.0, 60_000);
        for _ in 0..400 {
            assert_eq!(send(stack.site.port, "POST", "/v1/stop", &[], b"").status, 200);
        }
        let (told, events) = common::wait("all of them", || {
            let events = stack.get("/v1/events")?.as_array()?.clone();
            let stops: Vec<_> = events.iter().filter(|event| event["kind"] == "stopped").cloned().collect();
            let counted: u64 = stops.iter().map(|stop| stop["times"].as_u64().unwrap_or(1)).sum();
            (counted == 400).then_some((stops, events))
        });
        assert!(told.len() < 20, "{told:?}");
        let armed = |stop: &serde_json::Value| stop["detail"].as_str().unwrap().contains("was armed: t1");
        assert!(armed(&told[0]) && !told[1..].iter().any(armed), "{told:?}");
        assert!(events.iter().any(|event| event["kind"] == "armed"), "{events:?}");
    });
}

/// What the disk does not take is told by a number, and is written once it can be.
#[test]
fn events_that_the_disk_does_not_take_are_counted_until_it_does() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let folder = stack.site.folder.path().join("events");
        let unwritten = || {
            let metrics = stack.text("/metrics")?;
            metrics.lines().find_map(|line| line.strip_prefix("kort_events_unwritten "))?.parse().ok()
        };
        common::wait("all to be written", || (unwritten() == Some(0)).then_some(()));
        // A file where the folder was: nothing can be made in it.
        std::fs::remove_dir_all(&folder).unwrap();
        std::fs::write(&folder, "").unwrap();
        let (status, lease) =
            stack.http("POST", "/lease", Some(serde_json::json!({"holder": "bench"}))).unwrap();
        assert_eq!(status, 201, "{lease}");
        common::wait("an event that is not written", || (unwritten()? > 0).then_some(()));
        std::fs::remove_file(&folder).unwrap();
        common::wait("it to be written", || (unwritten() == Some(0)).then_some(()));
        let log = std::fs::read_to_string(folder.join("events.jsonl")).unwrap();
        assert!(log.contains("lease_taken"), "{log}");
    });
}
