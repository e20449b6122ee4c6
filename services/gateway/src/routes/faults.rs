//! The page of a fault: cause, what kort did, what to do.

use std::sync::Arc;

use axum::http::header;
use axum::response::IntoResponse;
use kort_proto::faults::Fault;
use rust_embed::Embed;
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::extract::Path;
use crate::problem::{Kind, Problem};

#[derive(Embed)]
#[folder = "../../docs/faults/"]
struct Pages;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(page))
}

/// What a fault means and what to do, as text.
#[utoipa::path(get, path = "/v1/faults/{code}", tag = "thrusters",
    params(("code" = u32, Path, description = "Stable code of the fault", example = 4)),
    responses(
        (status = 200, description = "The page, in Markdown", body = String, content_type = "text/plain"),
        (status = 400, description = "`malformed-path`: not a number", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-fault`", body = Problem, content_type = "application/problem+json")))]
async fn page(Path(code): Path<u32>) -> Result<impl IntoResponse, Problem> {
    let fault = Fault::ALL.into_iter().find(|fault| fault.code() == code).ok_or_else(|| {
        Problem::new(Kind::UnknownFault, format!("no fault has code {code}"))
            .allowed(Fault::ALL.map(|fault| format!("{} {}", fault.code(), fault.name())))
    })?;
    let text = Pages::get(&format!("{}.md", fault.name()))
        .map_or_else(|| fault.help().as_bytes().to_vec(), |file| file.data.into_owned());
    Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text))
}
