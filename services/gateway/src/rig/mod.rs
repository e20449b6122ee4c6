//! The rig description in force, thruster by thruster: put in force while the thruster drives, every revision kept,
//! and the way back.

mod book;
mod difference;
mod trial;

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use kort_control::known::uses;
use kort_control::model::ControlModel;
use kort_proto::events::EventKind;
use kort_proto::messages::{Process, Request, RequestKind};
use kort_proto::revision;
use kort_proto::transport::Deployment;
use kort_thruster::rig::{AmplifierKind, Rig};
use serde::Serialize;
use tokio::sync::Mutex;
use utoipa::ToSchema;

use crate::energy::Motor;
use crate::problem::{Kind, Problem};
use crate::settings::Deployed;
use crate::tally::Tally;
use crate::thruster::Thruster;
use crate::view::SetpointRange;

pub use book::{Book, Entry, Making, Revision, write_whole};
pub use difference::{Change, differ};
pub use trial::{Trial, TrialView};

/// A controller has read, designed and taken over a revision within this time, or is taken to be away.
const TAKEN_WITHIN: Duration = Duration::from_secs(6);
/// How often it is looked for whether the controller runs on the revision in force.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// The rig description of one thruster.
#[derive(Debug)]
pub struct RigDesk {
    thruster: Arc<Thruster>,
    tally: Arc<Tally>,
    deployment: Deployment,
    deployed: Deployed,
    book: Book,
    /// One revision at a time.
    turn: Mutex<()>,
}

/// What putting a revision in force came to.
#[derive(Debug, Serialize, ToSchema)]
pub struct Revised {
    /// Is it in force now? False after a dry run, and where it was in force already.
    pub applied: bool,
    /// The entry in force now.
    pub in_force: Entry,
    /// What differs from what was in force before.
    pub difference: Vec<Change>,
    /// Effects of the text that no control law and no observer uses: thrust is controlled as if they were not there.
    pub unused_effects: Vec<UnusedEffect>,
}

/// An effect that a rig description states and that nothing uses.
#[derive(Debug, Serialize, ToSchema)]
pub struct UnusedEffect {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// Why, and where its doing then goes.
    pub why: &'static str,
}

/// Who wants a revision in force.
#[derive(Clone, Debug)]
pub struct Asker {
    /// Name of the token.
    pub who: String,
    /// The lease shown.
    pub lease: Option<String>,
}

/// A text that can be used.
struct Checked {
    rig: Rig,
    /// How far setpoints may go with it.
    range: SetpointRange,
    /// Control period, s.
    period_s: f64,
}

impl Checked {
    fn unused(&self) -> Vec<UnusedEffect> {
        let left_out = uses::left_out(&self.rig, self.period_s);
        left_out.into_iter().map(|(effect, why)| UnusedEffect { effect, why }).collect()
    }
}

/// How a revision comes into force.
enum How {
    /// As a new entry.
    Made(Making),
    /// By going back to the entry of this number.
    Back(u32),
}

impl RigDesk {
    /// Opens the book of a thruster under `folder`, and follows the revision in force.
    ///
    /// # Errors
    /// The folder cannot be read or written.
    pub fn open(
        folder: &Path,
        thruster: Arc<Thruster>,
        tally: Arc<Tally>,
        deployment: Deployment,
        deployed: Deployed,
    ) -> io::Result<RigDesk> {
        let name = |text: &str| Rig::from_toml(text).map(|rig| rig.name).unwrap_or_default();
        let (_, text) = &deployed.rig;
        let book = Book::open(&folder.join(&deployed.id), text, &name(text))?;
        let desk = RigDesk { thruster, tally, deployment, deployed, book, turn: Mutex::new(()) };
        if let Ok(checked) = desk.check(&desk.book.current().1) {
            desk.follow(&checked);
        }
        Ok(desk)
    }

    /// Every revision, and which is in force.
    pub fn book(&self) -> &Book {
        &self.book
    }

    /// Name of the file or entry, and text of the revision in force: what recordings hold.
    pub fn in_force(&self) -> (String, Arc<str>, Entry) {
        let (entry, text) = self.book.current();
        let file = match entry.source.as_str() {
            "deployment" => self.deployed.rig.0.clone(),
            source => format!("revision {} ({source})", entry.number),
        };
        (file, text, entry)
    }

    /// Puts a text in force: checked, compared, and taken over by the controller without a step of the drive. A dry
    /// run only checks and compares.
    pub async fn revise(
        &self,
        asker: &Asker,
        text: &str,
        making: Making,
        dry_run: bool,
    ) -> Result<Revised, Problem> {
        let _turn = self.turn.lock().await;
        let (before, text_before) = self.book.current();
        let checked = self.check(text)?;
        if dry_run || *text_before == *text {
            if !dry_run {
                let (mut desk, lease, now) = (self.thruster.desk(), asker.lease.as_deref(), Instant::now());
                desk.may(lease, now)?;
                desk.done(lease, now);
            }
            return Ok(compared(before, &text_before, text, &checked));
        }
        self.put_in_force(asker, text, checked, How::Made(making)).await
    }

    /// Goes back to the revision that was in force before this one. A dry run only checks and compares.
    pub async fn roll_back(&self, asker: &Asker, dry_run: bool) -> Result<Revised, Problem> {
        let _turn = self.turn.lock().await;
        let (now, text_now) = self.book.current();
        let back = now.before.and_then(|number| self.book.revision(number)).ok_or_else(|| {
            Problem::new(
                Kind::Refused,
                format!("nothing was in force on {} before revision {}", self.thruster.id, now.number),
            )
            .hint("GET …/rig/revisions lists every revision; POST …/rig puts any of them in force")
        })?;
        let (entry, text) = back;
        let checked = self.check(&text)?;
        if dry_run {
            return Ok(compared(now, &text_now, &text, &checked));
        }
        self.put_in_force(asker, &text, checked, How::Back(entry.number)).await
    }

    /// Takes a checked text over, notes it down, follows it, and tells. What cannot be noted down is taken back.
    async fn put_in_force(
        &self,
        asker: &Asker,
        text: &str,
        checked: Checked,
        how: How,
    ) -> Result<Revised, Problem> {
        self.thruster.desk().may(asker.lease.as_deref(), Instant::now())?;
        self.thruster.ready()?;
        let (before, text_before) = self.book.current();
        self.book.keep(text).map_err(|error| self.not_kept(&error))?;
        self.take_over(text).await?;
        let back = matches!(how, How::Back(_));
        let noted = match how {
            How::Made(making) => self.book.enter(text, &checked.rig.name, making),
            How::Back(number) => self.book.turn_to(number),
        };
        let in_force = match noted {
            Ok(entry) => entry,
            Err(error) => {
                self.take_over(&text_before).await?;
                return Err(self.not_kept(&error));
            }
        };
        self.follow(&checked);
        self.thruster.trial().revised(in_force.number, in_force.before);
        let Entry { number, revision, source, .. } = &in_force;
        let difference = difference::between(&text_before, text);
        let differs = difference::words(&difference);
        let (kind, words) = if back {
            let words =
                format!("went back from revision {} of the rig to {number} ({revision})", before.number);
            (EventKind::RigRolledBack, words)
        } else {
            let words = format!("put revision {number} of the rig in force ({revision}, from {source})");
            (EventKind::RigChanged, words)
        };
        self.thruster.did(&asker.who, asker.lease.as_deref(), kind, &format!("{words}: {differs}"));
        // The book has it: whatever ends the service now, the log has it too.
        self.thruster.written().await;
        Ok(Revised { applied: true, in_force, difference, unused_effects: checked.unused() })
    }

    /// What this gateway itself knows of the rig: how far setpoints go, and what its motor takes.
    fn follow(&self, checked: &Checked) {
        self.thruster.set_range(checked.range);
        self.tally.set_motor(Motor::of(&checked.rig));
    }

    /// Sees to it that the controller runs on the revision in force: one that was restarted begins with the
    /// deployment's own.
    pub async fn keep_in_force(self: Arc<Self>) {
        let mut refused = None;
        loop {
            tokio::time::sleep(LOOK_EVERY).await;
            let Ok(_turn) = self.turn.try_lock() else { continue };
            let (entry, text) = self.book.current();
            let wanted = revision::of(&text);
            let running = self.thruster.heard().controller(Instant::now()).map(|state| state.rig_revision);
            if running.is_none_or(|running| running == wanted) || refused == Some(wanted) {
                continue;
            }
            let id = &self.thruster.id;
            match self.take_over(&text).await {
                Ok(()) => {
                    let words = format!(
                        "the controller runs on revision {} of the rig again ({})",
                        entry.number, entry.revision
                    );
                    self.thruster.did("gateway", None, EventKind::RigChanged, &words);
                }
                // A controller that is not there yet is asked again, one that refuses is not.
                Err(problem) if problem.is(Kind::NotReady) => (),
                Err(problem) => {
                    tracing::error!(thruster = id, ?problem, "the rig's revision in force is not taken");
                    refused = Some(wanted);
                }
            }
        }
    }

    /// Checks a text as `kort check` and the controller do.
    fn check(&self, text: &str) -> Result<Checked, Problem> {
        let rig = Rig::from_toml_with_all(text).map_err(|wrong| invalid(&wrong))?;
        let period_s = self.deployed.heartbeat.as_secs_f64();
        let model = ControlModel::from_rig(&rig, period_s).map_err(|error| invalid(&[error]))?;
        let drive = self.deployed.drive;
        if rig.amplifier.kind != drive {
            return Err(Problem::new(
                Kind::Refused,
                format!(
                    "`amplifier.kind` = {:?} is not the kind of the drive that {} runs: {:?}",
                    kind(rig.amplifier.kind),
                    self.thruster.id,
                    kind(drive)
                ),
            )
            .hint("a drive of another kind is deployed with the configuration, and needs a restart"));
        }
        Ok(Checked { range: self.deployed.range_of(&model), rig, period_s })
    }

    /// Hands a text to the controller and waits until it runs on it.
    async fn take_over(&self, text: &str) -> Result<(), Problem> {
        self.deployment.put_rig(&self.thruster.id, text).map_err(|error| {
            Problem::new(Kind::StorageFailed, error.to_string().replace("\nhint:", "; hint:"))
        })?;
        let rig_revision = revision::of(text);
        let request = Request { kind: RequestKind::SetRig as u32, rig_revision, ..Request::default() };
        self.thruster.ask_within(request, &[Process::Controller], Kind::Refused, TAKEN_WITHIN).await?;
        self.thruster
            .settle(|heard, now| {
                heard.controller(now).is_some_and(|state| state.rig_revision == rig_revision)
            })
            .await;
        Ok(())
    }

    fn not_kept(&self, error: &io::Error) -> Problem {
        Problem::new(
            Kind::StorageFailed,
            format!(
                "the rig's revision of {} cannot be kept: {error}; nothing has changed",
                self.thruster.id
            ),
        )
        .hint("see that the folder of gateway.rigs can be written and has space")
    }
}

/// What a text would change, which is not put in force.
fn compared(in_force: Entry, text_in_force: &str, text: &str, checked: &Checked) -> Revised {
    let difference = difference::between(text_in_force, text);
    Revised { applied: false, in_force, difference, unused_effects: checked.unused() }
}

fn kind(kind: AmplifierKind) -> &'static str {
    match kind {
        AmplifierKind::Current => "current",
        AmplifierKind::Voltage => "voltage",
        AmplifierKind::Speed => "speed",
    }
}

/// All that a check says.
fn invalid(wrong: &[impl ToString]) -> Problem {
    Problem::of_many(Kind::InvalidRig, wrong, "")
}
