//! The page of a fault: cause, what kort did, what to do.

use std::sync::Arc;

use axum::http::{HeaderMap, header};
use axum::response::{Html, IntoResponse, Response};
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

/// What a fault means and what to do: Markdown, or a page for whoever asks for HTML.
#[utoipa::path(get, path = "/v1/faults/{code}", tag = "thrusters",
    params(("code" = u32, Path, description = "Stable code of the fault", example = 4)),
    responses(
        (status = 200, description = "The page, in Markdown; as `text/html` where the request accepts that", body = String, content_type = "text/plain"),
        (status = 400, description = "`malformed-path`: not a number", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-fault`", body = Problem, content_type = "application/problem+json")))]
async fn page(Path(code): Path<u32>, headers: HeaderMap) -> Result<Response, Problem> {
    let fault = Fault::ALL.into_iter().find(|fault| fault.code() == code).ok_or_else(|| {
        Problem::new(Kind::UnknownFault, format!("no fault has code {code}"))
            .allowed(Fault::ALL.map(|fault| format!("{} {}", fault.code(), fault.name())))
    })?;
    let text = Pages::get(&format!("{}.md", fault.name()))
        .map_or_else(|| fault.help().as_bytes().to_vec(), |file| file.data.into_owned());
    let accepts = headers.get(header::ACCEPT).and_then(|accept| accept.to_str().ok());
    if accepts.is_some_and(|accept| accept.contains("text/html")) {
        return Ok(Html(html(fault, &String::from_utf8_lossy(&text))).into_response());
    }
    Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text).into_response())
}

/// The page as a browser shows it, in the reader's own theme.
fn html(fault: Fault, markdown: &str) -> String {
    let mut body = String::new();
    pulldown_cmark::html::push_html(&mut body, pulldown_cmark::Parser::new(markdown));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{}</title><style>:root {{ color-scheme: light dark }} body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 44em; \
         margin: 2em auto; padding: 0 1em }}</style></head><body>\n{body}<p><a href=\"/\">The console</a></p></body></html>\n",
        fault.name()
    )
}
