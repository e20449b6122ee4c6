//! The frame of the OpenAPI document; the routes fill it in from their own code.

use utoipa::openapi::schema::{AdditionalProperties, ObjectBuilder, Schema, Type};
use utoipa::openapi::{Info, OpenApi, OpenApiBuilder, RefOr, tag::TagBuilder};

use crate::App;
use crate::problem::Kind;
use crate::view::SetpointRange;

/// Title, tags and the table of errors.
pub fn opening() -> OpenApi {
    let mut info = Info::new("kort", env!("CARGO_PKG_VERSION"));
    info.description = Some(description());
    let tags = [
        ("thrusters", "What is known of each thruster"),
        ("command", "Lease, arming, setpoint, control law"),
        ("recordings", "Recordings of the live signals"),
        ("health", "Health and metrics"),
        ("console", "The operator's console"),
    ];
    OpenApiBuilder::new()
        .info(info)
        .tags(Some(tags.map(|(name, words)| TagBuilder::new().name(name).description(Some(words)).build())))
        .build()
}

fn description() -> String {
    let mut text = String::from(
        "Thrust control for marine thrusters. SI units throughout, the unit ends each name; positive is ahead.\n\n\
         To move a thruster: `POST …/lease`, `POST …/arm`, `PUT …/setpoint` with header `Lease-Id`, again before the \
         lease runs out. When the lease ends, thrust is ramped to zero.\n\n\
         Every error is an RFC 9457 problem document, `application/problem+json`, with one of these types:\n\n\
         | `type` | status | meaning |\n| --- | --- | --- |\n",
    );
    for kind in Kind::ALL {
        let (status, slug, title) = kind.entry();
        text.push_str(&format!("| `urn:kort:problem:{slug}` | {} | {title} |\n", status.as_u16()));
    }
    text
}

/// What only the configuration knows: the range of setpoints, and which thrusters there are.
pub fn finish(document: &mut OpenApi, app: &App) {
    let range = |pick: fn(&SetpointRange) -> f64| {
        app.thrusters().iter().map(|thruster| pick(&thruster.range)).fold(f64::INFINITY, f64::min)
    };
    let ids: Vec<&str> = app.thrusters().iter().map(|thruster| thruster.id.as_str()).collect();
    for item in document.paths.paths.values_mut() {
        let operations = [&mut item.get, &mut item.put, &mut item.post, &mut item.delete];
        for parameter in
            operations.into_iter().flatten().flat_map(|operation| operation.parameters.iter_mut().flatten())
        {
            if parameter.name == "id" {
                let known =
                    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(ids.iter().copied()));
                parameter.schema = Some(known.into());
            }
        }
    }
    let bounds = [("thrust_n", range(|r| r.thrust_n)), ("speed_rad_s", range(|r| r.speed_rad_s))];
    let Some(components) = &mut document.components else { return };
    let Some(RefOr::T(Schema::OneOf(setpoint))) = components.schemas.get_mut("Setpoint") else { return };
    for item in &mut setpoint.items {
        let RefOr::T(Schema::Object(object)) = item else { continue };
        for (name, bound) in bounds {
            if let Some(RefOr::T(Schema::Object(number))) = object.properties.get_mut(name) {
                number.minimum = Some(utoipa::Number::Float(-bound));
                number.maximum = Some(utoipa::Number::Float(bound));
                object.additional_properties = Some(Box::new(AdditionalProperties::FreeForm(false)));
            }
        }
    }
}
