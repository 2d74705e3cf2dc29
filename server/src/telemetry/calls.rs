//! Owns the counting of gRPC calls: by method and code, when a call has ended and its trailers are known.

use std::collections::BTreeSet;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::http::HeaderMap;
use axum::middleware::Next;
use axum::response::Response;
use karst_proto::FILE_DESCRIPTOR_SET;
use prost::Message as _;
use prost_types::FileDescriptorSet;
use tonic::{Code, Status};

use crate::door::is_call;
use crate::telemetry::Telemetry;

/// What calls are called that no proto file knows: a stranger's paths must not become names of metrics.
const OTHER: &str = "other";

/// Every method that can be counted, as SERVICE/METHOD, and [`OTHER`].
pub(crate) fn methods() -> BTreeSet<String> {
    let standard =
        ["grpc.health.v1.Health/Check", "grpc.reflection.v1.ServerReflection/ServerReflectionInfo", OTHER];
    let mut methods: BTreeSet<String> = standard.map(String::from).into();
    let known = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).unwrap_or_default().file;
    for file in known.iter().filter(|file| file.package() == "karst.v1") {
        for service in &file.service {
            let name = |method: &prost_types::MethodDescriptorProto| {
                format!("karst.v1.{}/{}", service.name(), method.name())
            };
            methods.extend(service.method.iter().map(name));
        }
    }
    methods
}

/// Where calls are counted.
#[derive(Debug, Clone)]
pub(crate) struct Counter {
    telemetry: Arc<Telemetry>,
    methods: Arc<BTreeSet<String>>,
}

impl Counter {
    /// Counts in `telemetry`.
    pub(crate) fn new(telemetry: Arc<Telemetry>) -> Self {
        Self { telemetry, methods: Arc::new(methods()) }
    }
}

/// Counts a call when it has ended.
pub(crate) async fn count(State(counter): State<Counter>, request: Request, next: Next) -> Response {
    if !is_call(request.headers()) {
        return next.run(request).await;
    }
    let name = request.uri().path().trim_start_matches('/');
    let method = counter.methods.get(name).map_or(OTHER, String::as_str).to_owned();
    let mut open = OpenCall { telemetry: counter.telemetry, method, code: Code::Cancelled };
    let response = next.run(request).await;
    open.look(response.headers());
    response.map(|body| Body::new(CountedBody { body, open }))
}

/// A call; counted when it is dropped.
struct OpenCall {
    telemetry: Arc<Telemetry>,
    method: String,
    /// What it ended with; cancelled while nothing else is known.
    code: Code,
}

impl OpenCall {
    fn look(&mut self, headers: &HeaderMap) {
        if let Some(status) = Status::from_header_map(headers) {
            self.code = status.code();
        }
    }
}

impl Drop for OpenCall {
    fn drop(&mut self) {
        self.telemetry.counts.add_call(&self.method, self.code);
    }
}

/// The body of an answer: its trailers say how the call ended.
struct CountedBody {
    body: Body,
    open: OpenCall,
}

impl HttpBody for CountedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<http_body::Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(cx);
        match &polled {
            Poll::Ready(Some(Ok(frame))) => {
                if let Some(trailers) = frame.trailers_ref() {
                    self.open.look(trailers);
                }
            }
            Poll::Ready(Some(Err(_))) => self.open.code = Code::Unknown,
            Poll::Ready(None) | Poll::Pending => {}
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> http_body::SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use std::future::poll_fn;
    use std::pin::Pin;
    use std::sync::Arc;
    use std::task::{Context, Poll};

    use axum::Router;
    use axum::body::{Body, Bytes, HttpBody};
    use axum::extract::Request;
    use axum::http::HeaderMap;
    use axum::middleware::from_fn_with_state;
    use axum::response::Response;
    use tonic::Status;
    use tower::ServiceExt as _;

    use super::{Counter, count};
    use crate::telemetry::Telemetry;

    /// Answers with nothing but these trailers.
    struct Trailers(Option<HeaderMap>);

    impl HttpBody for Trailers {
        type Data = Bytes;
        type Error = Status;

        fn poll_frame(
            mut self: Pin<&mut Self>,
            _: &mut Context<'_>,
        ) -> Poll<Option<Result<http_body::Frame<Bytes>, Status>>> {
            Poll::Ready(self.0.take().map(|trailers| Ok(http_body::Frame::trailers(trailers))))
        }
    }

    /// Fails at once, or ends well after its body was read.
    fn answer(good: bool) -> Response {
        let mut trailers = HeaderMap::new();
        trailers.insert("grpc-status", "0".parse().unwrap());
        let done = Response::new(Body::new(Trailers(Some(trailers))));
        if good { done } else { Status::not_found("no").into_http() }
    }

    fn service(telemetry: &Arc<Telemetry>, good: bool) -> Router {
        let counter = Counter::new(Arc::clone(telemetry));
        let router = Router::new().fallback(move || async move { answer(good) });
        router.layer(from_fn_with_state(counter, count))
    }

    async fn call(telemetry: &Arc<Telemetry>, path: &str, good: bool, read: bool) {
        let request = Request::builder().uri(path).header("content-type", "application/grpc");
        let request = request.body(Body::empty()).unwrap();
        let mut body = service(telemetry, good).oneshot(request).await.unwrap().into_body();
        while read && poll_fn(|cx| Pin::new(&mut body).poll_frame(cx)).await.is_some() {}
    }

    #[tokio::test]
    async fn calls_are_counted_by_method_and_code_when_they_have_ended() {
        let telemetry = Arc::new(Telemetry::off());
        let get = "/karst.v1.Jobs/GetJob";
        call(&telemetry, get, true, true).await;
        call(&telemetry, get, true, true).await;
        call(&telemetry, get, false, true).await;
        call(&telemetry, get, true, false).await;
        call(&telemetry, "/made.up/Path", true, true).await;
        let counted = |method: &str, code: tonic::Code| {
            telemetry.counts.add_call(method, code);
            let families = telemetry.counts.registry.gather();
            let calls = families.iter().find(|f| f.name() == "karst_calls_total").unwrap();
            let mut series = calls.get_metric().iter();
            let same = |m: &&prometheus::proto::Metric| {
                let value = |name| m.get_label().iter().find(|l| l.name() == name).unwrap().value();
                (value("method"), value("code")) == (method, format!("{code:?}").as_str())
            };
            series.find(same).unwrap().get_counter().get_value() - 1.0
        };
        let get = "karst.v1.Jobs/GetJob";
        assert_eq!(counted(get, tonic::Code::Ok), 2.0);
        assert_eq!(counted(get, tonic::Code::NotFound), 1.0);
        assert_eq!(counted(get, tonic::Code::Cancelled), 1.0, "nobody read the answer to its end");
        assert_eq!(counted("other", tonic::Code::Ok), 1.0, "a made-up path is no label");
    }

    #[tokio::test]
    async fn other_requests_are_not_calls() {
        let telemetry = Arc::new(Telemetry::off());
        let request = Request::builder().uri("/").body(Body::empty()).unwrap();
        drop(service(&telemetry, true).oneshot(request).await.unwrap());
        let families = telemetry.counts.registry.gather();
        let calls = families.iter().find(|f| f.name() == "karst_calls_total").unwrap();
        assert!(calls.get_metric().iter().all(|m| m.get_counter().get_value() == 0.0));
    }
}
