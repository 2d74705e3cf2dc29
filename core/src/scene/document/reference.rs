//! Owns the JSON Schema and the reference page of the scene document.

use std::fmt::Write;

use serde_json::Value as Json;

use crate::scene::document::root::Root;
use crate::scene::document::rule::short;
use crate::scene::document::schema;

/// What the page says before its tables.
const PREFACE: &str = include_str!("reference.md");
/// The example on the page.
pub(super) const EXAMPLE: &str = include_str!("example.json");

/// The JSON Schema of the document (draft 2020-12), pretty-printed.
pub fn json_schema() -> String {
    format!("{:#}\n", schema::of::<Root>("karst scene"))
}

/// The reference page of the document, in Markdown: a table of fields for each object.
pub fn reference_page() -> String {
    let schema = schema::of::<Root>("karst scene");
    let mut page = format!("{PREFACE}```json\n{EXAMPLE}```\n");
    for (title, definition) in members(&schema["$defs"]) {
        page += &format!("\n## {title}\n\n");
        describe(&mut page, definition);
    }
    page
}

/// Adds the text of one definition.
fn describe(page: &mut String, definition: &Json) {
    if let Some(about) = definition["description"].as_str() {
        *page += &format!("{about}\n\n");
    }
    let variants = definition["oneOf"].as_array().map_or(&[][..], Vec::as_slice);
    for variant in variants {
        let about = variant["description"].as_str().unwrap_or_default();
        match variant["properties"]["type"]["const"].as_str() {
            Some(tag) => {
                *page += &format!("### `\"type\": \"{tag}\"`\n\n{about}\n\n");
                table(page, variant);
            }
            None => *page += &format!("- `{}`: {about}\n", variant["const"]),
        }
    }
    if let Some(forms) = definition["anyOf"].as_array() {
        for form in forms {
            *page += &format!("- {}\n", kind(form));
        }
    }
    table(page, definition);
    trim(page);
}

/// Adds the table of an object's fields, if it has any.
fn table(page: &mut String, object: &Json) {
    let required =
        |name: &str| object["required"].as_array().is_some_and(|names| names.iter().any(|n| n == name));
    let fields: Vec<_> = members(&object["properties"]).filter(|(name, _)| *name != "type").collect();
    if fields.is_empty() {
        return;
    }
    *page += "| field | type | default | range | meaning |\n|---|---|---|---|---|\n";
    for (name, field) in fields {
        let default = match &field["default"] {
            Json::Null if required(name) => "required".to_owned(),
            Json::Null => "none".to_owned(),
            default => format!("`{default}`"),
        };
        let about = field["description"].as_str().unwrap_or_default();
        let _ = writeln!(page, "| `{name}` | {} | {default} | {} | {about} |", kind(field), range(field));
    }
    *page += "\n";
}

fn trim(page: &mut String) {
    page.truncate(page.trim_end().len());
    *page += "\n";
}

fn members(object: &Json) -> impl Iterator<Item = (&str, &Json)> {
    object.as_object().into_iter().flatten().map(|(name, value)| (name.as_str(), value))
}

/// The type of a field in words.
fn kind(field: &Json) -> String {
    if let Some(title) = field["title"].as_str() {
        return title.to_owned();
    }
    if let Some(title) = field["$ref"].as_str().and_then(|reference| reference.strip_prefix("#/$defs/")) {
        return format!("[{title}](#{title})");
    }
    if let Some(forms) = field["anyOf"].as_array() {
        return forms.iter().map(kind).collect::<Vec<_>>().join(" or ");
    }
    if !field["const"].is_null() {
        return format!("`{}`", field["const"]);
    }
    match (field["type"].as_str(), field["minItems"].as_u64(), field["maxItems"].as_u64()) {
        (Some("array"), Some(least), Some(most)) if least == most => {
            format!("{least} × {}", kind(&field["items"]))
        }
        (Some("array"), ..) => format!("list of {}", kind(&field["items"])),
        (Some("object"), ..) => format!("table of {}", kind(&field["additionalProperties"])),
        (Some(name), ..) => name.to_owned(),
        (None, ..) => "any value".to_owned(),
    }
}

/// The range of a field in words; empty where there is none.
fn range(field: &Json) -> String {
    if let Some(forms) = field["anyOf"].as_array() {
        return forms.iter().map(range).find(|range| !range.is_empty()).unwrap_or_default();
    }
    if field["items"].is_object() && !field["maxItems"].is_null() {
        return range(&field["items"]);
    }
    let bound = |key: &str| field[key].as_f64().filter(|&number| number != f64::from(u32::MAX));
    let least = bound("minimum").map(|number| format!("≥ {}", short(number)));
    let above = bound("exclusiveMinimum").map(|number| format!("> {}", short(number)));
    let most = bound("maximum").map(|number| format!("≤ {}", short(number)));
    let below = bound("exclusiveMaximum").map(|number| format!("< {}", short(number)));
    if let (Some(least), Some(most)) = (bound("minimum"), bound("maximum")) {
        return format!("{} to {}", short(least), short(most));
    }
    let other = (!field["not"].is_null()).then(|| "not 0".to_owned());
    let items = field["minItems"].as_u64().filter(|&least| least > 0 && field["maxItems"].is_null());
    let entries = field["minProperties"].as_u64().or(items).map(|least| format!("at least {least}"));
    [above, least, below, most, other, entries].into_iter().flatten().collect::<Vec<_>>().join(", ")
}
