//! What observer, estimator and the monitor of mismatch said while a recording was made: what its CSV has no columns for.

use std::sync::Arc;

use axum::extract::State;
use serde::Deserialize;
use utoipa::IntoParams;

use super::text::{nothing_yet, turn};
use super::{absent, blocking};
use crate::App;
use crate::estimates::Estimates;
use crate::extract::{Path, Query};
use crate::problem::{Kind, Problem};

/// Recordings hold a state ten times a second.
const HZ: std::ops::RangeInclusive<f64> = 0.01..=10.0;

/// How much.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct HowOften {
    /// Instants a second at most.
    #[serde(default = "hz_default")]
    #[param(minimum = 0.01, maximum = 10, default = 10, example = 10)]
    hz: f64,
}

fn hz_default() -> f64 {
    *HZ.end()
}

/// Estimates of a recording, on the time of its rows; a running one is read as far as it is written.
#[utoipa::path(get, path = "/v1/recordings/{name}/estimates", tag = "recordings",
    params(("name" = String, Path, description = "Name of the recording", example = "t1-20260101T120000Z"), HowOften),
    responses(
        (status = 200, description = "What it holds of them", body = Estimates),
        (status = 400, description = "`malformed-path`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-recording`: there is none of this name, its file is gone, or nothing of it can be read yet", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`overloaded`: one is made of a recording at a time", body = Problem, content_type = "application/problem+json")))]
pub(super) async fn estimates(
    State(app): State<Arc<App>>,
    Path(name): Path<String>,
    Query(HowOften { hz }): Query<HowOften>,
) -> Result<axum::Json<Estimates>, Problem> {
    if !HZ.contains(&hz) {
        let words = format!("hz = {hz} is outside {} to {}", HZ.start(), HZ.end());
        return Err(Problem::new(Kind::OutOfRange, words).hint("leave it out for all there are"));
    }
    let Some(path) = app.recorder().find(&name) else { return Err(absent(&app, &name).await) };
    let turn = turn().await?;
    let made = blocking(move || {
        let made = Estimates::of_recording(&path, hz).map_err(nothing_yet);
        drop(turn);
        made
    });
    made.await?.map(axum::Json)
}
