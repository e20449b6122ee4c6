//! axum's extractors with our problem documents as their rejections.

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;

use crate::problem::{Kind, Problem};

/// A JSON body; every rejection is a problem document.
#[derive(FromRequest)]
#[from_request(via(axum::Json), rejection(Problem))]
pub struct Json<T>(pub T);

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

impl<S: Send + Sync, T: serde::de::DeserializeOwned> FromRequest<S> for OptionalJson<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<OptionalJson<T>, Problem> {
        let (parts, body) = request.into_parts();
        let bytes = Bytes::from_request(Request::from_parts(parts.clone(), body), state).await?;
        if bytes.is_empty() {
            return Ok(OptionalJson(None));
        }
        let Json(value) = Json::from_request(Request::from_parts(parts, Body::from(bytes)), state).await?;
        Ok(OptionalJson(value))
    }
}
