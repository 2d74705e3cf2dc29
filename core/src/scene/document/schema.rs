//! Owns the JSON Schema of the document, made from the same definitions as the decoder.

use serde_json::{Map, Value as Json, json};

use crate::scene::document::decode::Decode;
use crate::scene::document::rule::{Allowed, Rule};

/// Schemas of the types with fields, in the order in which they were first met.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    map: Map<String, Json>,
}

impl Definitions {
    /// A reference to the definition of that title, which is made when it is first asked for.
    pub(super) fn define(&mut self, title: &str, make: impl FnOnce(&mut Self) -> Json) -> Json {
        let key = title.replace(' ', "_").to_lowercase();
        if !self.map.contains_key(&key) {
            // Holds the place first: a type may contain itself.
            self.map.insert(key.clone(), Json::Null);
            let made = make(self);
            self.map.insert(key.clone(), made);
        }
        json!({"$ref": format!("#/$defs/{key}")})
    }
}

/// The schema of an object that is being built.
#[derive(Debug)]
pub(super) struct Fields {
    about: String,
    properties: Map<String, Json>,
    required: Vec<Json>,
}

impl Fields {
    /// An object without fields yet.
    pub(super) fn new(about: &str) -> Self {
        Self { about: about.trim().to_owned(), properties: Map::new(), required: Vec::new() }
    }

    /// Adds the field that tells variants apart.
    pub(super) fn tag(&mut self, tag: &str) {
        self.properties.insert("type".to_owned(), json!({"const": tag}));
        self.required.push(json!("type"));
    }

    /// Adds a field.
    pub(super) fn add<T: Decode>(
        &mut self,
        name: &str,
        about: &str,
        rule: Rule<T>,
        definitions: &mut Definitions,
    ) {
        let mut schema = T::schema(&rule.allowed, definitions);
        schema["description"] = json!(about.trim());
        match rule.default.as_ref().map(T::show) {
            None => self.required.push(json!(name)),
            Some(Json::Null) if rule.allowed.auto => schema["default"] = json!("auto"),
            Some(Json::Null) => {}
            Some(default) => schema["default"] = default,
        }
        self.properties.insert(name.to_owned(), schema);
    }

    /// The schema of the object.
    pub(super) fn finish(self) -> Json {
        json!({
            "type": "object",
            "description": self.about,
            "properties": self.properties,
            "required": self.required,
            "additionalProperties": false,
        })
    }
}

/// The schema of an object with variants.
pub(super) fn one_of(about: &str, variants: Vec<Json>) -> Json {
    json!({"description": about.trim(), "oneOf": variants})
}

/// The schema of a number.
pub(super) fn number(kind: &str, allowed: &Allowed) -> Json {
    let mut schema = json!({"type": kind});
    if allowed.min.is_finite() {
        schema[if allowed.above { "exclusiveMinimum" } else { "minimum" }] = allowed.min.show();
    }
    if allowed.max.is_finite() {
        schema[if allowed.below { "exclusiveMaximum" } else { "maximum" }] = allowed.max.show();
    }
    if allowed.nonzero {
        schema["not"] = json!({"const": 0});
    }
    schema
}

/// JSON Schema of a type and of all types in it.
pub(super) fn of<T: Decode>(title: &str) -> Json {
    let mut definitions = Definitions::default();
    let root = T::schema(&Allowed::ANY, &mut definitions);
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "$ref": root["$ref"],
        "$defs": definitions.map,
    })
}
