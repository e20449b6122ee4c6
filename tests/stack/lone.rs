//! Processes that are started one by one, as containers are: no supervisor tells a successor what stood latched.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime};

use kort_proto::faults::Fault;
use kort_proto::transport::{Latched, Stood, Watched};
use serde_json::{Value, json};

use crate::LEASE_MS;
use crate::common::{self, Site, Stack, kill, wait};

fn start(site: &Site, role: &str) -> Child {
    let log =
        std::fs::OpenOptions::new().create(true).append(true).open(site.folder.path().join("log")).unwrap();
    let mut command = site.command(role);
    if role != "gateway" {
        command.args(["--thruster", "t1"]);
    }
    command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap()
}

/// How often a process was heard to latch a fault. What the gateway says on its own account, of a servo that is away, is none of it.
fn told(stack: &Stack, who: &str, fault: Fault) -> usize {
    let events = stack.get("/v1/events").unwrap();
    let of_it = |e: &&Value| e["kind"] == "tripped" && e["who"] == who && e["fault"] == fault.code();
    events.as_array().unwrap().iter().filter(of_it).count()
}

/// Replaces a process, and waits until the other one says what that one took along.
fn replace(stack: &Stack, process: &mut Child, role: &str, how: &str, who: &str, fault: Fault) {
    let before = told(stack, who, fault);
    kill(process.id(), how);
    process.wait().unwrap();
    *process = start(&stack.site, role);
    wait(fault.name(), || (told(stack, who, fault) > before).then_some(()));
    wait("the state to show it", || {
        let state = stack.state()?;
        state["faults"].as_array()?.iter().any(|shown| shown["name"] == fault.name()).then_some(())
    });
}

#[test]
fn what_is_latched_outlives_the_restart_of_any_one_of_them() {
    common::in_real_time(|| {
        let site = Site::new();
        let (mut servo, mut controller) = (start(&site, "servo"), start(&site, "controller"));
        let mut stack = Stack::of(start(&site, "gateway"), site);
        for how in ["KILL", "TERM"] {
            stack.wait_until_up();
            stack.thrust(80.0, LEASE_MS);
            // The servo owns the shared memory: its successor makes a new one, and knows nothing.
            replace(&stack, &mut servo, "servo", how, "controller", Fault::ServoLost);
            // The controller had it latched, and goes.
            replace(&stack, &mut controller, "controller", how, "servo", Fault::ControllerRestarted);
            let (status, _) = stack.http("POST", "/arm", None).unwrap();
            assert_eq!(status, 409, "{how}: latched");
            // And the servo that has that latched now.
            replace(&stack, &mut servo, "servo", how, "controller", Fault::ServoLost);
        }
        for mut process in [servo, controller] {
            kill(process.id(), "TERM");
            process.wait().unwrap();
        }
    });
}

/// All three, ended whatever becomes of the test.
struct Trio(Vec<Child>);

impl Trio {
    fn start(site: &Site) -> Self {
        Self(["controller", "gateway", "servo"].map(|role| start(site, role)).into())
    }

    fn kill(&mut self) {
        for process in &mut self.0 {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

impl Drop for Trio {
    fn drop(&mut self) {
        self.kill();
    }
}

/// The state's fault of this name, once it says since when.
fn dated(stack: &Stack, fault: Fault) -> Value {
    wait("the fault with its time", || {
        let state = stack.state()?;
        let shown = state["faults"].as_array()?.iter().find(|shown| shown["name"] == fault.name())?;
        shown["since"].is_string().then(|| shown.clone())
    })
}

/// As a service that nobody clears: takes the lease, arms and asks for a thrust.
fn drive(stack: &mut Stack, thrust_n: f64) {
    stack.leases.clear();
    let lease = wait("the lease", || {
        let wanted = json!({"holder": "test", "ttl_ms": LEASE_MS, "takeover": true});
        stack.http("POST", "/lease", Some(wanted)).filter(|(status, _)| *status == 201).map(|(_, body)| body)
    });
    stack.leases.insert("t1", lease["lease_id"].as_str().unwrap().to_owned());
    let done = |answer: Option<(u16, Value)>| answer.filter(|(status, _)| *status < 300).map(|_| ());
    wait("the arming and the setpoint", || {
        done(stack.http("POST", "/arm", None))?;
        done(stack.http("PUT", "/setpoint", Some(json!({"thrust_n": thrust_n}))))
    });
    stack.watch().until("thrust", |t| t.signals.thrust_n > 0.8 * thrust_n);
}

/// No log and no file of an earlier time dates a stop of now, and nobody who is started with the others dies of what the dead left.
#[test]
fn a_stop_is_dated_by_no_earlier_one_however_all_of_them_ended() {
    common::in_real_time(|| {
        let site = Site::new();
        // A service of long ago, whose supervisor is gone.
        let since = "2020-01-01T00:00:00Z".to_owned();
        let latched = vec![Latched { code: Fault::GatewayLost.code(), since, before: None }];
        let stood = Stood { latched, controller_faults: Fault::GatewayLost.bit(), ..Stood::default() };
        let watched =
            Watched { generation: Some(1), thrusters: [("t1".into(), stood)].into(), ..Watched::default() };
        watched.write(&site.deployment().watched_file()).unwrap();
        let mut running = Trio::start(&site);
        let supervisor = Command::new("true").spawn().unwrap();
        let mut stack = Stack::of(supervisor, site);
        let mut last = SystemTime::now();
        for round in 0..3 {
            stack.wait_until_up();
            drive(&mut stack, [60.0, 100.0, 60.0][round]);
            let mut watch = stack.watch();
            kill(running.0[1].id(), "KILL");
            running.0[1].wait().unwrap();
            watch.until("the stop", |t| t.armed == 0);
            running.0[1] = start(&stack.site, "gateway");
            let fault = dated(&stack, Fault::GatewayLost);
            let since = humantime::parse_rfc3339(fault["since"].as_str().unwrap()).unwrap();
            assert!(since > last, "round {round}: {fault}, the one before {last:?}");
            assert_eq!(told(&stack, "controller", Fault::GatewayLost), round + 1);
            last = since;
            running.kill();
            running = Trio::start(&stack.site);
        }
        stack.wait_until_up();
        assert!(
            running.0.iter_mut().all(|process| process.try_wait().unwrap().is_none()),
            "nobody died of it"
        );
        // A servo that is told to end takes an armed drive along like one that is killed.
        drive(&mut stack, 60.0);
        kill(running.0[2].id(), "TERM");
        running.0[2].wait().unwrap();
        std::thread::sleep(Duration::from_millis(1000));
        assert!(dated(&stack, Fault::ServoLost)["before"]["thrust_n"].as_f64().is_some_and(|n| n > 40.0));
    });
}
