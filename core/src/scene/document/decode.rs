//! Owns how values of the document become values of Rust, for the types that fields are made of.

use glam::{DVec2, DVec3, Vec3, Vec4};
use serde_json::{Value as Json, json};

use crate::bsdf::Distribution;
use crate::color::View;
use crate::scene::document::asset;
use crate::scene::document::cursor::Cursor;
use crate::scene::document::macros::words;
use crate::scene::document::named::Named;
use crate::scene::document::rule::{Allowed, Meaning};
use crate::scene::document::schema::{self, Definitions};
use crate::scene::document::tree::{Node, Value};
use crate::sdf::Trap;
use crate::texture::{Channel, ColorSpace, TextureFilter, Wrap};

/// A type of the document: how it is read, how it is written and what its schema is.
pub(super) trait Decode: Sized {
    /// Reads the value at a place, or reports everything that is wrong with it.
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self>;
    /// What is allowed, in words, with an article.
    fn expected(allowed: &Allowed) -> String;
    /// JSON Schema; types with fields put theirs into the definitions.
    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json;
    /// The value as a document would say it; null for a field that it would leave out.
    fn show(&self) -> Json;
}

/// Fields that stand in an object of their own, or among those of another.
pub(super) trait Fields: Sized {
    /// Their names.
    const NAMES: &'static [&'static str];
    /// Reads them, or reports everything that is wrong with them; what else stands there is not looked at.
    fn decode_fields(at: &Cursor<'_>) -> Option<Self>;
    /// Adds them to the schema of an object.
    fn add_fields(fields: &mut schema::Fields, definitions: &mut Definitions);
    /// Adds them as a document would say them.
    fn show_fields(&self, fields: &mut serde_json::Map<String, Json>);
}

/// A number in the range, or a report.
fn number(at: &Cursor<'_>, allowed: &Allowed, expected: &str) -> Option<f64> {
    let Value::Number(number) = at.node.value else {
        at.expected(expected);
        return None;
    };
    if !allowed.holds(number) {
        at.expected(if number.is_finite() { expected } else { "a finite number" });
        return None;
    }
    Some(number)
}

impl Decode for f64 {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        number(at, allowed, &Self::expected(allowed))
    }

    fn expected(allowed: &Allowed) -> String {
        allowed.words("a number")
    }

    fn schema(allowed: &Allowed, _: &mut Definitions) -> Json {
        schema::number("number", allowed)
    }

    fn show(&self) -> Json {
        if self.fract() == 0.0 && self.abs() < 1.0e15 { json!(*self as i64) } else { json!(self) }
    }
}

impl Decode for f32 {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let wide = f64::decode(at, allowed)?;
        let narrow = wide as Self;
        if allowed.holds(f64::from(narrow)) || allowed.ends_at(narrow) {
            return Some(narrow);
        }
        at.problem(format!("found {}, which single precision rounds to {narrow}", at.found()), None);
        None
    }

    fn expected(allowed: &Allowed) -> String {
        f64::expected(allowed)
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        f64::schema(allowed, definitions)
    }

    fn show(&self) -> Json {
        // Through the shortest text, so that 0.1 stays 0.1.
        self.to_string().parse().map_or(Json::Null, |wide: f64| wide.show())
    }
}

/// An integer in the range and within `min..=max`, or a report.
fn integer(at: &Cursor<'_>, allowed: &Allowed, min: f64, max: f64) -> Option<f64> {
    let allowed = Allowed { min: allowed.min.max(min), max: allowed.max.min(max), ..*allowed };
    let expected = allowed.words("an integer");
    let found = number(at, &allowed, &expected)?;
    if at.node.blended {
        at.problem(
            "found linear interpolation between integers",
            Some("an integer changes by \"interpolation\": \"step\"".to_owned()),
        );
        return None;
    }
    if found.fract() != 0.0 {
        at.expected(&expected);
        return None;
    }
    Some(found)
}

impl Decode for bool {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let Value::Bool(value) = at.node.value else {
            at.expected(&Self::expected(allowed));
            return None;
        };
        Some(value)
    }

    fn expected(_: &Allowed) -> String {
        "true or false".to_owned()
    }

    fn schema(_: &Allowed, _: &mut Definitions) -> Json {
        json!({"type": "boolean"})
    }

    fn show(&self) -> Json {
        json!(self)
    }
}

macro_rules! integers {
    ($($ty:ty),+) => {$(
        impl Decode for $ty {
            fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
                integer(at, allowed, Self::MIN.into(), Self::MAX.into()).map(|whole| whole as Self)
            }

            fn expected(allowed: &Allowed) -> String {
                allowed.words("an integer")
            }

            fn schema(allowed: &Allowed, _: &mut Definitions) -> Json {
                let (min, max) = (allowed.min.max(Self::MIN.into()), allowed.max.min(Self::MAX.into()));
                schema::number("integer", &Allowed { min, max, ..*allowed })
            }

            fn show(&self) -> Json {
                json!(self)
            }
        }
    )+};
}

integers!(u32, i32);

/// The elements of a list of that length, or a report.
pub(super) fn elements<'a>(at: &Cursor<'a>, length: usize, expected: &str) -> Option<&'a [Node]> {
    if let Value::List(items) = &at.node.value
        && items.len() == length
    {
        return Some(items);
    }
    at.expected(expected);
    None
}

/// Numbers of a list of that length, each in the range; every wrong one is reported.
fn numbers<T: Decode, const N: usize>(at: &Cursor<'_>, allowed: &Allowed, expected: &str) -> Option<[T; N]> {
    let found = elements(at, N, expected)?;
    let decoded: Vec<Option<T>> =
        found.iter().enumerate().map(|(index, node)| T::decode(&at.element(index, node), allowed)).collect();
    decoded.into_iter().collect::<Option<Vec<T>>>()?.try_into().ok()
}

macro_rules! vectors {
    ($($ty:ty: $number:ty, $length:literal);+) => {$(
        impl Decode for $ty {
            fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
                numbers::<$number, $length>(at, allowed, &Self::expected(allowed)).map(Self::from)
            }

            fn expected(allowed: &Allowed) -> String {
                let list = concat!("a list of ", $length, " numbers, each");
                allowed.words(list).trim_end_matches(", each").to_owned()
            }

            fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
                let allowed = Allowed { auto: false, ..*allowed };
                let items = <$number>::schema(&allowed, definitions);
                json!({"type": "array", "items": items, "minItems": $length, "maxItems": $length})
            }

            fn show(&self) -> Json {
                self.to_array().iter().map(Decode::show).collect()
            }
        }
    )+};
}

vectors!(DVec2: f64, 2; Vec3: f32, 3; Vec4: f32, 4; DVec3: f64, 3);

impl Decode for String {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let Value::Text(text) = &at.node.value else {
            at.expected(&Self::expected(allowed));
            return None;
        };
        match allowed.meaning {
            Meaning::Word | Meaning::Path => Some(text.clone()),
            Meaning::File(kind) => asset::decode_path(at, text, kind),
            Meaning::NameIn(table) => {
                let names = at.context.names(table);
                if names.contains(text.as_str()) {
                    return Some(text.clone());
                }
                let hint = at
                    .context
                    .nearest(text, names.iter().copied())
                    .map(|name| format!("did you mean {name:?}?"));
                let none = || format!("add it to {:?}", table.field());
                let message = format!("found {}, expected the name of a {}", at.found(), table.entry());
                at.problem(message, Some(hint.unwrap_or_else(none)));
                None
            }
        }
    }

    fn expected(allowed: &Allowed) -> String {
        match allowed.meaning {
            Meaning::Word | Meaning::Path => "a string".to_owned(),
            Meaning::File(kind) => format!("the path of {}", kind.words()),
            Meaning::NameIn(table) => format!("the name of a {}", table.entry()),
        }
    }

    fn schema(allowed: &Allowed, _: &mut Definitions) -> Json {
        match allowed.meaning {
            Meaning::Word | Meaning::Path => json!({"type": "string"}),
            Meaning::File(kind) => json!({"type": "string", "title": format!("path of {}", kind.words())}),
            Meaning::NameIn(table) => {
                json!({"type": "string", "title": format!("name in `{}`", table.field())})
            }
        }
    }

    fn show(&self) -> Json {
        json!(self)
    }
}

impl<T: Decode> Decode for Option<T> {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        if allowed.auto && at.node.value == Value::Text("auto".to_owned()) {
            return Some(None);
        }
        T::decode(at, allowed).map(Some)
    }

    fn expected(allowed: &Allowed) -> String {
        T::expected(allowed)
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        let inner = T::schema(allowed, definitions);
        if allowed.auto { json!({"anyOf": [{"const": "auto"}, inner]}) } else { inner }
    }

    fn show(&self) -> Json {
        self.as_ref().map_or(Json::Null, T::show)
    }
}

impl<T: Decode> Decode for Box<T> {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        T::decode(at, allowed).map(Self::new)
    }

    fn expected(allowed: &Allowed) -> String {
        T::expected(allowed)
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        T::schema(allowed, definitions)
    }

    fn show(&self) -> Json {
        T::show(self)
    }
}

impl<T: Decode> Decode for Vec<T> {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let Value::List(items) = &at.node.value else {
            at.expected(&Self::expected(allowed));
            return None;
        };
        if (items.len() as f64) < allowed.min {
            at.expected(&Self::expected(allowed));
            return None;
        }
        // Every element is decoded before the first failure ends it, so that all problems are reported.
        let decoded: Vec<Option<T>> = items
            .iter()
            .enumerate()
            .map(|(index, item)| T::decode(&at.element(index, item), &Allowed::ANY))
            .collect();
        decoded.into_iter().collect()
    }

    fn expected(allowed: &Allowed) -> String {
        if allowed.min > 0.0 { format!("a list of at least {}", allowed.min) } else { "a list".to_owned() }
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        let items = T::schema(&Allowed::ANY, definitions);
        let least = allowed.min.max(0.0) as u64;
        json!({"type": "array", "items": items, "minItems": least})
    }

    fn show(&self) -> Json {
        self.iter().map(T::show).collect()
    }
}

/// A name of a thing: short, and without what paths are made of.
fn is_name(name: &str) -> bool {
    let fits = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | ' ');
    !name.is_empty() && name.len() <= 128 && name.chars().all(fits)
}

impl<T: Decode> Decode for Named<T> {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let Value::Object(members) = &at.node.value else {
            at.expected(&Self::expected(allowed));
            return None;
        };
        if members.len() as u64 > at.context.limits.max_names {
            at.problem(
                format!("found {} names, the limit is {}", members.len(), at.context.limits.max_names),
                None,
            );
            return None;
        }
        if (members.len() as f64) < allowed.min {
            at.problem(format!("found no entries, expected at least {}", allowed.min), None);
            return None;
        }
        let decode = |member: &crate::scene::document::tree::Member| {
            let path = at.path.name(&member.name);
            if allowed.meaning != Meaning::Path && !is_name(&member.name) {
                let message = "expected a name of 1 to 128 letters, digits, '_', '-' and spaces".to_owned();
                let hint = "animation addresses things by their names, joined with '.'".to_owned();
                at.problem_at(member.start, &path, message, Some(hint));
            }
            let value = T::decode(&Cursor { node: &member.node, path, context: at.context }, &Allowed::ANY);
            Some((member.name.clone(), value?))
        };
        let decoded: Vec<Option<(String, T)>> = members.iter().map(decode).collect();
        decoded.into_iter().collect()
    }

    fn expected(_: &Allowed) -> String {
        "an object with a name for each entry".to_owned()
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        let entry = T::schema(&Allowed::ANY, definitions);
        let least = allowed.min.max(0.0) as u64;
        let mut schema = json!({"type": "object", "additionalProperties": entry});
        if least > 0 {
            schema["minProperties"] = json!(least);
        }
        schema
    }

    fn show(&self) -> Json {
        Json::Object(self.iter().map(|(name, value)| (name.to_owned(), value.show())).collect())
    }
}

words! {
    "color space";
    ColorSpace {
        /// The sRGB curve: pictures.
        "srgb" => Srgb,
        /// Proportional to light: data.
        "linear" => Linear,
    }
}

words! {
    "view";
    View {
        /// The sRGB curve with clipping at 1.
        "standard" => Standard,
        /// A film-like curve with a shoulder; highlights roll off instead of clipping.
        "filmic" => Filmic,
    }
}

words! {
    "wrap";
    Wrap {
        /// The texture repeats.
        "repeat" => Repeat,
        /// Every second copy is mirrored.
        "mirror" => Mirror,
        /// The texels at the edge go on.
        "clamp" => Clamp,
    }
}

words! {
    "texture filter";
    TextureFilter {
        /// Between texels, values change linearly.
        "bilinear" => Bilinear,
        /// Every point has the value of the nearest texel.
        "nearest" => Nearest,
    }
}

words! {
    "channel";
    Channel {
        /// Luminance of the colour.
        "luminance" => Luminance,
        /// Red.
        "red" => Red,
        /// Green.
        "green" => Green,
        /// Blue.
        "blue" => Blue,
        /// Alpha; 1 where the image has none.
        "alpha" => Alpha,
    }
}

words! {
    "trap";
    Trap {
        /// The middle.
        "origin" => Origin,
        /// The nearest axis.
        "axes" => Axes,
        /// The nearest plane on which a coordinate is 0.
        "planes" => Planes,
    }
}

words! {
    "distribution";
    Distribution {
        /// Trowbridge and Reitz (GGX): a narrow peak with a wide skirt.
        "ggx" => Ggx,
        /// Beckmann: a Gaussian of slopes.
        "beckmann" => Beckmann,
    }
}
