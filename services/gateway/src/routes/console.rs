//! The operator's console: one self-contained page, put together once from its parts.

use std::sync::{Arc, LazyLock};

use axum::http::header;
use axum::response::{Html, IntoResponse};
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use rust_embed::Embed;
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;

#[derive(Embed)]
#[folder = "console/"]
struct Parts;

/// What the page is put together from, each in its place. uPlot is other people's: MIT, its licence goes along.
const PARTS: [&str; 13] = [
    "vendor/uplot/LICENSE",
    "vendor/uplot/uPlot.min.css",
    "vendor/uplot/uPlot.iife.min.js",
    "style.css",
    "plot.js",
    "fleet.js",
    "console.js",
    "library.js",
    "signal.js",
    "recordings.js",
    "diagnosis.js",
    "fit.js",
    "calibration.js",
];

static PAGE: LazyLock<String> = LazyLock::new(|| {
    let part = |name: &str| {
        let file = Parts::get(name).unwrap_or_else(|| panic!("console/{name} is embedded at build time"));
        String::from_utf8_lossy(&file.data).into_owned()
    };
    let page =
        PARTS.iter().fold(part("index.html"), |page, name| page.replace(&format!("/*{name}*/"), &part(name)));
    page.replace("<!--models-->", &models()).replace("<!--effects-->", &known_effects())
});

/// The models that a diagnosis or a fit can be asked for.
fn models() -> String {
    let option = |model: ModelName| {
        let usual = if model == ModelName::Model2 { " selected" } else { "" };
        format!("<option{usual}>{}</option>", model.name())
    };
    ModelName::ALL.map(option).concat()
}

/// The effects that a diagnosis or a fit can take as known, a box each.
fn known_effects() -> String {
    let text = |words: &str| words.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
    let box_of = |effect: &&effects::Descriptor| {
        let (id, what) = (effect.id, text(effect.what));
        let name = id.replace('_', " ");
        format!("<label title=\"{what}\"><input type=\"checkbox\" value=\"{id}\"> {name}</label>")
    };
    effects::ALL.iter().map(box_of).collect()
}

/// What the page may load: itself, and nothing from elsewhere.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
    img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(console))
}

/// The operator's console.
#[utoipa::path(get, path = "/", tag = "console",
    responses((status = 200, description = "One self-contained page", body = String, content_type = "text/html")))]
async fn console() -> impl IntoResponse {
    ([(header::CONTENT_SECURITY_POLICY, POLICY), (header::CACHE_CONTROL, "no-cache")], Html(PAGE.as_str()))
}

#[cfg(test)]
mod tests {
    use super::PAGE;

    #[test]
    fn the_page_is_whole_and_asks_nobody_else() {
        for name in super::PARTS {
            assert!(!PAGE.contains(&format!("/*{name}*/")), "{name} is not in its place");
        }
        assert!(!PAGE.contains("<!--models-->") && !PAGE.contains("<!--effects-->"));
        assert!(PAGE.contains("Permission is hereby granted") && PAGE.contains("Leon Sorokin"));
        for outside in ["src=\"http", "href=\"http", "@import", "url(http", "fetch(\"http"] {
            assert!(!PAGE.contains(outside), "the console asks another host: {outside}");
        }
    }
}
