//! The last minutes of a thruster, as columns: what a plot begins with.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::State;
use kort_proto::signals::SIGNALS;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::estimates::Estimates;
use crate::extract::{Path, Query};
use crate::problem::{Kind, Problem};
use crate::thin::Due;

const LAST_MAX_S: f64 = 3600.0;
const HZ_MAX: f64 = 100.0;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(history))
}

/// How much.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct HowMuch {
    /// The last so many seconds, as far as they are kept (`gateway.diagnosis.ring_time_s`).
    #[serde(default = "last_default")]
    #[param(minimum = 1, maximum = 3600, default = 120, example = 120)]
    last_s: f64,
    /// Rows a second at most; what lies between two of them is left out.
    #[serde(default = "hz_default")]
    #[param(minimum = 0.1, maximum = 100, default = 25, example = 25)]
    hz: f64,
}

fn last_default() -> f64 {
    120.0
}

fn hz_default() -> f64 {
    25.0
}

/// Rows of the last minutes, by column.
#[derive(Serialize, ToSchema)]
struct History {
    /// The servo's monotonic time of each row, s, as in the state.
    time_s: Vec<f64>,
    /// Commands and measured signals by name, a value a row; null where it was not sampled.
    columns: BTreeMap<&'static str, Vec<Option<f64>>>,
    /// What observer, estimator and the monitor of mismatch said meanwhile, ten times a second at most.
    estimates: Estimates,
}

/// Commands, measured signals and estimates of the last minutes. What was never sampled has no column.
#[utoipa::path(get, path = "/v1/thrusters/{id}/history", tag = "thrusters",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), HowMuch),
    responses(
        (status = 200, description = "What is kept of it", body = History),
        (status = 400, description = "`malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`out-of-range`", body = Problem, content_type = "application/problem+json")))]
async fn history(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Query(HowMuch { last_s, hz }): Query<HowMuch>,
) -> Result<axum::Json<History>, Problem> {
    let ring = app.ring(&id)?.clone();
    for (name, value, least, most) in [("last_s", last_s, 1.0, LAST_MAX_S), ("hz", hz, 0.1, HZ_MAX)] {
        if !(least..=most).contains(&value) {
            let words = format!("{name} = {value} is outside {least} to {most}");
            return Err(Problem::new(Kind::OutOfRange, words).hint("leave it out for the usual value"));
        }
    }
    let (mut rows, estimates) = (ring.last(last_s).await, ring.estimates(last_s, hz).await);
    let mut due = Due::new(hz);
    rows.retain(|(at_ns, _)| due.is(*at_ns));
    let column = |get: fn(&kort_proto::signals::Signals) -> f64| -> Vec<Option<f64>> {
        rows.iter().map(|(_, signals)| Some(get(signals)).filter(|value| value.is_finite())).collect()
    };
    let columns = SIGNALS.iter().map(|signal| (signal.name, column(signal.get)));
    Ok(axum::Json(History {
        time_s: rows.iter().map(|(at_ns, _)| *at_ns as f64 * 1e-9).collect(),
        columns: columns.filter(|(_, values)| values.iter().any(Option::is_some)).collect(),
        estimates,
    }))
}
