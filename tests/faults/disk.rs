//! A disk without space, or a slow one: the recording ends, says why, stays readable, and the thrust is untouched.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Resource, Rlimit, prlimit};
use serde_json::{Value, json};

use crate::common::{Site, Stack, kill, wait};
use crate::table::Table;

/// The guard of free space refuses at once; a file that may not grow is followed by others and then ends.
pub fn at_its_limit(table: &mut Table) {
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

/// A small disk of its own, where this user may mount one.
struct SmallDisk(String);

impl SmallDisk {
    fn mount(at: &Path, size: &str) -> Option<SmallDisk> {
        std::fs::create_dir_all(at).unwrap();
        let at = at.display().to_string();
        let done = Command::new("mount")
            .args(["-t", "tmpfs", "-o", size, "kort-test", &at])
            .stderr(Stdio::null())
            .status();
        done.is_ok_and(|status| status.success()).then_some(SmallDisk(at))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").args(["--lazy", &self.0]).status();
    }
}

fn record(stack: &Stack, name: &str, rate_hz: f64) {
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let url = format!("http://127.0.0.1:{}/v1/recordings", stack.site.port);
    let started = agent.post(url).send_json(json!({"name": name, "rate_hz": rate_hz})).expect("an answer");
    assert_eq!(started.status(), 201);
}

fn recording(stack: &Stack, name: &str) -> Option<Value> {
    let list = stack.get("/v1/recordings")?;
    list.as_array()?.iter().find(|info| info["name"] == name).cloned()
}

/// The disk refuses a write: a file system of 256 KiB; where none may be mounted, a limit of the files' size.
pub fn full(table: &mut Table) {
    let site = Site::new();
    site.add("[gateway]", "recording = { free_bytes_min = 0 }");
    let folder = site.folder.path().join("recordings");
    let disk = SmallDisk::mount(&folder, "size=256k");
    let fault = if disk.is_some() { "disk full (256 KiB)" } else { "files may not grow (256 KiB)" };
    let mut stack = Stack::start_at(site);
    if disk.is_none() {
        let gateway = i32::try_from(stack.process_of("gateway")).ok().and_then(Pid::from_raw);
        let limit = Rlimit { current: Some(262_144), maximum: Some(262_144) };
        prlimit(gateway, Resource::Fsize, limit).expect("a lower limit is always permitted");
    }
    stack.thrust(30.0, 60_000);
    record(&stack, "full", 500.0);
    let file = folder.join("full.mcap");
    let (mut bytes, mut grown) = (0, Instant::now());
    let info = wait("the recording to end", || {
        let now = std::fs::metadata(&file).map_or(0, |file| file.len());
        if now > bytes {
            (bytes, grown) = (now, Instant::now());
        }
        recording(&stack, "full").filter(|info| info["state"] != "recording")
    });
    let took = grown.elapsed();
    assert_eq!(info["state"], "failed", "{info}");
    let cause = info["cause"].as_str().expect("a cause").to_lowercase();
    assert!(cause.contains("space") || cause.contains("too large"), "{info}");
    wait("metrics to say so", || {
        let metrics = stack.text("/metrics")?;
        let says = |line: &str| metrics.lines().any(|l| l == line);
        (says("kort_recording_active{thruster=\"t1\"} 0")
            && says("kort_recordings_failed_total{thruster=\"t1\"} 1")
            && says("kort_faults_total{thruster=\"t1\",fault=\"recording_failed\"} 1")
            && says("kort_fault_latched{thruster=\"t1\",fault=\"recording_failed\"} 1"))
        .then_some(())
    });
    wait("the event log to say so", || {
        let events = stack.get("/v1/events")?;
        events.as_array()?.iter().any(|event| event["kind"] == "recording_ended").then_some(())
    });
    let shown = wait("the fault to be shown", || {
        stack.state()?["faults"].as_array()?.iter().find(|fault| fault["name"] == "recording_failed").cloned()
    });
    assert!(shown["code"] == 49 && shown["since"].is_string(), "{shown}");
    let cause = shown["cause"].as_str().expect("a cause");
    assert!(
        cause.contains(info["name"].as_str().unwrap()) && cause.contains(info["cause"].as_str().unwrap()),
        "{shown}"
    );
    // What the disk took is readable.
    let kept = kort_recording::Recording::read(&file, None).expect("it reads");
    assert!(kept.rows() > 500, "{} rows", kept.rows());
    let (listed, lost) =
        (info["rows"].as_u64().expect("rows"), info["lost_samples"].as_u64().expect("samples"));
    assert_eq!(listed as usize, kept.rows(), "the list says what the disk has: {info}");
    assert!(lost > 0, "what the disk did not take is counted: {info}");
    let t = stack.watch().next();
    assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
    // It keeps nobody from anything, and goes when it is cleared.
    stack.thrust(40.0, 60_000);
    let cleared = stack.http("POST", "/clear-faults", None).map(|answer| answer.0);
    assert_eq!((cleared, &stack.state().expect("a state")["faults"]), (Some(200), &json!([])));
    let t = stack.watch().next();
    assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
    // The next gateway knows it too, though there was no space to write it down in a new file.
    let first = stack.process_of("gateway");
    kill(first, "KILL");
    wait("a successor", || stack.process("gateway").filter(|process| *process != first));
    let after = wait("the list", || recording(&stack, "full"));
    for key in ["state", "cause", "rows", "lost_samples"] {
        assert_eq!(after[key], info[key], "{key}: {after}");
    }
    table.row(
        fault,
        "recording ends with its cause, reads, thrust untouched",
        Duration::from_secs(2),
        &[took],
    );
    drop(stack);
    drop(disk);
}

/// A tracer that holds up every write of a recording, as a slow disk does: it follows the recording's thread alone, for
/// what it follows stands still at every call of the system.
struct SlowDisk(Child);

impl SlowDisk {
    fn under(process: u32, files: &[&Path], write_takes: Duration) -> Option<SlowDisk> {
        let thread = wait("the recording's thread", || {
            let threads = std::fs::read_dir(format!("/proc/{process}/task")).ok()?;
            let name = |thread: &Path| std::fs::read_to_string(thread.join("comm")).unwrap_or_default();
            threads.flatten().map(|thread| thread.path()).find(|thread| name(thread).trim() == "record")
        });
        let mut command = Command::new("strace");
        command.args(["-q", "-o", "/dev/null", "-e", "trace=write", "-p"]).arg(thread.file_name()?);
        command.args(["-e", &format!("inject=write:delay_enter={}", write_takes.as_micros())]);
        for file in files {
            command.arg("-P").arg(file);
        }
        let mut tracer = SlowDisk(command.stdin(Stdio::null()).stderr(Stdio::null()).spawn().ok()?);
        let traced = wait("the tracer", || {
            let status = std::fs::read_to_string(thread.join("status")).ok()?;
            let by = status.lines().find_map(|line| line.strip_prefix("TracerPid:"))?.trim();
            let ended = tracer.0.try_wait().is_ok_and(|status| status.is_some());
            (by != "0" || ended).then_some(!ended)
        });
        traced.then_some(tracer)
    }
}

impl Drop for SlowDisk {
    fn drop(&mut self) {
        // One that ended by itself was not permitted.
        if matches!(self.0.try_wait(), Ok(None)) {
            kill(self.0.id(), "TERM");
            let _ = self.0.wait();
        }
    }
}

/// Every write takes two seconds, for longer than rows may wait: samples are lost and counted, the thrust is not.
pub fn slow(table: &mut Table) {
    let site = Site::new();
    let config = std::fs::read_to_string(site.config()).unwrap();
    std::fs::write(site.config(), config.replace("servo = { rate_hz = 500 }", "servo = { rate_hz = 2000 }"))
        .unwrap();
    let folder = site.folder.path().join("recordings");
    let mut stack = Stack::start_at(site);
    stack.thrust(30.0, 60_000);
    record(&stack, "slow", 2000.0);
    std::thread::sleep(Duration::from_secs(1));
    let files = [folder.join("slow.mcap"), folder.join(".slow.draft")];
    let files = files.each_ref().map(std::path::PathBuf::as_path);
    let Some(disk) = SlowDisk::under(stack.process_of("gateway"), &files, Duration::from_secs(2)) else {
        println!("not run: a slow disk (strace is not installed or not permitted)");
        return;
    };
    let mut watch = stack.watch();
    let (began_ns, mut longest_ns) = (watch.next().time_ns, 0);
    loop {
        let t = watch.next();
        assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
        // The newest command's age: the chain from gateway to servo goes on.
        longest_ns = longest_ns.max(t.time_ns.saturating_sub(t.command_stamp_ns));
        if t.time_ns > began_ns + 9_000_000_000 {
            break;
        }
    }
    drop(disk);
    let lost =
        wait("losses to be told", || recording(&stack, "slow")?["lost_samples"].as_u64().filter(|n| *n > 0));
    println!("slow disk: {lost} samples lost, and said so");
    table.row(
        "disk slow (2 s a write)",
        "losses counted, thrust untouched; age of a command",
        Duration::from_nanos(5 * crate::common::PERIOD_NS),
        &[Duration::from_nanos(longest_ns)],
    );
}

/// What the processes say goes to a full disk: none ends for it, not even where there is much to say.
pub fn log_full(table: &mut Table) {
    let to_a_full_disk = ["sh", "-c", r#"exec "$0" "$@" > /dev/full 2>&1"#];
    let mut stack = Stack::start_in(&to_a_full_disk, Site::new());
    let roles = ["servo", "controller", "gateway"];
    let before = roles.map(|role| stack.process_of(role));
    for newton in [20.0, 30.0, 40.0] {
        stack.thrust(newton, 60_000);
    }
    assert_eq!(
        stack.http("PUT", "/setpoint", Some(json!({"thrust_n": 1e6}))).map(|answer| answer.0),
        Some(422)
    );
    let after = roles.map(|role| stack.process_of(role));
    let ended = before.iter().zip(after).filter(|(before, after)| **before != *after).count();
    table.quantity("log on a full disk", "thrust as ever; processes that ended", "", 0.0, ended as f64);
}
