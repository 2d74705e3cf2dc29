//! Owns the page's files, which the program carries inside itself, and the headers that keep a page to its own
//! server.

use axum::extract::{Path, Request};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Name and text of every file in the folder `page` that browsers ask for.
macro_rules! files {
    ($($name:literal)*) => { &[$(($name, include_str!(concat!("../../page/", $name)))),*] };
}

const FILES: &[(&str, &str)] = files! {
    "index.html" "page.css" "controls.js" "dom.js" "format.js" "jobs.js" "keys.js" "login.js" "main.js"
    "messages.js" "permalink.js" "picture.js" "probe.js" "selection.js" "shader.js" "socket.js" "stage.js"
    "status.js" "strip.js"
};

/// What every answer says: the page needs nothing but its own server, and nobody else may use it.
const HEADERS: [(HeaderName, HeaderValue); 4] = [
    (
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(
            "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
             base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        ),
    ),
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
];

pub(super) async fn index() -> Response {
    answer("index.html")
}

pub(super) async fn file(Path(name): Path<String>) -> Response {
    answer(&name)
}

fn answer(name: &str) -> Response {
    let Some((_, text)) = FILES.iter().find(|(known, _)| *known == name) else {
        return (StatusCode::NOT_FOUND, "the page has no such file\n").into_response();
    };
    let kind = match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        _ => "text/html; charset=utf-8",
    };
    ([(header::CONTENT_TYPE, kind)], *text).into_response()
}

/// Adds [`HEADERS`] to an answer.
pub(super) async fn protect(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    response.headers_mut().extend(HEADERS);
    response
}

#[cfg(test)]
mod tests {
    use super::FILES;

    #[test]
    fn every_file_of_the_folder_is_carried() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/page");
        let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> =
            names.filter(|n| !["PROTOCOL.md", "check.py", "test.sh"].contains(&n.as_str())).collect();
        let mut carried: Vec<_> = FILES.iter().map(|(name, _)| name.to_string()).collect();
        names.sort();
        carried.sort();
        assert_eq!(carried, names);
    }
}
