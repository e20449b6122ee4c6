//! The interface's own description: `/openapi.json`, and `/docs` to read and try it.

use std::sync::Arc;

use axum::Router;
use utoipa::openapi::OpenApi;
use utoipa_swagger_ui::{Config, SwaggerUi};

use crate::App;

/// Swagger UI, its files built in: no outside request.
pub fn routes(document: OpenApi) -> Router<Arc<App>> {
    let config = Config::from("/openapi.json").validator_url("none").try_it_out_enabled(true);
    SwaggerUi::new("/docs").url("/openapi.json", document).config(config).into()
}
