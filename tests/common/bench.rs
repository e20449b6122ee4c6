//! The servo alone as a real process, with the test as its controller and its gateway.

use std::process::Child;
use std::time::Duration;

use kort_proto::messages::{Command, Outcome, Process, Reply, Request, RequestKind, Telemetry};
use kort_proto::transport::{ControllerPorts, GatewayPorts, Ticker};

use super::{PATIENCE, Site, wait};

/// A servo process, and the ports of a controller and a gateway in this one.
pub struct Bench {
    pub servo: Child,
    pub site: Site,
    pub controller: ControllerPorts,
    pub gateway: GatewayPorts,
    next_id: u64,
    /// What a controller sends that asks for nothing.
    pub zero: Command,
}

impl Bench {
    pub fn start() -> Self {
        Self::start_at(Site::new())
    }

    pub fn start_at(site: Site) -> Self {
        let servo = site.spawn("servo");
        let deployment = site.deployment();
        deployment.wait_for_generation(PATIENCE).unwrap();
        let controller = wait("ports", || ControllerPorts::open(&deployment, "t1").ok());
        let gateway = wait("ports", || GatewayPorts::open(&deployment, "t1").ok());
        wait("telemetry", || gateway.telemetry.next());
        Self { servo, site, controller, gateway, next_id: 0, zero: Command::default() }
    }

    /// Asks the servo for something while a controller at zero goes on.
    pub fn ask(&mut self, kind: RequestKind) -> (Outcome, String) {
        self.next_id += 1;
        let id = self.next_id;
        self.gateway.request.send(Request { id, kind: kind as u32, ..Request::default() }).unwrap();
        let session = self.gateway.request.session();
        let mine = |r: &Reply| r.id == id && r.to_session == session && r.from == Process::Servo as u32;
        let reply = wait("a reply", || {
            self.controller.command.send(self.zero).unwrap();
            std::iter::from_fn(|| self.gateway.reply.next()).find(mine)
        });
        (Outcome::from_u32(reply.outcome).unwrap(), reply.message.as_str().to_owned())
    }

    pub fn arm(&mut self) {
        // A test that is not scheduled for a while is a controller that fell silent: it is asked again.
        let answer = wait("the servo to have heard a controller", || {
            self.controller.command.send(self.zero).unwrap();
            std::thread::sleep(Duration::from_millis(4));
            let answer = self.ask(RequestKind::Arm);
            (!answer.1.contains("no controller sends")).then_some(answer)
        });
        assert_eq!(answer, (Outcome::Done, "armed".into()));
        while self.gateway.telemetry.next().is_some() {}
    }

    /// Sends commands for some servo ticks and returns all telemetry of that time.
    pub fn send(
        &mut self,
        ticks: usize,
        mut command: impl FnMut(&mut ControllerPorts, usize),
    ) -> Vec<Telemetry> {
        let mut ticker = Ticker::new(2_000_000);
        for i in 0..ticks {
            command(&mut self.controller, i);
            ticker.wait();
        }
        std::thread::sleep(Duration::from_millis(10));
        std::iter::from_fn(|| self.gateway.telemetry.next()).collect()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("--- log of the servo\n{}", self.site.log());
        }
        let _ = self.servo.kill();
        let _ = self.servo.wait();
    }
}

impl Site {
    /// With a real drive's kind, or its emulator's, in the place of the simulated one.
    pub fn with_drive(self, kind: &str, keys: &str) -> Self {
        let text = std::fs::read_to_string(self.config()).unwrap();
        let drive = format!("amplifier = \"{kind}\"\ndrive = {{ {keys} }}");
        std::fs::write(self.config(), text.replacen("amplifier = \"simulated\"", &drive, 1)).unwrap();
        self
    }
}
