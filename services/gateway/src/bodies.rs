//! Every document that a client may send, read as its route reads it, and nothing done: for tests with any bytes.

use crate::extract::{Json, OptionalJson};
use crate::problem::Problem;
use crate::routes::bodies::{
    AnalysisRequest, CalibrationRequest, ControllerFile, ControllerRequest, ExcitationRequest, GoOnRequest,
    LeaseRequest, RecordingRequest, RecordingSetRequest, RigRequest, TagsRequest, incoming,
};
use crate::view::Setpoint;

/// What a client sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// `PUT …/setpoint`
    Setpoint,
    /// `POST …/lease`
    Lease,
    /// `PUT …/controller`
    Controller,
    /// `PUT …/controller/file`
    ControllerFile,
    /// `POST …/excitation`
    Excitation,
    /// `POST …/rig`
    Rig,
    /// `POST …/diagnoses`, `POST …/fits`
    Analysis,
    /// `POST …/calibrations`
    Calibration,
    /// `POST …/calibrations/{calibration}/go-on`
    GoOn,
    /// `POST /v1/recordings`
    Recording,
    /// `POST /v1/recording-sets`
    RecordingSet,
    /// `PATCH /v1/recordings/{name}`
    Tags,
    /// A text message of the stream.
    Message,
}

impl Body {
    /// Every kind.
    pub const ALL: [Body; 13] = [
        Body::Setpoint,
        Body::Lease,
        Body::Controller,
        Body::ControllerFile,
        Body::Excitation,
        Body::Rig,
        Body::Analysis,
        Body::Calibration,
        Body::GoOn,
        Body::Recording,
        Body::RecordingSet,
        Body::Tags,
        Body::Message,
    ];

    /// Reads the bytes.
    ///
    /// # Errors
    /// The problem document that the client would be answered with, as JSON.
    pub fn read(self, bytes: &[u8]) -> Result<(), serde_json::Value> {
        let read = match self {
            Body::Setpoint => Json::<Setpoint>::from_bytes(bytes).map(drop),
            Body::Lease => Json::<LeaseRequest>::from_bytes(bytes).map(drop),
            Body::Controller => Json::<ControllerRequest>::from_bytes(bytes).map(drop),
            Body::ControllerFile => Json::<ControllerFile>::from_bytes(bytes).map(drop),
            Body::Excitation => Json::<ExcitationRequest>::from_bytes(bytes).map(drop),
            Body::Rig => Json::<RigRequest>::from_bytes(bytes).map(drop),
            Body::Analysis => OptionalJson::<AnalysisRequest>::from_bytes(bytes).map(drop),
            Body::Calibration => OptionalJson::<CalibrationRequest>::from_bytes(bytes).map(drop),
            Body::GoOn => Json::<GoOnRequest>::from_bytes(bytes).map(drop),
            Body::Recording => OptionalJson::<RecordingRequest>::from_bytes(bytes).map(drop),
            Body::RecordingSet => OptionalJson::<RecordingSetRequest>::from_bytes(bytes).map(drop),
            Body::Tags => Json::<TagsRequest>::from_bytes(bytes).map(drop),
            // A message that is not UTF-8 is no message of the stream: the connection is closed before.
            Body::Message => std::str::from_utf8(bytes).map_or(Ok(()), |text| incoming(text).map(drop)),
        };
        read.map_err(|problem: Problem| serde_json::to_value(&problem).unwrap_or_default())
    }
}
