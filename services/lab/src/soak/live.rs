//! The same script against a running service, in real time, scored with the same code.
//!
//! Lease, arming and choice of controller go through REST; setpoints and states through one
//! WebSocket. What the scenario says of the truth (effects, ambient flow, faults) is the running
//! plant's business and is not imposed. Scores rest on what the service measures.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use kort_control::{ControllerConfig, TUNABLES};
use serde_json::{Value, json};
use thiserror::Error;
use tokio_tungstenite::tungstenite::stream::MaybeTlsStream;
use tokio_tungstenite::tungstenite::{self, Message, WebSocket};

use kort_soak::{LawResult, Outcome, Player, Sample, ScenarioResult, Tally};

use super::{Contestant, Loaded, Report, Watch};

/// States a second, and how often the reference is looked at.
const RATE_HZ: f64 = 50.0;
/// A lease lives that long without a command, ms.
const LEASE_MS: u64 = 5000;

/// Why a live soak ended.
#[derive(Debug, Error)]
pub enum LiveError {
    /// The service said no, or nothing.
    #[error("{what} {url}: {answer}\nhint: {hint}")]
    Request {
        /// Method and meaning.
        what: &'static str,
        /// Address.
        url: String,
        /// What came back.
        answer: String,
        /// What to do.
        hint: &'static str,
    },
    /// The WebSocket.
    #[error("stream {url}: {source}\nhint: is the gateway still running?")]
    Stream {
        /// Address.
        url: String,
        /// What went wrong.
        source: Box<tungstenite::Error>,
    },
    /// The stream is silent.
    #[error("stream {url}: no state for two seconds\nhint: see the log of the service")]
    Silent {
        /// Address.
        url: String,
    },
}

/// Drives the running service through every scenario and controller, one after the other.
///
/// # Errors
/// [`LiveError`] names what was asked of which address and what came back.
pub fn live(
    loaded: &[Loaded],
    url: &str,
    thruster: &str,
    seed: u64,
    watch: &Watch,
) -> Result<Report, LiveError> {
    let started = Instant::now();
    let service = Service::take(url.trim_end_matches('/'), thruster)?;
    let mut scenarios = Vec::new();
    let mut played_s = 0.0;
    let all_s: f64 = loaded.iter().map(|l| l.controllers.len() as f64 * l.scenario.duration_s).sum();
    let bar = crate::progress::bar(all_s as u64, "seconds driven");
    for l in loaded {
        let mut laws = Vec::new();
        let laws_of = |(name, contestant): &'_ (String, Contestant)| match contestant {
            Contestant::Law(config) => Some((name.clone(), **config)),
            // The running service's truth is not known: nothing can be told it.
            Contestant::Limits => None,
        };
        for (name, config) in l.controllers.iter().filter_map(laws_of) {
            let (name, config) = (name.as_str(), &config);
            bar.say(&format!("{}: {name} for {:.0} s", l.scenario.name, l.scenario.duration_s));
            service.switch(config)?;
            let outcome = drive(&service, l, seed, &|share, rms_n, energy_j| {
                bar.set_position((played_s + share * l.scenario.duration_s) as u64);
                if let Some(metrics) = watch.metrics {
                    metrics.progress(name, &l.scenario.name, 0, share, rms_n, energy_j);
                }
            })?;
            played_s += l.scenario.duration_s;
            let law = LawResult::new(name, vec![outcome]);
            if let Some(metrics) = watch.metrics {
                metrics.finished(name, &l.scenario.name, &law);
            }
            laws.push(law);
        }
        scenarios.push(ScenarioResult::new(&l.prepared(), laws));
    }
    drop(bar);
    eprintln!("{played_s:.0} s driven in {:.1} s", started.elapsed().as_secs_f64());
    Ok(Report::new(loaded.iter().map(|l| l.scenario.duration_s).sum(), played_s, scenarios))
}

/// One controller through one scenario.
fn drive(
    service: &Service,
    l: &Loaded,
    seed: u64,
    progress: &dyn Fn(f64, f64, f64),
) -> Result<Outcome, LiveError> {
    let mut player = Player::new(&l.scenario.references, &l.replayed, kort_soak::stream(seed, 1));
    let dt = 1.0 / RATE_HZ;
    let mut tally = Tally::new(dt, &l.rig, l.thrust_max_n, l.scenario.settle_s);
    let mut stream = service.stream()?;
    let (mut first, mut done_s, mut trips, mut was_armed) = (None, 0.0, 0, true);
    let mut reference_n = 0.0;
    let mut sent = (f64::NAN, Instant::now());
    while done_s < l.scenario.duration_s {
        let state = service.next(&mut stream)?;
        let number = |part: &str, name: &str| state[part][name].as_f64();
        let time = state["time_s"].as_f64().unwrap_or(0.0);
        let time_s = time - *first.get_or_insert(time);
        let armed = state["armed"].as_bool().unwrap_or(false);
        if !armed {
            trips += u32::from(was_armed);
            service.arm()?;
        }
        was_armed = armed;
        // A state that came late stands for the ticks it missed.
        while done_s <= time_s && done_s < l.scenario.duration_s {
            reference_n = l.thrust_max_n * player.next(dt);
            let thrust = number("measured", "thrust_n").or(number("estimated", "thrust_n")).unwrap_or(0.0);
            tally.tick(&Sample {
                time_s: done_s,
                reference_n,
                thrust_n: thrust,
                shaft_speed_rad_s: number("measured", "shaft_speed_rad_s").unwrap_or(0.0),
                current_a: number("measured", "current_a").unwrap_or(0.0),
                flow_m_s: number("measured", "flow_m_s").unwrap_or(0.0),
                ambient_m_s: number("measured", "ambient_m_s").unwrap_or(0.0),
                flow_estimate_m_s: number("estimated", "flow_m_s").unwrap_or(0.0),
                saturated: state["limits"].as_array().is_some_and(|l| !l.is_empty()),
                broken: false,
                excused: false,
            });
            done_s += dt;
        }
        if sent.0 != reference_n || sent.1.elapsed() > Duration::from_millis(LEASE_MS / 4) {
            service.command(&mut stream, reference_n)?;
            sent = (reference_n, Instant::now());
        }
        progress(done_s / l.scenario.duration_s, tally.rms_n(), tally.energy_j());
    }
    service.command(&mut stream, 0.0)?;
    let _ = stream.close(None);
    Ok(tally.finish(&[("trips", f64::from(trips))]))
}

type Stream = WebSocket<MaybeTlsStream<TcpStream>>;

/// The running service, with the lease taken and the thruster armed; gives both back when dropped.
struct Service {
    thruster: String,
    lease: String,
    agent: ureq::Agent,
}

impl Service {
    fn take(base: &str, id: &str) -> Result<Self, LiveError> {
        let agent: ureq::Agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(5)))
            .build()
            .into();
        let mut service = Self { thruster: format!("{base}/v1/thrusters/{id}"), lease: String::new(), agent };
        let body = json!({ "holder": "kort soak", "ttl_ms": LEASE_MS });
        let answer =
            service.post("take the lease", "lease", &body, "another holder must give the lease up first")?;
        service.lease = answer["lease_id"].as_str().unwrap_or_default().to_owned();
        service.arm()?;
        Ok(service)
    }

    fn post(
        &self,
        what: &'static str,
        path: &str,
        body: &Value,
        hint: &'static str,
    ) -> Result<Value, LiveError> {
        let url = format!("{}/{path}", self.thruster);
        let answer = self.agent.post(&url).header("Lease-Id", &self.lease).send_json(body);
        Self::read(what, url, answer, hint)
    }

    fn read(
        what: &'static str,
        url: String,
        answer: Result<ureq::http::Response<ureq::Body>, ureq::Error>,
        hint: &'static str,
    ) -> Result<Value, LiveError> {
        match answer {
            Err(e) => Err(LiveError::Request {
                what,
                url,
                answer: e.to_string(),
                hint: "is the service running there? `kort up` prints its address",
            }),
            Ok(mut response) => {
                let text = response.body_mut().read_to_string().unwrap_or_default();
                if response.status().is_success() {
                    Ok(serde_json::from_str(&text).unwrap_or(Value::Null))
                } else {
                    Err(LiveError::Request {
                        what,
                        url,
                        answer: format!("{} {text}", response.status()),
                        hint,
                    })
                }
            }
        }
    }

    /// Clears faults, arms.
    fn arm(&self) -> Result<(), LiveError> {
        let hint = "see the faults in the thruster's state";
        self.post("clear the faults", "clear-faults", &json!({}), hint)?;
        self.post("arm", "arm", &json!({}), hint)?;
        Ok(())
    }

    fn switch(&self, config: &ControllerConfig) -> Result<(), LiveError> {
        let parameters: serde_json::Map<String, Value> = TUNABLES
            .iter()
            .filter(|t| t.applies(config))
            .map(|t| (t.name.into(), json!((t.get)(config))))
            .collect();
        let body = json!({
            "controller": config.law.name(),
            "observer": config.observer.name(),
            "estimator": config.estimator.name(),
            "parameters": parameters,
        });
        let url = format!("{}/controller", self.thruster);
        let answer = self.agent.put(&url).header("Lease-Id", &self.lease).send_json(&body);
        Self::read("switch the controller", url, answer, "GET the same address for what is available")
            .map(|_| ())
    }

    fn stream(&self) -> Result<Stream, LiveError> {
        let url = format!("{}/stream?hz={RATE_HZ}", self.thruster.replacen("http", "ws", 1));
        let (stream, _) = tungstenite::connect(&url).map_err(|e| self.broken(e))?;
        if let MaybeTlsStream::Plain(tcp) = stream.get_ref() {
            tcp.set_read_timeout(Some(Duration::from_secs(2))).map_err(|e| self.broken(e.into()))?;
        }
        Ok(stream)
    }

    fn broken(&self, source: tungstenite::Error) -> LiveError {
        LiveError::Stream { url: self.thruster.clone(), source: Box::new(source) }
    }

    /// The next state; a problem document that answers a setpoint is an error.
    fn next(&self, stream: &mut Stream) -> Result<Value, LiveError> {
        loop {
            match stream.read() {
                Ok(Message::Text(text)) => {
                    let value: Value = serde_json::from_str(&text).unwrap_or(Value::Null);
                    if value.get("armed").is_some() {
                        return Ok(value);
                    }
                    // Not armed yet, or just tripped: the next state says so and it is armed again.
                    let passing = value["status"].as_u64() == Some(409);
                    if !passing {
                        let hint = "see the problem document";
                        return Err(LiveError::Request {
                            what: "set thrust",
                            url: self.thruster.clone(),
                            answer: value.to_string(),
                            hint,
                        });
                    }
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(e))
                    if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
                {
                    return Err(LiveError::Silent { url: self.thruster.clone() });
                }
                Err(e) => return Err(self.broken(e)),
            }
        }
    }

    fn command(&self, stream: &mut Stream, thrust_n: f64) -> Result<(), LiveError> {
        let body = json!({ "setpoint": { "thrust_n": thrust_n }, "lease_id": self.lease });
        stream.send(Message::text(body.to_string())).map_err(|e| self.broken(e))
    }
}

impl Drop for Service {
    /// Zero, disarmed, lease given up; what fails now is overtaken by the lease's end.
    fn drop(&mut self) {
        // Anyone may disarm: without the lease the thruster is in other hands, and is let be.
        if self.lease.is_empty() {
            return;
        }
        let _ = self.post("disarm", "disarm", &json!({}), "");
        let _ = self.agent.delete(format!("{}/lease", self.thruster)).header("Lease-Id", &self.lease).call();
    }
}
