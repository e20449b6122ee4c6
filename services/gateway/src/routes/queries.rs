//! What a request that changes something may ask for in its query: what its route declares. Anything else, a misspelt
//! `dry_run` above all, would be passed over and the change made. A stop is never refused.

use std::sync::Arc;

use axum::extract::{Query, Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::app::App;
use crate::gate::stops;
use crate::problem::{Kind, Problem};

/// Refuses a change with a wish that its route does not know.
pub(super) async fn known(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    match unknown(&app, &request) {
        Some(problem) => problem.into_response(),
        None => next.run(request).await,
    }
}

fn unknown(app: &App, request: &Request) -> Option<Problem> {
    let (method, uri) = (request.method(), request.uri());
    let reads = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
    if reads || uri.query().is_none() || stops(uri.path()) {
        return None;
    }
    // What cannot be read as a query is the route's to refuse.
    let Query(asked) = Query::<Vec<(String, String)>>::try_from_uri(uri).ok()?;
    let allowed = app.query_names(uri.path(), method)?;
    let (name, _) = asked.into_iter().find(|(name, _)| !allowed.contains(&name.as_str()))?;
    let known = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
    let words = format!("{method} {} knows no query `{name}`; allowed: {known}", uri.path());
    Some(
        Problem::new(Kind::MalformedQuery, words)
            .hint("nothing was changed; GET /openapi.json lists what each route takes"),
    )
}
