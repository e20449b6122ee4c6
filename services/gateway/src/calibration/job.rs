//! One calibration at work: its process, what it asks, the lease that it lives under, and how it ended.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader};
use std::path::PathBuf;
use std::process::{ChildStderr, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use kort_proto::messages::ASIDE_NS;
use serde_json::Value;

use super::{CalibrationState, Calibrations};

/// What was measured.
pub(super) const RECORDING: &str = "recording.mcap";
/// Before each stage that `kort calibrate --job` is about to begin.
const ASK: &str = "ask: ";
/// Before each step of the estimation.
const STEP: &str = "step: ";
/// Exit codes: done; done, but rows were lost or left out.
const DONE: [i32; 2] = [0, 3];
/// Lease and process are looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// A process that was told to end is killed after this time; the servo's own time-out takes the torque away then.
const END_WITHIN: Duration = Duration::from_secs(3);
/// The same once it drives no more: what it measured is being written.
const WRITE_WITHIN: Duration = Duration::from_secs(60);

/// A calibration about to be made.
pub struct Job {
    /// Its folder.
    pub folder: PathBuf,
    /// Name of the thruster.
    pub thruster: String,
    /// The rig description to begin from.
    pub rig: Arc<str>,
    /// Share of the largest drive.
    pub share: f64,
    /// The lease it lives under.
    pub lease: String,
}

impl Job {
    /// Makes it, on a thread that lives as long as its process does: the process ends with it.
    pub fn run(self, calibrations: &Arc<Calibrations>) {
        let made = self.make(calibrations);
        // Its controller stands aside for so long after its last word; until then nobody could arm.
        calibrations.lets_go();
        std::thread::sleep(Duration::from_nanos(ASIDE_NS + ASIDE_NS / 5));
        match made {
            Ok((status, _)) if status.code().is_some_and(|code| DONE.contains(&code)) => {
                calibrations.end(CalibrationState::Done, None);
            }
            Ok((status, words)) => {
                let report = fs::read(self.folder.join("report.json")).unwrap_or_default();
                let report: Value = serde_json::from_slice(&report).unwrap_or_default();
                match report["stopped"].as_str() {
                    Some(why) => calibrations.end(CalibrationState::Stopped, Some(why.to_owned())),
                    None => {
                        let ended = || format!("its process ended: {status}");
                        let words = if words.is_empty() { ended() } else { words };
                        calibrations.end(CalibrationState::Failed, Some(words));
                    }
                }
            }
            Err(error) => calibrations.end(CalibrationState::Failed, Some(error.to_string())),
        }
    }

    /// Runs the process; how it ended, and its last words beside what it asked.
    fn make(&self, calibrations: &Arc<Calibrations>) -> io::Result<(ExitStatus, String)> {
        let in_folder = |name: &str| self.folder.join(name);
        fs::write(in_folder("rig.toml"), &*self.rig)?;
        let mut command = Command::new(&calibrations.program);
        command.args(["calibrate", "--job", &std::process::id().to_string(), "--json"]);
        if let Some(file) = &calibrations.config {
            command.arg("--config").arg(file);
        }
        command.arg("--root").arg(&calibrations.root).args(["--thruster", &self.thruster]);
        command.arg("--rig").arg(in_folder("rig.toml")).args(["--share", &self.share.to_string()]);
        command.arg("-o").arg(in_folder("calibrated.toml"));
        command.arg("--recording").arg(in_folder(RECORDING));
        let report = File::create(in_folder("report.json"))?;
        let mut child = command.stdin(Stdio::piped()).stdout(report).stderr(Stdio::piped()).spawn()?;
        let (talk, agree) = (child.stderr.take(), child.stdin.take());
        calibrations.hold(child.id(), agree);
        let theirs = Arc::clone(calibrations);
        let reader = std::thread::Builder::new()
            .name("calibration".into())
            .spawn(move || talk.map(|talk| follow(talk, &theirs)).unwrap_or_default())?;
        let mut told: Option<Instant> = None;
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            calibrations.keep_to_lease(&self.lease);
            if let Some(drives) = calibrations.is_to_end() {
                let within = if drives { END_WITHIN } else { WRITE_WITHIN };
                if told.get_or_insert_with(Instant::now).elapsed() > within {
                    child.kill()?;
                }
            }
            std::thread::sleep(LOOK_EVERY);
        };
        Ok((status, reader.join().unwrap_or_default()))
    }
}

/// Takes what the process says; its last words, which are its error.
fn follow(talk: ChildStderr, calibrations: &Calibrations) -> String {
    let mut words: Vec<String> = Vec::new();
    for line in BufReader::new(talk).lines().map_while(Result::ok) {
        if let Some((stage, asks)) = line.strip_prefix(ASK).and_then(|rest| rest.split_once(": ")) {
            calibrations.asks(stage, asks);
        } else if let Some(step) = line.strip_prefix(STEP) {
            calibrations.estimates(step);
        } else {
            words.push(line);
            if words.len() > 8 {
                words.remove(0);
            }
        }
    }
    let error: Vec<&str> =
        words.iter().map(String::as_str).skip_while(|line| !line.starts_with("error: ")).collect();
    error.join("; ").trim_start_matches("error: ").to_owned()
}
