//! Owns the JSON Schema and the reference page of the scene document.

use serde_json::Value as Json;

use crate::scene::document::root::Root;
use crate::scene::document::schema;

/// The JSON Schema of the document (draft 2020-12), pretty-printed.
pub fn json_schema() -> String {
    let schema: Json = schema::of::<Root>("karst scene");
    format!("{schema:#}\n")
}
/// Stub.
pub fn reference_page() -> String {
    String::new()
}
