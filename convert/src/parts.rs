//! Owns the parts of a document that every importer writes in the same way: entries, matrices, names.

use glam::{DAffine2, DAffine3, DMat2, DVec2};
use serde_json::{Map, Value, json};

/// Longest name that is made of a scene's own, in bytes; what makes it unique comes behind.
pub(crate) const MAX_NAME: usize = 100;

/// Texture coordinates with v upwards become those with v downwards, and back.
pub(crate) const FLIP_V: DAffine2 =
    DAffine2 { matrix2: DMat2::from_cols(DVec2::X, DVec2::NEG_Y), translation: DVec2::Y };

/// The members of an entry of the document.
pub(crate) type Fields = Map<String, Value>;

/// An entry of a type.
pub(crate) fn fields<const N: usize>(kind: &str, parameters: [(&str, Value); N]) -> Fields {
    let parameters = parameters.into_iter().map(|(name, value)| (name.to_owned(), value));
    std::iter::once(("type".to_owned(), json!(kind))).chain(parameters).collect()
}

/// A transform of space.
pub(crate) fn transform(map: &DAffine3) -> Value {
    let row = |index: usize| {
        let row = map.matrix3.row(index);
        [row.x, row.y, row.z, map.translation[index]].map(unsigned)
    };
    json!({"matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]})
}

/// A transform of texture coordinates.
pub(crate) fn transform_uv(map: &DAffine2) -> Value {
    let row = |index: usize| {
        let row = map.matrix2.row(index);
        [row.x, row.y, map.translation[index]].map(unsigned)
    };
    json!({"matrix": [row(0), row(1)]})
}

/// The same number; 0 without a sign.
pub(crate) fn unsigned(number: f64) -> f64 {
    if number == 0.0 { 0.0 } else { number }
}

/// A character that names in documents may have, in place of another one.
pub(crate) fn allowed(c: char) -> char {
    if c.is_alphanumeric() || matches!(c, '_' | '-' | ' ') { c } else { '_' }
}

/// What documents allow of a name, perhaps nothing.
pub(crate) fn clean_name(wanted: &str) -> String {
    let mut name = String::new();
    for c in wanted.trim().chars().map(allowed) {
        if name.len() + c.len_utf8() > MAX_NAME {
            break;
        }
        name.push(c);
    }
    name
}

#[cfg(test)]
mod tests {
    use super::{FLIP_V, clean_name, fields, transform, transform_uv};
    use glam::{DAffine2, DAffine3, DMat3, DVec2, DVec3};
    use serde_json::{Value, json};

    #[test]
    fn matrices_are_written_by_rows_and_without_signs_at_zero() {
        let map = DAffine3 {
            matrix3: DMat3::from_cols_array(&[1.0, 2.0, 3.0, 4.0, -0.0, 6.0, 7.0, 8.0, 9.0]),
            translation: DVec3::new(-1.0, -0.0, 5.0),
        };
        let rows =
            json!([[1.0, 4.0, 7.0, -1.0], [2.0, 0.0, 8.0, 0.0], [3.0, 6.0, 9.0, 5.0], [0.0, 0.0, 0.0, 1.0]]);
        assert_eq!(transform(&map), json!({ "matrix": rows }));
        assert!(!transform(&map).to_string().contains("-0.0"));
        let uv = DAffine2::from_cols_array(&[1.0, 2.0, 3.0, 4.0, -0.0, 6.0]);
        assert_eq!(transform_uv(&uv).to_string(), r#"{"matrix":[[1.0,3.0,0.0],[2.0,4.0,6.0]]}"#);
    }

    #[test]
    fn v_is_turned_around_within_the_image() {
        assert_eq!(FLIP_V.transform_point2(DVec2::new(0.25, 0.25)), DVec2::new(0.25, 0.75));
        assert_eq!(FLIP_V * FLIP_V, DAffine2::IDENTITY);
    }

    #[test]
    fn names_keep_what_is_allowed_and_stay_short() {
        assert_eq!(clean_name(" a.b/c \u{e9}-1 "), "a_b_c \u{e9}-1");
        assert_eq!(clean_name("  "), "");
        // Two bytes each: a character is kept whole or not at all.
        assert_eq!(clean_name(&format!("a{}", "\u{e9}".repeat(80))).len(), 99);
    }

    #[test]
    fn entries_begin_with_their_type() {
        let entry = Value::Object(fields("point", [("b", json!(1)), ("a", json!([]))]));
        assert_eq!(entry.to_string(), r#"{"type":"point","b":1,"a":[]}"#);
    }
}
