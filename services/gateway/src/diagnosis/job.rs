//! One diagnosis at work: the rows to a file, the process, its steps, and what its report says.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Arc;

use kort_proto::signals::SIGNALS;
use kort_recording::LiveMcap;
use serde_json::Value;

use super::{Diagnoses, DiagnosisInfo, DiagnosisState, FindingView, LAST_MINUTES, Options, Subject};
use crate::rig::differ;
use crate::ring::Row;
use crate::thruster::lock;

/// Before each step that `kort diagnose --job` tells.
const STEP: &str = "step: ";
/// Exit code: done, but rows were lost or left out.
const LOSSY: i32 = 3;

/// A diagnosis about to be made.
pub struct Job {
    /// Its folder.
    pub folder: PathBuf,
    /// Recordings that come before it: all are fitted together.
    pub before: Vec<PathBuf>,
    /// Of what.
    pub subject: Subject,
    /// How.
    pub options: Options,
    /// The rig description to compare with.
    pub rig: Arc<str>,
}

impl Job {
    /// Makes it, on a thread that lives as long as its process does: the process ends with it.
    pub fn run(self, diagnoses: &Diagnoses) {
        match self.make(diagnoses) {
            Ok((status, _)) if matches!(status.code(), Some(0 | LOSSY)) => {
                let lossy = status.code() == Some(LOSSY);
                let report = fs::read(self.folder.join("report.json")).unwrap_or_default();
                match serde_json::from_slice::<Value>(&report) {
                    Ok(report) => {
                        let found = fs::read_to_string(self.folder.join("found.toml")).unwrap_or_default();
                        let usable = differ(&self.rig, &found);
                        diagnoses.end(DiagnosisState::Done, None, |info| {
                            told(info, &report);
                            (info.lossy, info.usable) = (lossy, usable);
                        });
                    }
                    Err(error) => {
                        diagnoses.end(DiagnosisState::Failed, Some(format!("its report: {error}")), |_| ())
                    }
                }
            }
            Ok((status, words)) => {
                let words = if words.is_empty() { format!("its process ended: {status}") } else { words };
                diagnoses.end(DiagnosisState::Failed, Some(words), |_| ());
            }
            Err(error) => diagnoses.end(DiagnosisState::Failed, Some(error.to_string()), |_| ()),
        }
    }

    /// Runs the process; how it ended, and its last words beside its steps.
    fn make(&self, diagnoses: &Diagnoses) -> io::Result<(ExitStatus, String)> {
        let in_folder = |name: &str| self.folder.join(name);
        fs::write(in_folder("rig.toml"), &*self.rig)?;
        let recording = match &self.subject {
            Subject::Recording(_, file) => file.clone(),
            Subject::Last(_, rows) => {
                diagnoses.step("writing the last minutes down");
                let file = in_folder(LAST_MINUTES);
                write_rows(&file, rows, &self.rig)?;
                file
            }
        };
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().div_ceil(2));
        let mut command = Command::new(&diagnoses.program);
        command.arg("diagnose").args(&self.before).arg(recording).arg("--rig").arg(in_folder("rig.toml"));
        command.args(["--json", "--jobs", &threads.to_string(), "--job", &std::process::id().to_string()]);
        command.arg("--html").arg(in_folder("report.html")).arg("-o").arg(in_folder("found.toml"));
        command.args(["--model", &self.options.model]);
        if let Some(seed) = self.options.seed {
            command.args(["--seed", &seed.to_string()]);
        }
        if !self.options.with.is_empty() {
            command.args(["--with", &self.options.with.join(",")]);
        }
        let report = File::create(in_folder("report.json"))?;
        let mut child = command.stdin(Stdio::null()).stdout(report).stderr(Stdio::piped()).spawn()?;
        let talk = child.stderr.take();
        let child = diagnoses.hold(child);
        let mut words = Vec::new();
        for line in talk.into_iter().flat_map(|talk| BufReader::new(talk).lines().map_while(Result::ok)) {
            match line.strip_prefix(STEP) {
                Some(step) => diagnoses.step(step),
                None => words.push(line),
            }
            // Its last words are its error: what it said long before them is no use.
            if words.len() > 8 {
                words.remove(0);
            }
        }
        let status = lock(&child).wait()?;
        let error: Vec<&str> =
            words.iter().map(String::as_str).skip_while(|line| !line.starts_with("error: ")).collect();
        Ok((status, error.join("; ").trim_start_matches("error: ").to_owned()))
    }
}

/// Rows as a recording that says which rig it is of.
fn write_rows(file: &Path, rows: &[Row], rig: &str) -> io::Result<()> {
    let columns: Vec<&str> = SIGNALS.iter().map(|signal| signal.name).collect();
    let about = BTreeMap::from([("rig".to_owned(), rig.to_owned())]);
    let mut output = LiveMcap::live("rows", &columns, about, 0, BufWriter::new(File::create(file)?))?;
    let first_ns = rows.first().map_or(0, |(at, _)| *at);
    for (at, signals) in rows {
        let values: Vec<f64> = SIGNALS.iter().map(|signal| (signal.get)(signals)).collect();
        output.row((at - first_ns) as f64 * 1e-9, &values)?;
    }
    output.finish()
}

/// What the list shows of a report.
fn told(info: &mut DiagnosisInfo, report: &Value) {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    info.verdict = text(&report["verdict"]);
    info.summary = text(&report["summary"]);
    let findings = report["findings"].as_array().into_iter().flatten();
    info.findings = findings
        .map(|finding| FindingView {
            effect: text(&finding["effect"]).unwrap_or_default(),
            path: text(&finding["path"]).unwrap_or_default(),
            probability: finding["probability"].as_f64().unwrap_or(0.0),
            statement: text(&finding["statement"]).unwrap_or_default(),
            excess_error_removed: finding["heldout"]["excess_error_removed"].as_f64(),
        })
        .collect();
}
