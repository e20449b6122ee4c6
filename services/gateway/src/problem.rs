//! Errors as RFC 9457 problem documents: one table of kinds, each with a `type` that never changes.

use axum::Json;
use axum::extract::rejection::{BytesRejection, JsonRejection, PathRejection, QueryRejection};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use kort_proto::complaint::Complaint;
use serde::Serialize;
use utoipa::ToSchema;

/// Every way a request can fail. The `type` of each is part of the interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    MalformedJson,
    MalformedPath,
    MalformedQuery,
    MalformedHeader,
    MalformedBody,
    TokenRequired,
    LeaseRequired,
    RoleTooLow,
    ForeignOrigin,
    ForeignHost,
    UnknownRoute,
    UnknownThruster,
    UnknownRecording,
    UnknownRevision,
    UnknownDiagnosis,
    UnknownFit,
    UnknownCalibration,
    UnknownFault,
    MethodNotAllowed,
    RequestTimeout,
    LeaseHeld,
    LeaseLost,
    NotArmed,
    FaultLatched,
    Refused,
    NoRecording,
    RecordingActive,
    DiagnosisActive,
    FitActive,
    CalibrationActive,
    ExcitationActive,
    NoExcitation,
    BodyTooLarge,
    UnsupportedMediaType,
    InvalidField,
    InvalidRig,
    OutOfRange,
    UnknownController,
    UpgradeRequired,
    Internal,
    RecordingFailed,
    StorageFailed,
    NotReady,
    Overloaded,
}

impl Kind {
    /// All kinds, for the documentation and the tests.
    pub const ALL: [Kind; 44] = [
        Kind::MalformedJson,
        Kind::MalformedPath,
        Kind::MalformedQuery,
        Kind::MalformedHeader,
        Kind::MalformedBody,
        Kind::TokenRequired,
        Kind::LeaseRequired,
        Kind::RoleTooLow,
        Kind::ForeignOrigin,
        Kind::ForeignHost,
        Kind::UnknownRoute,
        Kind::UnknownThruster,
        Kind::UnknownRecording,
        Kind::UnknownRevision,
        Kind::UnknownDiagnosis,
        Kind::UnknownFit,
        Kind::UnknownCalibration,
        Kind::UnknownFault,
        Kind::MethodNotAllowed,
        Kind::RequestTimeout,
        Kind::LeaseHeld,
        Kind::LeaseLost,
        Kind::NotArmed,
        Kind::FaultLatched,
        Kind::Refused,
        Kind::NoRecording,
        Kind::RecordingActive,
        Kind::DiagnosisActive,
        Kind::FitActive,
        Kind::CalibrationActive,
        Kind::ExcitationActive,
        Kind::NoExcitation,
        Kind::BodyTooLarge,
        Kind::UnsupportedMediaType,
        Kind::InvalidField,
        Kind::InvalidRig,
        Kind::OutOfRange,
        Kind::UnknownController,
        Kind::UpgradeRequired,
        Kind::Internal,
        Kind::RecordingFailed,
        Kind::StorageFailed,
        Kind::NotReady,
        Kind::Overloaded,
    ];

    /// Status code, last part of the `type`, and title.
    pub fn entry(self) -> (StatusCode, &'static str, &'static str) {
        use StatusCode as S;
        match self {
            Kind::MalformedJson => (S::BAD_REQUEST, "malformed-json", "The body is not valid JSON"),
            Kind::MalformedPath => (S::BAD_REQUEST, "malformed-path", "The path cannot be read"),
            Kind::MalformedQuery => (S::BAD_REQUEST, "malformed-query", "The query cannot be read"),
            Kind::MalformedHeader => (S::BAD_REQUEST, "malformed-header", "A header cannot be read"),
            Kind::MalformedBody => (S::BAD_REQUEST, "malformed-body", "The body cannot be read"),
            Kind::TokenRequired => (S::UNAUTHORIZED, "token-required", "This needs a token"),
            Kind::RoleTooLow => (S::FORBIDDEN, "role-too-low", "The token's role does not allow this"),
            Kind::ForeignHost => {
                (S::MISDIRECTED_REQUEST, "foreign-host", "This gateway is not known by that name")
            }
            Kind::Overloaded => (S::SERVICE_UNAVAILABLE, "overloaded", "No more of this at once"),
            Kind::LeaseRequired => (S::FORBIDDEN, "lease-required", "This needs the lease"),
            Kind::ForeignOrigin => (S::FORBIDDEN, "foreign-origin", "A page of another site may not command"),
            Kind::UnknownRoute => (S::NOT_FOUND, "unknown-route", "No such route"),
            Kind::UnknownThruster => (S::NOT_FOUND, "unknown-thruster", "No such thruster"),
            Kind::UnknownRecording => (S::NOT_FOUND, "unknown-recording", "No such recording"),
            Kind::UnknownRevision => (S::NOT_FOUND, "unknown-revision", "No such revision of the rig"),
            Kind::UnknownDiagnosis => (S::NOT_FOUND, "unknown-diagnosis", "No such diagnosis"),
            Kind::UnknownFit => (S::NOT_FOUND, "unknown-fit", "No such fit"),
            Kind::UnknownCalibration => (S::NOT_FOUND, "unknown-calibration", "No such calibration"),
            Kind::UnknownFault => (S::NOT_FOUND, "unknown-fault", "No such fault code"),
            Kind::MethodNotAllowed => {
                (S::METHOD_NOT_ALLOWED, "method-not-allowed", "This route has no such method")
            }
            Kind::RequestTimeout => {
                (S::REQUEST_TIMEOUT, "request-timeout", "The request took too long to arrive")
            }
            Kind::LeaseHeld => (S::CONFLICT, "lease-held", "Another holder has the lease"),
            Kind::LeaseLost => (S::CONFLICT, "lease-lost", "This lease is not in force"),
            Kind::NotArmed => (S::CONFLICT, "not-armed", "The thruster is not armed"),
            Kind::FaultLatched => (S::CONFLICT, "fault-latched", "A fault is latched"),
            Kind::Refused => (S::CONFLICT, "refused", "The thruster's present state forbids this"),
            Kind::NoRecording => (S::CONFLICT, "no-recording", "No recording is running"),
            Kind::RecordingActive => {
                (S::CONFLICT, "recording-active", "A recording is running or has this name")
            }
            Kind::DiagnosisActive => (S::CONFLICT, "diagnosis-active", "A diagnosis is running"),
            Kind::FitActive => (S::CONFLICT, "fit-active", "A fit is running"),
            Kind::CalibrationActive => (S::CONFLICT, "calibration-active", "A calibration is running"),
            Kind::ExcitationActive => (S::CONFLICT, "excitation-active", "A test signal is playing"),
            Kind::NoExcitation => (S::CONFLICT, "no-excitation", "No test signal is playing"),
            Kind::BodyTooLarge => (S::PAYLOAD_TOO_LARGE, "body-too-large", "The body is too large"),
            Kind::UnsupportedMediaType => {
                (S::UNSUPPORTED_MEDIA_TYPE, "unsupported-media-type", "The body must be application/json")
            }
            Kind::InvalidField => {
                (S::UNPROCESSABLE_ENTITY, "invalid-field", "A field is missing, unknown or of the wrong type")
            }
            Kind::InvalidRig => {
                (S::UNPROCESSABLE_ENTITY, "invalid-rig", "The rig description cannot be used")
            }
            Kind::OutOfRange => {
                (S::UNPROCESSABLE_ENTITY, "out-of-range", "A value is outside its allowed range")
            }
            Kind::UnknownController => (S::UNPROCESSABLE_ENTITY, "unknown-controller", "No such control law"),
            Kind::UpgradeRequired => {
                (S::UPGRADE_REQUIRED, "upgrade-required", "This route speaks WebSocket only")
            }
            Kind::Internal => (S::INTERNAL_SERVER_ERROR, "internal", "The gateway failed"),
            Kind::RecordingFailed => {
                (S::INSUFFICIENT_STORAGE, "recording-failed", "The recording cannot be written")
            }
            Kind::StorageFailed => {
                (S::INSUFFICIENT_STORAGE, "storage-failed", "The service cannot keep its files")
            }
            Kind::NotReady => (S::SERVICE_UNAVAILABLE, "not-ready", "Servo or controller is away"),
        }
    }
}

/// An RFC 9457 problem document (`application/problem+json`).
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(example = json!({"type": "urn:kort:problem:lease-held", "title": "Another holder has the lease", "status": 409,
    "detail": "thruster t1 is commanded by \"bench\" for another 420 ms", "hint": "wait, or ask the holder to DELETE the lease",
    "holder": "bench"}))]
pub struct Problem {
    /// Stable name of the kind of error: `urn:kort:problem:…`.
    #[serde(rename = "type")]
    #[schema(pattern = "^urn:kort:problem:[a-z-]+$")]
    type_uri: String,
    /// The kind in words, the same for every occurrence.
    title: &'static str,
    /// The HTTP status code.
    #[schema(minimum = 400, maximum = 599)]
    status: u16,
    /// What happened this time: the field, the value found, what is allowed.
    detail: String,
    /// What to do about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    hint: Option<String>,
    /// Who holds the lease, where that is the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    holder: Option<String>,
    /// The values that would be accepted, where they can be listed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    allowed: Vec<String>,
    /// All that is wrong with a file that was handed in, as `kort check` tells it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    problems: Vec<FileProblem>,
}

/// Something that is wrong with a file.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct FileProblem {
    /// The key meant, with its table.
    key: Option<String>,
    /// What stands there.
    found: Option<String>,
    /// What may stand there, where the words set it apart.
    allowed: Option<String>,
    /// What to do.
    hint: Option<String>,
    /// All that is said but the hint.
    message: String,
}

impl From<Complaint> for FileProblem {
    fn from(Complaint { key, found, allowed, hint, message }: Complaint) -> FileProblem {
        FileProblem { key, found, allowed, hint, message }
    }
}

impl Problem {
    /// A problem of this kind; `detail` names the field, the value found and what is allowed.
    pub fn new(kind: Kind, detail: impl Into<String>) -> Problem {
        let (status, slug, title) = kind.entry();
        Problem {
            type_uri: format!("urn:kort:problem:{slug}"),
            title,
            status: status.as_u16(),
            detail: detail.into(),
            hint: None,
            holder: None,
            allowed: Vec::new(),
            problems: Vec::new(),
        }
    }

    /// A problem with a file that was handed in: all that is said of it, one after the other in `detail` too. The way out is
    /// that of the first; `usual` where it has none.
    pub fn of_many(kind: Kind, wrong: &[impl ToString], usual: &str) -> Problem {
        let said: Vec<Complaint> = wrong.iter().map(|words| Complaint::of(&words.to_string())).collect();
        let detail: Vec<&str> = said.iter().map(|complaint| complaint.message.as_str()).collect();
        let hint = said.first().and_then(|first| first.hint.clone()).unwrap_or_else(|| usual.to_owned());
        let problem = Problem::new(kind, detail.join("; "));
        let problem = if hint.is_empty() { problem } else { problem.hint(hint) };
        Problem { problems: said.into_iter().map(FileProblem::from).collect(), ..problem }
    }

    /// Names the field of the request that holds the file.
    pub fn within(mut self, field: &str) -> Problem {
        self.detail = format!("{field}: {}", self.detail);
        self
    }

    /// Adds the way out.
    pub fn hint(mut self, hint: impl Into<String>) -> Problem {
        self.hint = Some(hint.into());
        self
    }

    /// Adds the name of the lease's holder.
    pub fn holder(mut self, holder: impl Into<String>) -> Problem {
        self.holder = Some(holder.into());
        self
    }

    /// Adds the values that would be accepted.
    pub fn allowed(mut self, allowed: impl IntoIterator<Item = impl Into<String>>) -> Problem {
        self.allowed = allowed.into_iter().map(Into::into).collect();
        self
    }

    /// Is it of this kind?
    pub fn is(&self, kind: Kind) -> bool {
        self.type_uri.strip_prefix("urn:kort:problem:") == Some(kind.entry().1)
    }

    /// What happened, without the way out.
    pub fn detail(&self) -> &str {
        &self.detail
    }

    /// The HTTP status code.
    pub fn status(&self) -> StatusCode {
        StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = (self.status(), Json(self)).into_response();
        response
            .headers_mut()
            .insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if response.status() == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}

impl From<JsonRejection> for Problem {
    fn from(rejection: JsonRejection) -> Problem {
        let text = rejection.body_text();
        match rejection {
            JsonRejection::JsonDataError(_) => Problem::new(Kind::InvalidField, strip(&text))
                .hint("GET /openapi.json describes the body; /docs shows it with an example"),
            JsonRejection::JsonSyntaxError(_) => Problem::new(Kind::MalformedJson, strip(&text))
                .hint("JSON knows no NaN, no infinity and no number beyond 1.8e308"),
            JsonRejection::MissingJsonContentType(_) => Problem::new(
                Kind::UnsupportedMediaType,
                "the header Content-Type is missing or names another type",
            )
            .hint("send Content-Type: application/json"),
            JsonRejection::BytesRejection(rejection) => rejection.into(),
            _ => Problem::new(Kind::MalformedBody, text),
        }
    }
}

impl From<BytesRejection> for Problem {
    fn from(rejection: BytesRejection) -> Problem {
        if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE {
            Problem::new(
                Kind::BodyTooLarge,
                format!("the body is larger than {} bytes", crate::BODY_BYTES_MAX),
            )
            .hint("no request of this interface needs that much")
        } else {
            Problem::new(Kind::MalformedBody, rejection.body_text())
        }
    }
}

impl From<PathRejection> for Problem {
    fn from(rejection: PathRejection) -> Problem {
        Problem::new(Kind::MalformedPath, rejection.body_text())
    }
}

impl From<QueryRejection> for Problem {
    fn from(rejection: QueryRejection) -> Problem {
        Problem::new(Kind::MalformedQuery, strip(&rejection.body_text()))
    }
}

/// axum's fixed opening words say nothing that the title has not said.
fn strip(text: &str) -> String {
    text.rsplit_once("the target type: ")
        .or_else(|| text.split_once("as JSON: "))
        .or_else(|| text.split_once("query string: "))
        .map_or(text, |(_, rest)| rest)
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_unique_and_statuses_are_errors() {
        let mut slugs: Vec<_> = Kind::ALL.iter().map(|kind| kind.entry().1).collect();
        slugs.sort_unstable();
        slugs.dedup();
        assert_eq!(slugs.len(), Kind::ALL.len());
        for kind in Kind::ALL {
            let status = kind.entry().0;
            assert!(status.is_client_error() || status.is_server_error(), "{kind:?} has {status}");
        }
    }

    #[test]
    fn a_problem_is_problem_json() {
        let response = Problem::new(Kind::LeaseHeld, "x").holder("bench").into_response();
        assert_eq!(response.status(), StatusCode::CONFLICT);
        assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
    }
}
