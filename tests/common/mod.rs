//! A deployment under test: real processes, a root and a port of its own, so that tests run side
//! by side. The controller is slow (10 Hz) to keep its time-outs above what a loaded machine does
//! to a process; what is asserted is order and outcome, and time only in controller periods.
#![allow(dead_code)]

use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use kort_proto::messages::Telemetry;
use kort_proto::transport::Deployment;
use serde_json::{Value, json};

pub mod bench;
pub mod jobs;
pub mod pages;
mod stalls;
mod watch;
#[allow(unused_imports)]
pub use stalls::{STOOD_STILL, Stalls, in_real_time};
#[allow(unused_imports)]
pub use watch::{Watch, at_zero};

/// Controller period of the deployments under test, ns.
pub const PERIOD_NS: u64 = 100_000_000;
/// How long anything may take on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(120);

pub const KORT: &str = env!("CARGO_BIN_EXE_kort");

/// An effect that no control law and no observer uses, as a rig states it.
pub const VENTILATION: &str = r#"
[[effects]]
effect = "ventilation"
thrust_loss = 0.2
onset_speed_rad_s = 60
lag_s = 0.1
recovery_lag_s = 0.3
hysteresis = 0.2
drag_loss_over_lift_loss = 0.9
"#;

/// A folder with a configuration, not yet started.
pub struct Site {
    pub folder: tempfile::TempDir,
    pub port: u16,
}

impl Site {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/whitcomb-yoerger-1999.toml");
        let config = format!(
            r#"
[gateway]
bind = "127.0.0.1:{port}"
recordings = "{folder}/recordings"
events = "{folder}/events"
tokens = "{folder}/tokens.toml"
[thrusters.t1]
rig = "{rig}"
amplifier = "simulated"
servo = {{ rate_hz = 500 }}
controller = {{ rate_hz = 10, law = "velocity_servo" }}
limits = {{ full_drive_s = 0.005 }}
"#,
            folder = folder.path().display()
        );
        std::fs::write(folder.path().join("kort.toml"), config).unwrap();
        Self { folder, port }
    }

    /// The controller, and the gateway's bus with it, at the rate of a deployment.
    pub fn with_a_fast_controller(self) -> Self {
        let config = std::fs::read_to_string(self.config()).unwrap();
        std::fs::write(self.config(), config.replace("rate_hz = 10,", "rate_hz = 250,")).unwrap();
        self
    }

    /// A second thruster beside the first, of another kind: t2, a T200.
    pub fn with_t2(self) -> Self {
        let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/t200.toml");
        let mut config = std::fs::read_to_string(self.config()).unwrap();
        config += &format!(
            r#"
[thrusters.t2]
rig = "{rig}"
amplifier = "simulated"
servo = {{ rate_hz = 400 }}
controller = {{ rate_hz = 10, law = "model3_inversion" }}
"#
        );
        std::fs::write(self.config(), config).unwrap();
        self
    }

    /// Adds a line below another one of the configuration.
    pub fn add(&self, below: &str, line: &str) {
        let text = std::fs::read_to_string(self.config()).unwrap();
        assert!(text.contains(below), "{below} is not in {text}");
        std::fs::write(self.config(), text.replacen(below, &format!("{below}\n{line}"), 1)).unwrap();
    }

    pub fn config(&self) -> PathBuf {
        self.folder.path().join("kort.toml")
    }

    pub fn root(&self) -> PathBuf {
        self.folder.path().join("shm")
    }

    pub fn deployment(&self) -> Deployment {
        Deployment::new(Some(&self.root()))
    }

    pub fn command(&self, role: &str) -> Command {
        let mut command = Command::new(KORT);
        command.arg(role).arg("--config").arg(self.config()).arg("--root").arg(self.root());
        command.current_dir(self.folder.path()).stdin(Stdio::null());
        command
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
    }

    /// Starts a role with its talk going to a file.
    pub fn spawn(&self, role: &str) -> Child {
        self.spawn_in(&[], role)
    }

    /// Starts a role by another program that becomes it: one that sets limits, or parts its mounts from ours.
    pub fn spawn_in(&self, surroundings: &[&str], role: &str) -> Child {
        let log = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(self.folder.path().join("log"))
            .unwrap();
        let kort = self.command(role);
        let mut command = match surroundings {
            [] => kort,
            [program, rest @ ..] => {
                let mut command = Command::new(program);
                command.args(rest).arg(kort.get_program()).args(kort.get_args());
                command.current_dir(self.folder.path()).stdin(Stdio::null());
                command
            }
        };
        command.stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap()
    }
}

impl Drop for Site {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("what the processes said:\n{}", self.log());
        }
        // Owning clears what killed processes left in shared memory.
        let _ = self.deployment().own();
    }
}

/// Waits until `done` gives something.
pub fn wait<T>(what: &str, mut done: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + PATIENCE;
    loop {
        if let Some(value) = done() {
            return value;
        }
        assert!(Instant::now() < end, "waited in vain for: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

pub fn kill(pid: u32, signal: &str) {
    let done = Command::new("kill").args([format!("-{signal}"), pid.to_string()]).status().unwrap();
    assert!(done.success(), "kill -{signal} {pid}");
}

pub fn run(command: &mut Command) -> Output {
    command.output().unwrap()
}

/// `kort up` with all its children.
pub struct Stack {
    pub site: Site,
    pub supervisor: Child,
    thruster: &'static str,
    pub leases: std::collections::BTreeMap<&'static str, String>,
}

impl Stack {
    pub fn start() -> Self {
        Self::start_at(Site::new())
    }

    pub fn start_at(site: Site) -> Self {
        Self::start_in(&[], site)
    }

    /// As [`Site::spawn_in`].
    pub fn start_in(surroundings: &[&str], site: Site) -> Self {
        let stack = Self::of(site.spawn_in(surroundings, "up"), site);
        stack.wait_until_up();
        stack
    }

    /// One that nobody waits for: its drives may tell nothing.
    pub fn of(supervisor: Child, site: Site) -> Self {
        Self { site, supervisor, thruster: "t1", leases: Default::default() }
    }

    /// From here on everything is about this thruster.
    pub fn at(&mut self, thruster: &'static str) -> &mut Self {
        self.thruster = thruster;
        self
    }

    /// All three processes speak.
    pub fn wait_until_up(&self) {
        wait("the service to answer with a controller's law", || {
            let state = self.state()?;
            (!state["controller"].is_null() && !state["measured"]["shaft_speed_rad_s"].is_null())
                .then_some(())
        });
    }

    /// Sends a request; status and body.
    pub fn http(&self, method: &str, path: &str, body: Option<Value>) -> Option<(u16, Value)> {
        let agent: ureq::Agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(5)))
            .build()
            .into();
        let url = format!("http://127.0.0.1:{}/v1/thrusters/{}{path}", self.site.port, self.thruster);
        let lease = self.leases.get(self.thruster);
        let request =
            ureq::http::Request::builder().method(method).uri(url).header("Content-Type", "application/json");
        let request = match lease {
            Some(lease) => request.header("Lease-Id", lease),
            None => request,
        };
        let body = body.map(|b| b.to_string()).unwrap_or_default();
        let mut response = agent.run(request.body(body).ok()?).ok()?;
        let text = response.body_mut().read_to_string().ok()?;
        Some((response.status().as_u16(), serde_json::from_str(&text).unwrap_or(Value::Null)))
    }

    /// A page of the gateway as text.
    pub fn text(&self, path: &str) -> Option<String> {
        let agent: ureq::Agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(5)))
            .build()
            .into();
        let url = format!("http://127.0.0.1:{}{path}", self.site.port);
        agent.get(url).call().ok()?.body_mut().read_to_string().ok()
    }

    /// A document of the gateway.
    pub fn get(&self, path: &str) -> Option<Value> {
        serde_json::from_str(&self.text(path)?).ok()
    }

    pub fn state(&self) -> Option<Value> {
        self.http("GET", "", None).filter(|(status, _)| *status == 200).map(|(_, body)| body)
    }

    pub fn expect(&self, method: &str, path: &str, body: Option<Value>) -> Value {
        let (status, answer) =
            self.http(method, path, body).unwrap_or_else(|| panic!("{method} {path}: no answer"));
        assert!(status < 300, "{method} {path}: {status} {answer}");
        answer
    }

    /// Takes the lease, clears, arms and asks for a thrust; waits until it is there. A machine that holds a process up
    /// for longer than a drive may wait trips it before the test has begun: then once more.
    pub fn thrust(&mut self, newton: f64, ttl_ms: u64) {
        let end = Instant::now() + PATIENCE;
        loop {
            self.command(newton, ttl_ms);
            let there = |t: &Telemetry| (t.signals.thrust_n - newton).abs() < 0.2 * newton.abs();
            // A trip of the controller shows as disarmed, without a fault of the servo's own.
            let tripped = |t: &Telemetry| t.faults != 0 || t.armed == 0;
            let t = self.watch().until("the thrust to be there, or a trip", |t| there(t) || tripped(t));
            if !tripped(&t) {
                return;
            }
            assert!(Instant::now() < end, "it trips again and again: {t:?}");
            eprintln!("tripped before the test began, faults {:#x}; once more", t.faults);
        }
    }

    /// The same, and the gateway is believed: shared memory may be out of reach.
    pub fn thrust_by_state(&mut self, newton: f64, ttl_ms: u64) {
        let end = Instant::now() + PATIENCE;
        loop {
            self.command(newton, ttl_ms);
            let there = wait("the thrust to be there, or a trip", || {
                let state = self.state()?;
                let thrust_n = state["measured"]["thrust_n"].as_f64()?;
                let there = (thrust_n - newton).abs() < 0.2 * newton.abs();
                (there || state["faults"] != json!([])).then_some(there)
            });
            if there {
                return;
            }
            assert!(Instant::now() < end, "it trips again and again");
        }
    }

    /// Takes the lease, clears, arms and asks for a thrust.
    pub fn command(&mut self, newton: f64, ttl_ms: u64) {
        let lease = wait("the lease", || {
            if self.leases.contains_key(self.thruster) {
                self.http("DELETE", "/lease", None)?;
                self.leases.remove(self.thruster);
            }
            let (status, body) =
                self.http("POST", "/lease", Some(json!({"holder": "test", "ttl_ms": ttl_ms})))?;
            (status == 201).then_some(body)
        });
        self.leases.insert(self.thruster, lease["lease_id"].as_str().unwrap().to_owned());
        // A trip between any two of these begins them anew.
        wait("faults to clear, the servo to arm and the setpoint to be accepted", || {
            self.http("POST", "/clear-faults", None)?;
            let done = |answer: Option<(u16, Value)>| answer.filter(|(status, _)| *status < 300).map(|_| ());
            done(self.http("POST", "/arm", None))?;
            done(self.http("PUT", "/setpoint", Some(json!({"thrust_n": newton}))))
        });
    }

    /// Listens to the servo past the gateway.
    pub fn watch(&self) -> Watch {
        Watch::new(&self.site.deployment(), self.thruster)
    }

    /// Process of a child by its role.
    pub fn process(&self, role: &str) -> Option<u32> {
        let mine = |pid: u32| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let mut words = line.split(|b| *b == 0).skip_while(|w| *w != b"--thruster").skip(1);
            words.next().is_none_or(|id| id == self.thruster.as_bytes())
        };
        children(self.supervisor.id())
            .into_iter()
            .find(|(pid, r)| r == role && mine(*pid))
            .map(|(pid, _)| pid)
    }

    pub fn process_of(&self, role: &str) -> u32 {
        wait("the child to live", || self.process(role))
    }
}

impl Drop for Stack {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let log = self.site.log();
            STOOD_STILL
                .set(["loop_stalled", "command_timeout", "drive_lost"].iter().any(|trip| log.contains(trip)));
            eprintln!("--- log of the deployment\n{log}");
        }
        let children = children(self.supervisor.id());
        let _ = Command::new("kill").args(["-TERM", &self.supervisor.id().to_string()]).status();
        let end = Instant::now() + Duration::from_secs(10);
        while matches!(self.supervisor.try_wait(), Ok(None)) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.supervisor.kill();
        let _ = self.supervisor.wait();
        for (pid, _) in children {
            let _ = Command::new("kill").args(["-KILL", &pid.to_string()]).stderr(Stdio::null()).status();
        }
    }
}

/// Children of a process with their role, the first argument; no zombies.
pub fn children(parent: u32) -> Vec<(u32, String)> {
    let threads = std::fs::read_dir(format!("/proc/{parent}/task")).into_iter().flatten().flatten();
    let lists = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    let pids: Vec<u32> = lists
        .flat_map(|list| list.split(' ').filter_map(|pid| pid.parse().ok()).collect::<Vec<_>>())
        .collect();
    let role = |pid: &u32| {
        let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        line.split(|b| *b == 0).nth(1).map(|role| String::from_utf8_lossy(role).into_owned())
    };
    pids.into_iter().filter_map(|pid| Some((pid, role(&pid).filter(|_| alive(pid))?))).collect()
}

/// Is a process there (and no zombie)?
pub fn alive(pid: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{pid}/stat"))
        .ok()
        .and_then(|s| s.rsplit_once(')').map(|(_, r)| !r.trim_start().starts_with('Z')))
        .unwrap_or(false)
}
