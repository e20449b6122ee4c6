//! Where a controller for another revision of the rig is designed: on a thread of its own beside the tick, which hands
//! over the order and takes the work without waiting, and hands back what it no longer needs to be freed.

use std::io;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use kort_proto::messages::{Outcome, Process, Reply, Request};
use kort_proto::revision;
use kort_proto::transport::{Deployment, ordinary};
use kort_thruster::rig::Rig;

use crate::tick::{Revision, Tick};

/// Orders, and revisions to be freed, that may wait.
const JOBS: usize = 4;

/// What the workshop is given.
#[expect(clippy::large_enum_variant, reason = "the tick must not allocate: an order travels by value")]
enum Job {
    Design(Request),
    Free(Box<Revision>),
}

/// An order that is done, or why it cannot be.
struct Done {
    request: Request,
    revision: Result<Box<Revision>, String>,
}

/// The tick's side of the workshop.
pub struct Workshop {
    jobs: SyncSender<Job>,
    done: Receiver<Done>,
}

impl Workshop {
    /// Opens the workshop of a thruster; it closes when this is dropped.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(deployment: &Deployment, thruster: &str, period_ns: u64) -> io::Result<Self> {
        let (jobs, orders) = sync_channel(JOBS);
        let (finished, done) = sync_channel(JOBS);
        let (deployment, thruster) = (deployment.clone(), thruster.to_owned());
        std::thread::Builder::new().name("workshop".into()).spawn(move || {
            ordinary();
            while let Ok(job) = orders.recv() {
                let request = match job {
                    Job::Free(revision) => {
                        drop(revision);
                        continue;
                    }
                    Job::Design(request) => request,
                };
                let revision = design(&deployment, &thruster, period_ns, request.rig_revision);
                if finished.send(Done { request, revision }).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { jobs, done })
    }

    /// Orders the revision that a request asks for; an answer only if it cannot even be ordered.
    pub fn order(&self, request: Request) -> Option<Reply> {
        self.jobs.try_send(Job::Design(request)).err().map(|_| {
            Reply::to(
                &request,
                Process::Controller,
                Outcome::Refused,
                format_args!("another revision of the rig is being taken over; hint: try again"),
            )
        })
    }

    /// Fits the next revision that is ready into the tick; the answer to who asked for it.
    pub fn fit(&self, tick: &mut Tick) -> Option<Reply> {
        let Done { request, revision } = self.done.try_recv().ok()?;
        let answer = |outcome, words: std::fmt::Arguments| {
            Some(Reply::to(&request, Process::Controller, outcome, words))
        };
        match revision {
            // The words are freed here: a few bytes, and only where nothing is taken over.
            Err(words) => answer(Outcome::Invalid, format_args!("{words}")),
            Ok(mut revision) => {
                let taken = tick.adopt(&mut revision);
                // A workshop whose queue is full leaves it to be freed here.
                let _ = self.jobs.try_send(Job::Free(revision));
                match taken {
                    Ok(()) => answer(Outcome::Done, format_args!("the rig's revision is taken over")),
                    Err(kind) => answer(
                        Outcome::Refused,
                        format_args!(
                            "amplifier.kind is another than the drive's, which takes {}; hint: a drive of another kind needs a restart",
                            kind.name()
                        ),
                    ),
                }
            }
        }
    }
}

/// Reads and designs; words for the operator where that cannot be.
fn design(
    deployment: &Deployment,
    thruster: &str,
    period_ns: u64,
    wanted: u64,
) -> Result<Box<Revision>, String> {
    let in_a_line = |words: String| words.replace('\n', "; ");
    let text = deployment.take_rig(thruster).map_err(|error| in_a_line(error.to_string()))?;
    if revision::of(&text) != wanted {
        return Err("the rig description changed while it was read; hint: try again".into());
    }
    let rig = Rig::from_toml(&text).map_err(|error| in_a_line(error.to_string()))?;
    let revision = Revision::new(&rig, period_ns, wanted).map_err(|error| in_a_line(error.to_string()))?;
    Ok(Box::new(revision))
}
