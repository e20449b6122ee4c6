//! One analysis at work: the rows to a file, the process, its steps, and what it made.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Arc;

use kort_proto::signals::SIGNALS;
use kort_recording::LiveMcap;
use serde_json::Value;

use super::kept::{FOUND, LAST_MINUTES, REPORT, RIG};
use super::{Analyses, AnalysisKind, Options, Subject};
use crate::rig::differ;
use crate::ring::Row;
use crate::thruster::lock;

/// Before each step that a command with `--job` tells.
const STEP: &str = "step: ";
/// Exit code: done, but rows were lost or left out.
const LOSSY: i32 = 3;

/// An analysis about to be made.
pub struct Job {
    /// Which kind.
    pub kind: AnalysisKind,
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

/// What an analysis made.
pub struct Made {
    /// What it said.
    pub report: Value,
    /// The rig description that it was compared with.
    pub rig: Arc<str>,
    /// Rows were lost in reading, or left out.
    pub lossy: bool,
    /// Does the rig description with what was found differ?
    pub usable: bool,
}

impl Job {
    /// Makes it, on a thread that lives as long as its process does: the process ends with it.
    ///
    /// # Errors
    /// Why there is nothing.
    pub fn run(self, analyses: &Analyses) -> Result<Made, String> {
        let (status, words) = self.make(analyses).map_err(|error| error.to_string())?;
        if !matches!(status.code(), Some(0 | LOSSY)) {
            return Err(if words.is_empty() { format!("its process ended: {status}") } else { words });
        }
        let report = fs::read(self.folder.join(REPORT)).unwrap_or_default();
        let report = serde_json::from_slice(&report).map_err(|error| format!("its report: {error}"))?;
        let found = fs::read_to_string(self.folder.join(FOUND)).unwrap_or_default();
        let (lossy, usable) = (status.code() == Some(LOSSY), differ(&self.rig, &found));
        Ok(Made { report, rig: self.rig, lossy, usable })
    }

    /// Runs the process; how it ended, and its last words beside its steps.
    fn make(&self, analyses: &Analyses) -> io::Result<(ExitStatus, String)> {
        let in_folder = |name: &str| self.folder.join(name);
        fs::write(in_folder(RIG), &*self.rig)?;
        let recording = match &self.subject {
            Subject::Recording(_, file) => file.clone(),
            Subject::Last(_, rows) => {
                analyses.step("writing the last minutes down");
                let file = in_folder(LAST_MINUTES);
                write_rows(&file, rows, &self.rig)?;
                file
            }
        };
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().div_ceil(2));
        let mut command = Command::new(&analyses.program);
        command.arg(self.kind.entry().command).args(&self.before).arg(recording);
        command.arg("--rig").arg(in_folder(RIG)).arg("-o").arg(in_folder(FOUND));
        command.args(["--json", "--jobs", &threads.to_string(), "--job", &std::process::id().to_string()]);
        command.args(self.kind.arguments(&self.folder)).args(["--model", &self.options.model]);
        if let Some(seed) = self.options.seed {
            command.args(["--seed", &seed.to_string()]);
        }
        if !self.options.with.is_empty() {
            command.args(["--with", &self.options.with.join(",")]);
        }
        let report = File::create(in_folder(REPORT))?;
        let mut child = command.stdin(Stdio::null()).stdout(report).stderr(Stdio::piped()).spawn()?;
        let talk = child.stderr.take();
        let child = analyses.hold(child);
        let mut words = Vec::new();
        for line in talk.into_iter().flat_map(|talk| BufReader::new(talk).lines().map_while(Result::ok)) {
            match line.strip_prefix(STEP) {
                Some(step) => analyses.step(step),
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
