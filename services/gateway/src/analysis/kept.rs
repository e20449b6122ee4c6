//! What is kept of analyses: a folder each, with `info.json`, the rig it was compared with, the report as JSON (a
//! diagnosis's as a page too), the rig with what was found, and the rows of the last minutes where there was no recording.
//!
//! The folders of diagnoses stand in `gateway.diagnoses`, those of fits in `fits` in it: so a deployment that names a
//! folder of its own has both there.

use std::cmp::Ordering;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::SystemTime;

use serde_json::Value;

use super::{Analyses, Analysis, AnalysisKind, JobInfo, JobState};
use crate::problem::{Kind, Problem};
use crate::record::is_name;
use crate::rig::write_whole;

/// How far it is, and what the list shows of it.
const INFO: &str = "info.json";
/// The rig description that it is compared with.
pub const RIG: &str = "rig.toml";
/// The rows of the last minutes.
pub const LAST_MINUTES: &str = "recording.mcap";
/// What the command said, JSON.
pub const REPORT: &str = "report.json";
/// The same as a page, of a diagnosis.
pub const PAGE: &str = "report.html";
/// The rig description with what was found.
pub const FOUND: &str = "found.toml";

/// Which of two began first.
pub fn older<A: Analysis>(a: &A, b: &A) -> Ordering {
    let (a, b) = (a.job(), b.job());
    (&a.started, &a.id).cmp(&(&b.started, &b.id))
}

impl Analyses {
    /// Its report, the document that its command prints with `--json`; null until it is done.
    pub fn report<A: Analysis>(&self, of: &A) -> Value {
        let text = self.text(of, REPORT);
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or(Value::Null)
    }

    /// Its report as a page.
    pub fn page<A: Analysis>(&self, of: &A) -> Result<String, Problem> {
        self.text(of, PAGE).ok_or_else(|| not_done(of))
    }

    /// The rig description with what was found.
    pub fn rig<A: Analysis>(&self, of: &A) -> Result<String, Problem> {
        self.text(of, FOUND).ok_or_else(|| not_done(of))
    }

    /// The same, for whoever has the revision in force that it was compared with.
    pub fn found<A: Analysis>(&self, of: &A, in_force: &str) -> Result<String, Problem> {
        let (text, entry, job) = (self.rig(of)?, A::KIND.entry(), of.job());
        if !job.usable {
            let (why, hint) = entry.nothing;
            return Err(Problem::new(Kind::Refused, format!("{} {} {why}", entry.name, job.id)).hint(hint));
        }
        if job.rig_revision != in_force {
            return Err(Problem::new(
                Kind::Refused,
                format!(
                    "{} {} was compared with revision {} of the rig, and another is in force now",
                    entry.name, job.id, job.rig_number
                ),
            )
            .hint(format!(
                "{} again: what it found may stand in the rig by now, or not belong to it any more",
                entry.command
            )));
        }
        Ok(text)
    }

    /// Makes the folder of those of a kind; what ran when its gateway ended has failed.
    pub(super) fn take_up<A: Analysis>(&self) -> io::Result<()> {
        fs::create_dir_all(self.folder_of(A::KIND))?;
        for one in self.past::<A>() {
            if one.job().state == JobState::Running {
                let cause = Some("the gateway ended while it ran".into());
                let job = JobInfo { state: JobState::Failed, step: None, cause, ..one.job().clone() };
                let _ = self.write(&A::from(job));
            }
        }
        Ok(())
    }

    /// A name that none of this kind has.
    pub(super) fn name_for(&self, kind: AnalysisKind, thruster: &str, now: SystemTime) -> String {
        let stamp = humantime::format_rfc3339_seconds(now).to_string().replace(['-', ':'], "");
        let mut id = format!("{thruster}-{stamp}");
        for again in 2.. {
            if !self.folder_of(kind).join(&id).exists() {
                break;
            }
            id = format!("{thruster}-{stamp}-{again}");
        }
        id
    }

    /// Makes its folder, and notes it down.
    pub(super) fn begin<A: Analysis>(&self, one: &A) -> io::Result<PathBuf> {
        let folder = self.folder_of(A::KIND).join(&one.job().id);
        fs::create_dir_all(&folder)?;
        self.write(one)?;
        Ok(folder)
    }

    /// Deletes the oldest where there are too many.
    pub(super) fn make_room<A: Analysis>(&self) {
        let mut past = self.past::<A>();
        past.sort_by(older);
        let over = (past.len() + 1).saturating_sub(self.limits.kept_max);
        for one in past.into_iter().take(over) {
            let _ = self.delete(A::KIND, &one.job().id);
        }
    }

    pub(super) fn delete(&self, kind: AnalysisKind, id: &str) -> io::Result<()> {
        fs::remove_dir_all(self.folder_of(kind).join(id))
    }

    pub(super) fn folder_of(&self, kind: AnalysisKind) -> PathBuf {
        match kind {
            AnalysisKind::Diagnosis => self.folder.clone(),
            AnalysisKind::Fit => self.folder.join("fits"),
        }
    }

    pub(super) fn past<A: Analysis>(&self) -> Vec<A> {
        let folders = fs::read_dir(self.folder_of(A::KIND)).into_iter().flatten().flatten();
        folders.filter_map(|entry| self.read(entry.file_name().to_str()?)).collect()
    }

    pub(super) fn read<A: Analysis>(&self, id: &str) -> Option<A> {
        let file = is_name(id).then(|| self.folder_of(A::KIND).join(id).join(INFO))?;
        serde_json::from_slice(&fs::read(file).ok()?).ok()
    }

    pub(super) fn write<A: Analysis>(&self, one: &A) -> io::Result<()> {
        let folder = self.folder_of(A::KIND).join(&one.job().id);
        write_whole(&folder, INFO, &serde_json::to_vec_pretty(one)?)
    }

    /// A file of one that is done.
    fn text<A: Analysis>(&self, of: &A, name: &str) -> Option<String> {
        let job = of.job();
        let file = self.folder_of(A::KIND).join(&job.id).join(name);
        (job.state == JobState::Done).then(|| fs::read_to_string(file).ok()).flatten()
    }

    pub(super) fn not_kept(&self, error: &io::Error) -> Problem {
        Problem::new(Kind::StorageFailed, format!("{}: {error}", self.folder.display()))
            .hint("see that the folder of gateway.diagnoses can be written and has space")
    }
}

/// Why one has no report.
pub fn not_done<A: Analysis>(of: &A) -> Problem {
    let (entry, job) = (A::KIND.entry(), of.job());
    let words = match job.state {
        JobState::Running => "still runs",
        JobState::Cancelled => "was cancelled",
        JobState::Failed => "failed",
        JobState::Done => "has lost its files",
    };
    Problem::new(Kind::Refused, format!("{} {} {words}: it has no report", entry.name, job.id))
        .hint(format!("GET …/{}/{} says how far it is, and why it failed", entry.route, job.id))
}
