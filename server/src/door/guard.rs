//! Owns the guard: every call passes it, and one without the right token goes no further.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use tonic::Status;

use crate::door::{Role, Tokens};
use crate::error::Error;

/// Lets a call through whose token may make it.
pub(crate) async fn guard(State(tokens): State<Arc<Tokens>>, request: Request, next: Next) -> Response {
    match check(&tokens, request.uri().path(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(error) => refuse(error, request.headers()),
    }
}

fn refuse(error: Error, headers: &HeaderMap) -> Response {
    if is_call(headers) {
        return Status::from(error).into_http::<Body>();
    }
    let is_known = matches!(error, Error::Role { .. });
    let code = if is_known { StatusCode::FORBIDDEN } else { StatusCode::UNAUTHORIZED };
    (code, format!("{error}\n")).into_response()
}

/// Whether a request is a gRPC call, which hears of errors in its own way.
pub(crate) fn is_call(headers: &HeaderMap) -> bool {
    headers.get(header::CONTENT_TYPE).is_some_and(|kind| kind.as_bytes().starts_with(b"application/grpc"))
}

/// Whether the bearer of a request's token may call `path`.
///
/// # Errors
/// Why not.
pub(crate) fn check(tokens: &Tokens, path: &str, headers: &HeaderMap) -> Result<(), Error> {
    if Role::nobody_needs(path) {
        return Ok(());
    }
    let header = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let token = header.and_then(|text| text.strip_prefix("Bearer ")).ok_or(Error::NoToken)?;
    let (role, name) = tokens.find(token).ok_or(Error::TokenUnknown)?;
    if role.may(path) {
        return Ok(());
    }
    Err(Error::Role { name, role: role.to_string(), needs: Role::that_may(path), path: path.to_owned() })
}
