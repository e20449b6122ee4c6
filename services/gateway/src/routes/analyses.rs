//! What diagnoses and fits are asked for alike: of a recording or of the last minutes, by which model, with what.

use std::sync::Arc;

use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use serde::Deserialize;
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, Type};

use crate::App;
use crate::analysis::{Analysis, Options, Subject};
use crate::problem::{Kind, Problem};
use crate::record::RecordingState;
use crate::token::Identity;

/// Of the last so many seconds, when the request names neither time nor recording.
const LAST_DEFAULT_S: f64 = 300.0;
const LAST_MAX_S: f64 = 3600.0;
/// Fewer rows cannot be compared with a model at all.
const ROWS_MIN: usize = 100;
/// Effects taken as present at most.
const WITH_MAX: usize = 8;

/// What to diagnose or to fit: a recording, or the last seconds. Every field may be left out, and so may the whole body.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"last_s": 120}))]
pub struct AnalysisRequest {
    /// Name of a recording of this thruster.
    #[serde(default)]
    #[schema(pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    recording: Option<String>,
    /// The last so many seconds, as far as the gateway kept them.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 3600, default = 300)]
    last_s: Option<f64>,
    /// Name of an earlier diagnosis, or for a fit of an earlier fit: its recordings are fitted together with this one.
    #[serde(default)]
    after: Option<String>,
    /// Model to compare with, or to fit; model2 if left out.
    #[serde(default = "model_default")]
    #[schema(schema_with = model_schema)]
    model: String,
    /// Effects taken as present and fitted with the model, by their ids.
    #[serde(default)]
    #[schema(schema_with = with_schema)]
    with: Vec<String>,
    /// Seed of everything drawn at random; 1 if left out.
    #[serde(default)]
    seed: Option<u64>,
}

fn model_default() -> String {
    ModelName::Model2.name().to_owned()
}

fn model_schema() -> RefOr<Schema> {
    ObjectBuilder::new()
        .schema_type(Type::String)
        .enum_values(Some(ModelName::ALL.map(ModelName::name)))
        .into()
}

fn with_schema() -> RefOr<Schema> {
    let ids = effects::ALL.iter().map(|effect| effect.id);
    let effect = ObjectBuilder::new().schema_type(Type::String).enum_values(Some(ids));
    ArrayBuilder::new().items(effect).max_items(Some(WITH_MAX)).into()
}

impl Default for AnalysisRequest {
    fn default() -> AnalysisRequest {
        AnalysisRequest {
            recording: None,
            last_s: None,
            after: None,
            model: model_default(),
            with: Vec::new(),
            seed: None,
        }
    }
}

/// Begins one.
pub async fn start<A: Analysis>(
    app: Arc<App>,
    who: Identity,
    id: String,
    request: Option<AnalysisRequest>,
) -> Result<(StatusCode, axum::Json<A>), Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    let rig = Arc::clone(app.rig(&id)?);
    let request = request.unwrap_or_default();
    let options = options(&request)?;
    let after = request.after;
    let subject = match (request.recording, request.last_s) {
        (Some(_), Some(_)) => {
            return Err(Problem::new(
                Kind::InvalidField,
                "both recording and last_s; allowed is one of them",
            )
            .hint("leave one of them out"));
        }
        (Some(name), None) => {
            let theirs = Arc::clone(&app);
            blocking(move || recording::<A>(&theirs, &id, name)).await?
        }
        (None, last_s) => last(&app, &id, last_s.unwrap_or(LAST_DEFAULT_S)).await?,
    };
    let analyses = Arc::clone(app.analyses());
    let info =
        blocking(move || analyses.start(&thruster, &rig, &who, subject, after.as_deref(), options)).await?;
    Ok((StatusCode::ACCEPTED, axum::Json(info)))
}

/// Those of a thruster.
pub async fn list<A: Analysis>(app: &App, id: String) -> Result<axum::Json<Vec<A>>, Problem> {
    app.thruster(&id)?;
    let analyses = Arc::clone(app.analyses());
    blocking(move || Ok(analyses.list(&id))).await.map(axum::Json)
}

/// One of them, with its report.
pub async fn one<A: Analysis>(app: &App, id: String, name: String) -> Result<(A, Value), Problem> {
    app.thruster(&id)?;
    let analyses = Arc::clone(app.analyses());
    let found = blocking(move || {
        let info = analyses.find::<A>(&id, &name)?;
        let report = analyses.report(&info);
        Ok((info, report))
    });
    found.await
}

/// Cancels or deletes it.
pub async fn remove<A: Analysis>(
    app: &App,
    who: Identity,
    id: String,
    name: String,
) -> Result<Response, Problem> {
    app.thruster(&id)?;
    let analyses = Arc::clone(app.analyses());
    let cancelled: Option<A> = blocking(move || analyses.remove(&id, &name, &who)).await?;
    Ok(match cancelled {
        Some(info) => axum::Json(info).into_response(),
        None => StatusCode::NO_CONTENT.into_response(),
    })
}

fn options(request: &AnalysisRequest) -> Result<Options, Problem> {
    if request.model.parse::<ModelName>().is_err() {
        return Err(Problem::new(Kind::OutOfRange, format!("model = {:?} is no model", request.model))
            .hint("leave it out for model2")
            .allowed(ModelName::ALL.map(ModelName::name)));
    }
    if request.with.len() > WITH_MAX {
        let words = format!("with has {} entries; at most {WITH_MAX} are allowed", request.with.len());
        return Err(Problem::new(Kind::OutOfRange, words));
    }
    if let Some(odd) = request.with.iter().find(|id| effects::find(id).is_none()) {
        return Err(Problem::new(Kind::OutOfRange, format!("with names {odd:?}, which is no effect"))
            .hint("`kort explain` lists the catalogue")
            .allowed(effects::ALL.iter().map(|effect| effect.id)));
    }
    Ok(Options { model: request.model.clone(), with: request.with.clone(), seed: request.seed })
}

/// A recording that is whole, and this thruster's.
fn recording<A: Analysis>(app: &App, thruster: &str, name: String) -> Result<Subject, Problem> {
    let known = app.recorder().list().into_iter().find(|info| info.name == name);
    let file = app.recorder().find(&name);
    let (Some(info), Some(file)) = (known, file) else {
        return Err(Problem::new(Kind::UnknownRecording, format!("there is no recording {name:?}"))
            .hint("GET /v1/recordings lists them; {\"last_s\": 300} takes the last minutes without one"));
    };
    if info.thruster != thruster {
        return Err(Problem::new(
            Kind::Refused,
            format!("recording {name:?} is of thruster {}, not of {thruster}", info.thruster),
        )
        .hint(format!("POST /v1/thrusters/{}/{}", info.thruster, A::KIND.entry().route)));
    }
    if info.state == RecordingState::Recording {
        return Err(Problem::new(Kind::RecordingActive, format!("recording {name:?} still runs"))
            .hint("DELETE /v1/recordings stops it; {\"last_s\": 300} takes the last minutes as they are"));
    }
    Ok(Subject::Recording(name, file))
}

/// The last seconds, as far as they were kept.
async fn last(app: &App, thruster: &str, last_s: f64) -> Result<Subject, Problem> {
    if !(1.0..=LAST_MAX_S).contains(&last_s) {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("last_s = {last_s} is outside 1 to {LAST_MAX_S}"),
        )
        .hint("gateway.diagnosis.ring_time_s says how much is kept"));
    }
    let rows = app.ring(thruster)?.last(last_s).await;
    if rows.len() < ROWS_MIN {
        return Err(Problem::new(
            Kind::NoRecording,
            format!("only {} rows of thruster {thruster} are at hand; {ROWS_MIN} are needed", rows.len()),
        )
        .hint(
            "drive it for a while, with setpoints that move; GET /readyz says whether its servo is heard",
        ));
    }
    let span_s = match (rows.first(), rows.last()) {
        (Some((first, _)), Some((last, _))) => (last - first) as f64 * 1e-9,
        _ => 0.0,
    };
    Ok(Subject::Last(span_s, rows))
}

/// Does what may wait for the disk beside the runtime.
pub async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?
}
