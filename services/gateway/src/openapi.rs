//! The frame of the OpenAPI document; the routes fill it in from their own code.

use utoipa::openapi::path::Operation;
use utoipa::openapi::schema::{AdditionalProperties, ObjectBuilder, Schema, Type};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::server::ServerBuilder;
use utoipa::openapi::{
    ContentBuilder, Info, OpenApi, OpenApiBuilder, PathItem, Ref, RefOr, ResponseBuilder, tag::TagBuilder,
};

use crate::App;
use crate::problem::Kind;
use crate::view::SetpointRange;

/// The document as the routes make it; [`finish`] adds what may change.
pub struct Document(pub OpenApi);

impl std::fmt::Debug for Document {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Document {{ paths: {} }}", self.0.paths.paths.len())
    }
}

/// Title, tags and the table of errors.
pub fn opening() -> OpenApi {
    let mut info = Info::new("kort", env!("CARGO_PKG_VERSION"));
    info.description = Some(description());
    let tags = [
        ("thrusters", "What is known of each thruster"),
        ("command", "Lease, arming, setpoint, control law"),
        ("rig", "The rig description in force, its revisions, and the way back"),
        ("diagnoses", "What the model left out, found while the thruster runs"),
        ("fits", "The model's parameters, fitted to a recording while the thruster runs"),
        ("calibrations", "Signs, zeros, friction, lags and thrust map of a thruster, stage by stage"),
        ("recordings", "Recordings of the live signals"),
        ("health", "Health and metrics"),
        ("console", "The operator's console"),
    ];
    OpenApiBuilder::new()
        .info(info)
        .tags(Some(tags.map(|(name, words)| TagBuilder::new().name(name).description(Some(words)).build())))
        .build()
}

/// What can be asked of a path.
fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    let PathItem { get, put, post, delete, patch, .. } = item;
    [get, put, post, delete, patch].into_iter().flatten()
}

/// Tokens: the scheme, where it is asked for, and what comes without one.
fn secure(document: &mut OpenApi, app: &App) {
    let scheme = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some("`kort token new NAME --role viewer|pilot|admin` makes one; on loopback none is needed by default"))
        .build();
    if let Some(components) = &mut document.components {
        components.security_schemes.insert("token".into(), SecurityScheme::Http(scheme));
    }
    document.servers = Some(vec![
        ServerBuilder::new().url("/").description(Some(format!("this gateway, {}", app.address()))).build(),
    ]);
    let asked: SecurityRequirement = SecurityRequirement::new("token", Vec::<String>::new());
    // An empty requirement: nothing is asked for.
    let nobody = SecurityRequirement::default();
    let refusal = |words: &str| {
        ResponseBuilder::new()
            .description(words)
            .content(
                "application/problem+json",
                ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build(),
            )
            .build()
    };
    for (path, item) in &mut document.paths.paths {
        let open = crate::gate::is_open(path);
        for operation in operations(item) {
            let has_parameters =
                !open || operation.parameters.as_ref().is_some_and(|parameters| !parameters.is_empty());
            let answers = &mut operation.responses.responses;
            let mut add = |status: &str, words: &str| {
                answers.entry(status.into()).or_insert_with(|| refusal(words).into());
            };
            add("421", "`foreign-host`: header Host names no gateway we know");
            add("408", "`request-timeout`: it took over 10 s");
            if has_parameters {
                add(
                    "400",
                    "`malformed-path`, `malformed-header`: what stands in the path or in a header is not readable",
                );
            }
            if open {
                add("403", "`foreign-origin`: a page of another site asks");
                operation.security = Some(vec![nobody.clone()]);
                continue;
            }
            add("401", "`token-required`: no token, or one that is not known");
            add("403", "`role-too-low`, `foreign-origin`");
            operation.security = Some(vec![asked.clone(), nobody.clone()]);
        }
    }
}

fn description() -> String {
    let mut text = String::from(
        "Thrust control for marine thrusters. SI units throughout, the unit ends each name; positive is ahead.\n\n\
         To move a thruster: `POST …/lease`, `POST …/arm`, `PUT …/setpoint` with header `Lease-Id`, again before the \
         lease runs out. When the lease ends, thrust is ramped to zero. `POST /v1/stop` stops everything, from any pilot.\n\n\
         Roles: a viewer reads, a pilot commands, an admin changes rig descriptions, and recordings of others.\n\n\
         Every error is an RFC 9457 problem document, `application/problem+json`, with one of these types:\n\n\
         | `type` | status | meaning |\n| --- | --- | --- |\n",
    );
    for kind in Kind::ALL {
        let (status, slug, title) = kind.entry();
        text.push_str(&format!("| `urn:kort:problem:{slug}` | {} | {title} |\n", status.as_u16()));
    }
    text
}

/// What only the configuration knows: how far setpoints go, of whichever thruster goes farthest, and which thrusters there are.
pub fn finish(document: &mut OpenApi, app: &App) {
    let range = |pick: fn(&SetpointRange) -> f64| {
        app.thrusters().iter().map(|thruster| pick(&thruster.range())).fold(0.0, f64::max)
    };
    let ids: Vec<&str> = app.thrusters().iter().map(|thruster| thruster.id.as_str()).collect();
    for item in document.paths.paths.values_mut() {
        for parameter in operations(item).flat_map(|operation| operation.parameters.iter_mut().flatten()) {
            if parameter.name == "id" {
                let known =
                    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(ids.iter().copied()));
                parameter.schema = Some(known.into());
            }
        }
    }
    secure(document, app);
    let bounds = [("thrust_n", range(|r| r.thrust_n)), ("speed_rad_s", range(|r| r.speed_rad_s))];
    let Some(components) = &mut document.components else { return };
    let Some(RefOr::T(Schema::OneOf(setpoint))) = components.schemas.get_mut("Setpoint") else { return };
    for item in &mut setpoint.items {
        let RefOr::T(Schema::Object(object)) = item else { continue };
        for (name, bound) in bounds {
            if let Some(RefOr::T(Schema::Object(number))) = object.properties.get_mut(name) {
                let words = number.description.take().unwrap_or_default();
                let own = format!(
                    "The bounds are those of the thruster that goes farthest; its own are in each one's state, `range.{name}`."
                );
                number.description = Some(format!("{words} {own}").trim().to_owned());
                number.minimum = Some(utoipa::Number::Float(-bound));
                number.maximum = Some(utoipa::Number::Float(bound));
                object.additional_properties = Some(Box::new(AdditionalProperties::FreeForm(false)));
            }
        }
    }
}
