//! Owns the JSON Schema and the reference page of the scene document.
