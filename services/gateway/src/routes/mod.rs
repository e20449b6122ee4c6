//! The routes, a file per resource. Adding one: write `routes/<name>.rs`, register it here.

mod analyses;
mod arming;
mod calibrations;
mod console;
mod controller;
mod controller_file;
mod diagnoses;
mod docs;
mod events;
mod excitation;
mod faults;
mod fits;
mod health;
mod history;
mod lease;
mod metrics;
mod queries;
mod recording_sets;
mod recordings;
mod rig;
mod setpoint;
mod stop;
mod stream;
mod thrusters;

pub use controller::{ControllerRequest, ControllerView, LawParameter};

/// What clients send, for [`crate::bodies`].
pub mod bodies {
    pub use super::analyses::AnalysisRequest;
    pub use super::calibrations::{CalibrationRequest, GoOnRequest};
    pub use super::controller::ControllerRequest;
    pub use super::controller_file::ControllerFile;
    pub use super::excitation::ExcitationRequest;
    pub use super::lease::LeaseRequest;
    pub use super::recording_sets::RecordingSetRequest;
    pub use super::recordings::{RecordingRequest, TagsRequest};
    pub use super::rig::RigRequest;
    pub use super::stream::parse as incoming;
}

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use tower_http::timeout::TimeoutLayer;
use utoipa_axum::router::OpenApiRouter;

use crate::problem::{Kind, Problem};
use crate::{App, BODY_BYTES_MAX, gate, openapi};

/// Everything the gateway answers.
pub fn router(app: Arc<App>) -> Router {
    let (routes, document) = OpenApiRouter::with_openapi(openapi::opening())
        .merge(thrusters::routes())
        .merge(lease::routes())
        .merge(arming::routes())
        .merge(setpoint::routes())
        .merge(excitation::routes())
        .merge(stop::routes())
        .merge(events::routes())
        .merge(controller::routes())
        .merge(controller_file::routes())
        .merge(rig::routes())
        .merge(diagnoses::routes())
        .merge(fits::routes())
        .merge(calibrations::routes())
        .merge(stream::routes())
        .merge(history::routes())
        .merge(recordings::routes())
        .merge(recording_sets::routes())
        .merge(faults::routes())
        .merge(metrics::routes())
        .merge(health::routes())
        .merge(console::routes())
        .merge(docs::routes())
        .split_for_parts();
    app.publish(document);
    routes
        .merge(docs::pages())
        .fallback(unknown_route)
        .layer(DefaultBodyLimit::max(BODY_BYTES_MAX))
        .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, Duration::from_secs(10)))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), queries::known))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), gate::check))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), problems_only))
        .with_state(app)
}

/// Done to its end, whether or not the client waits for it.
async fn whole<T: Send + 'static>(
    change: impl Future<Output = Result<T, Problem>> + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::spawn(change).await;
    done.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?
}

async fn unknown_route(request: Request) -> Problem {
    Problem::new(Kind::UnknownRoute, format!("there is no route {}", request.uri().path()))
        .hint("GET /openapi.json lists every route; /docs shows them")
}

/// Errors that axum or a layer answers by itself (405, time-out, a missing page of the docs) become
/// problem documents too; their headers, `Allow` above all, stay.
async fn problems_only(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let (began, route) = (Instant::now(), app.pattern(&path));
    let response = next.run(request).await;
    let status = response.status();
    app.count_answer(status.as_u16());
    app.durations().count(route, began.elapsed());
    if !(status.is_client_error() || status.is_server_error())
        || response.headers().get(header::CONTENT_TYPE).is_some_and(|kind| kind == "application/problem+json")
    {
        return response;
    }
    let allow = response.headers().get(header::ALLOW).cloned();
    let problem = match status {
        StatusCode::METHOD_NOT_ALLOWED => {
            Problem::new(Kind::MethodNotAllowed, format!("{path} does not take {method}"))
                .hint("the header Allow lists the methods it takes")
        }
        StatusCode::REQUEST_TIMEOUT => {
            Problem::new(Kind::RequestTimeout, format!("{method} {path} took over 10 s"))
        }
        StatusCode::NOT_FOUND => Problem::new(Kind::UnknownRoute, format!("there is nothing at {path}")),
        StatusCode::PAYLOAD_TOO_LARGE => {
            Problem::new(Kind::BodyTooLarge, format!("the body is larger than {BODY_BYTES_MAX} bytes"))
        }
        status if status.is_client_error() => {
            Problem::new(Kind::MalformedBody, format!("{method} {path} was refused with {status}"))
        }
        _ => Problem::new(Kind::Internal, format!("{method} {path} ended with {status}")),
    };
    let mut answer = problem.into_response();
    if let Some(allow) = allow {
        answer.headers_mut().insert(header::ALLOW, allow);
    }
    answer
}
