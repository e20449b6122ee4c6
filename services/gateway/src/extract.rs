//! axum's extractors with our problem documents as their rejections.

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use crate::problem::{Kind, Problem};

/// A JSON object and nothing else. serde also takes a list for a struct, field by field: a command given by the order
/// of its numbers, which nobody has promised.
pub struct Object<T>(pub T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OnlyObject<T>(std::marker::PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for OnlyObject<T> {
            type Value = T;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map))
            }
        }

        deserializer.deserialize_map(OnlyObject(std::marker::PhantomData)).map(Object)
    }
}

/// A JSON body, an object; every rejection is a problem document.
pub struct Json<T>(pub T);

impl<T: DeserializeOwned> Json<T> {
    /// Reads a body's bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Json<T>, Problem> {
        let axum::Json(Object(value)) = axum::Json::from_bytes(bytes)?;
        Ok(Json(value))
    }
}

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for Json<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Json<T>, Problem> {
        let axum::Json(Object(value)) = axum::Json::from_request(request, state).await?;
        Ok(Json(value))
    }
}

/// Path parameters; every rejection is a problem document.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Path), rejection(Problem))]
pub struct Path<T>(pub T);

/// Query parameters; every rejection is a problem document.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Query), rejection(Problem))]
pub struct Query<T>(pub T);

/// The `Lease-Id` header, where one is sent.
pub struct LeaseId(pub Option<String>);

impl<S: Sync> FromRequestParts<S> for LeaseId {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<LeaseId, Problem> {
        let mut values = parts.headers.get_all("lease-id").iter();
        let Some(value) = values.next() else { return Ok(LeaseId(None)) };
        if values.next().is_some() {
            return Err(
                Problem::new(Kind::MalformedHeader, "header Lease-Id stands more than once").hint("send one")
            );
        }
        match value.to_str() {
            Ok(text) if !text.trim().is_empty() => Ok(LeaseId(Some(text.trim().to_owned()))),
            _ => Err(Problem::new(Kind::MalformedHeader, "header Lease-Id is empty or not ASCII")
                .hint("send the lease_id that POST …/lease answered")),
        }
    }
}

/// A JSON body that may be left out altogether, or be `null`.
pub struct OptionalJson<T>(pub Option<T>);

impl<T: DeserializeOwned> OptionalJson<T> {
    /// Reads a body's bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<OptionalJson<T>, Problem> {
        if bytes.is_empty() {
            return Ok(OptionalJson(None));
        }
        let axum::Json(value) = axum::Json::<Option<Object<T>>>::from_bytes(bytes)?;
        Ok(OptionalJson(value.map(|Object(value)| value)))
    }
}

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for OptionalJson<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<OptionalJson<T>, Problem> {
        let (parts, body) = request.into_parts();
        let bytes = Bytes::from_request(Request::from_parts(parts.clone(), body), state).await?;
        if bytes.is_empty() {
            return Ok(OptionalJson(None));
        }
        // The header is looked at too.
        let request = Request::from_parts(parts, Body::from(bytes));
        let axum::Json(value) = axum::Json::<Option<Object<T>>>::from_request(request, state).await?;
        Ok(OptionalJson(value.map(|Object(value)| value)))
    }
}
