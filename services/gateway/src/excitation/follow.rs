//! What comes after a test signal: its recording is stopped, and diagnosed if that was asked for.

use std::sync::Arc;
use std::time::Duration;

use kort_proto::events::EventKind;

use crate::App;
use crate::analysis::{DiagnosisInfo, Options, Subject};
use crate::problem::{Kind, Problem};
use crate::token::Identity;

/// How often it is looked whether it plays on.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// What the thruster does right after the signal belongs to the recording.
const TAIL: Duration = Duration::from_secs(1);

/// What is to be done once it is over.
#[derive(Debug)]
pub struct After {
    /// The thruster.
    pub thruster: String,
    /// Which signal.
    pub number: u64,
    /// Recording to stop.
    pub recording: String,
    /// How to diagnose it, and after which diagnosis; none if that was not asked for.
    pub diagnose: Option<(Options, Option<String>)>,
    /// Who asked for it all.
    pub who: Identity,
}

/// Waits for the end of the signal and does it.
pub async fn follow(app: Arc<App>, after: After) {
    let Ok(thruster) = app.thruster(&after.thruster).cloned() else { return };
    let ended = loop {
        tokio::time::sleep(LOOK_EVERY).await;
        let desk = thruster.desk();
        match desk.excitation().filter(|playing| playing.number == after.number) {
            Some(playing) if playing.ended.is_none() => (),
            other => break other.and_then(|playing| playing.ended.clone()),
        }
    };
    tokio::time::sleep(TAIL).await;
    let worker = Arc::clone(&app);
    let done = tokio::task::spawn_blocking(move || {
        let complete = ended.is_some_and(|ended| ended.why.is_none());
        let outcome = finish(&worker, &after, complete);
        (outcome, after)
    });
    let Ok((outcome, after)) = done.await else { return };
    match outcome {
        Ok(Some(id)) => thruster.desk().diagnosed(after.number, id),
        Ok(None) => (),
        Err(problem) => {
            let words = format!("recording {} is not diagnosed: {}", after.recording, problem.detail());
            app.events().tell(EventKind::DiagnosisFailed, Some(&after.thruster), &after.who.name, words);
        }
    }
}

/// Stops the recording; begins the diagnosis of a signal that is complete.
fn finish(app: &App, after: &After, complete: bool) -> Result<Option<String>, Problem> {
    let recorder = app.recorder();
    if recorder.runs(&after.recording) {
        recorder.stop(&after.recording, &after.who)?;
    }
    let Some((options, first)) = after.diagnose.as_ref().filter(|_| complete) else { return Ok(None) };
    let file = recorder.find(&after.recording).ok_or_else(|| {
        Problem::new(Kind::UnknownRecording, format!("there is no recording {:?}", after.recording))
    })?;
    let subject = Subject::Recording(after.recording.clone(), file);
    let (thruster, rig) = (app.thruster(&after.thruster)?, app.rig(&after.thruster)?);
    let info: DiagnosisInfo =
        app.analyses().start(thruster, rig, &after.who, subject, first.as_deref(), options.clone())?;
    Ok(Some(info.job.id))
}
