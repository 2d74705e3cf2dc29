//! Owns the guard: every call passes it, and one without the right token goes no further.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use tonic::Status;
use tonic::body::Body;
use tonic::codegen::{Service, http};

use crate::door::{Role, Tokens};
use crate::error::Error;

/// Puts the guard in front of a service.
#[derive(Debug, Clone)]
pub(crate) struct GuardLayer {
    pub(crate) tokens: Arc<Tokens>,
}

impl<S> tower::Layer<S> for GuardLayer {
    type Service = Guard<S>;

    fn layer(&self, inner: S) -> Guard<S> {
        Guard { tokens: Arc::clone(&self.tokens), inner }
    }
}

/// See [`GuardLayer`].
#[derive(Debug, Clone)]
pub(crate) struct Guard<S> {
    tokens: Arc<Tokens>,
    inner: S,
}

type Answer<T> = Pin<Box<dyn Future<Output = Result<http::Response<T>, Infallible>> + Send>>;

impl<S> Service<http::Request<Body>> for Guard<S>
where
    S: Service<http::Request<Body>, Response = http::Response<Body>, Error = Infallible>,
    S::Future: Send + 'static,
{
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = Answer<Body>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        match check(&self.tokens, &request) {
            Ok(()) => Box::pin(self.inner.call(request)),
            Err(error) => {
                let refused = Status::from(error).into_http();
                Box::pin(async move { Ok(refused) })
            }
        }
    }
}

fn check<T>(tokens: &Tokens, request: &http::Request<T>) -> Result<(), Error> {
    let path = request.uri().path();
    if Role::nobody_needs(path) {
        return Ok(());
    }
    let header = request.headers().get(http::header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let token = header.and_then(|text| text.strip_prefix("Bearer ")).ok_or(Error::NoToken)?;
    let (role, name) = tokens.find(token).ok_or(Error::TokenUnknown)?;
    if role.may(path) {
        return Ok(());
    }
    Err(Error::Role { name, role: role.to_string(), needs: Role::that_may(path), path: path.to_owned() })
}
