//! What an event is of.

use serde::{Deserialize, Serialize};

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// Somebody took command.
    LeaseTaken,
    /// Somebody took command away from its holder.
    LeaseTakenOver,
    /// The holder gave command up.
    LeaseGivenUp,
    /// A lease ran out.
    LeaseExpired,
    /// The drive was armed.
    Armed,
    /// The drive was disarmed on request, or because nobody commands it any more.
    Disarmed,
    /// Every thruster was stopped on request.
    Stopped,
    /// A setpoint was accepted; while it moves, one a second is noted.
    Commanded,
    /// A test signal was begun.
    ExcitationStarted,
    /// A test signal is complete, or was ended.
    ExcitationEnded,
    /// The control law or its parameters were changed.
    ControllerChanged,
    /// Another revision of the rig description is in force.
    RigChanged,
    /// The revision of the rig description before is in force again.
    RigRolledBack,
    /// The thrust error is larger since the revision of the rig description in force than before it.
    RigWorse,
    /// A diagnosis was begun.
    DiagnosisStarted,
    /// A diagnosis is done.
    DiagnosisDone,
    /// A diagnosis came to nothing.
    DiagnosisFailed,
    /// A diagnosis was ended on request.
    DiagnosisCancelled,
    /// A diagnosis was deleted.
    DiagnosisDeleted,
    /// A fit was begun.
    FitStarted,
    /// A fit is done.
    FitDone,
    /// A fit came to nothing.
    FitFailed,
    /// A fit was ended on request.
    FitCancelled,
    /// A fit was deleted.
    FitDeleted,
    /// A calibration was begun.
    CalibrationStarted,
    /// A calibration is over: done, stopped, aborted or failed.
    CalibrationEnded,
    /// Latched faults were cleared.
    FaultsCleared,
    /// A fault was latched: a stop that nobody asked for, if the drive was armed.
    Tripped,
    /// A fault that was latched before the service started is latched still; the log had not told it.
    FaultInherited,
    /// A path of the thruster is off against its rig description, or is well again.
    Mismatch,
    /// A process of the service started.
    ProcessStarted,
    /// A process of the service ended, unasked.
    ProcessEnded,
    /// A process did not beat any more and was ended by the supervisor.
    ProcessHung,
    /// A recording was started.
    RecordingStarted,
    /// A recording was stopped.
    RecordingStopped,
    /// A recording ended by itself: no space, a limit, a disk that refuses.
    RecordingEnded,
    /// A recording was deleted.
    RecordingDeleted,
    /// The service was stopped on request.
    ServiceStopped,
    /// Events before this one could not be written down and are lost.
    EventsLost,
}

impl EventKind {
    /// May it tell of a fault that is latched since?
    pub(super) fn latches(self) -> bool {
        matches!(self, Self::Tripped | Self::FaultInherited | Self::RecordingEnded)
    }
}
