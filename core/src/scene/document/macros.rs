//! Owns the macros that make, from one definition, a type of the document, its decoder and its schema.

/// An object with a fixed set of fields.
///
/// `object! { "title"; /// docs pub struct Name { /// docs field: Type = rule; … } }`
///
/// `checked by path` after the name calls `path(&Name, &Cursor) -> bool` on the decoded value; it reports what
/// is wrong between fields. Its fields may also stand among those of another type, see `variants!`.
macro_rules! object {
    (
        $title:literal;
        $(#[doc = $doc:literal])+
        $(#[derive($($derive:ident),+)])?
        $vis:vis struct $name:ident $(checked by $check:path)? {
            $( $(#[doc = $field_doc:literal])+ $field:ident : $ty:ty = $rule:expr; )*
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, PartialEq $($(, $derive)+)?)]
        $vis struct $name {
            $( $(#[doc = $field_doc])+ pub $field: $ty, )*
        }

        impl $crate::scene::document::decode::Fields for $name {
            const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];

            fn decode_fields(at: &$crate::scene::document::cursor::Cursor<'_>) -> Option<Self> {
                $( let $field: Option<$ty> = at.field(stringify!($field), $rule); )*
                let value = Self { $( $field: $field?, )* };
                $( if !$check(&value, at) { return None; } )?
                Some(value)
            }

            fn add_fields(
                fields: &mut $crate::scene::document::schema::Fields,
                definitions: &mut $crate::scene::document::schema::Definitions,
            ) {
                $( fields.add::<$ty>(stringify!($field), concat!($($field_doc),+), &$rule, definitions); )*
            }

            fn show_fields(&self, fields: &mut serde_json::Map<String, serde_json::Value>) {
                $( fields.insert(
                    stringify!($field).to_owned(),
                    $crate::scene::document::decode::Decode::show(&self.$field),
                ); )*
                fields.retain(|_, value| !value.is_null());
            }
        }

        impl $crate::scene::document::decode::Decode for $name {
            fn decode(
                at: &$crate::scene::document::cursor::Cursor<'_>,
                _: &$crate::scene::document::rule::Allowed,
            ) -> Option<Self> {
                use $crate::scene::document::decode::Fields;
                if !at.is_object($title) {
                    return None;
                }
                at.only($title, Self::NAMES);
                Self::decode_fields(at)
            }

            fn expected(_: &$crate::scene::document::rule::Allowed) -> String {
                $crate::scene::document::cursor::an_object($title)
            }

            fn schema(
                _: &$crate::scene::document::rule::Allowed,
                definitions: &mut $crate::scene::document::schema::Definitions,
            ) -> serde_json::Value {
                use $crate::scene::document::decode::Fields;
                definitions.define($title, |definitions| {
                    let mut fields = $crate::scene::document::schema::Fields::new(concat!($($doc),+));
                    Self::add_fields(&mut fields, definitions);
                    fields.finish()
                })
            }

            fn show(&self) -> serde_json::Value {
                use $crate::scene::document::decode::Fields;
                let mut fields = serde_json::Map::new();
                self.show_fields(&mut fields);
                serde_json::Value::Object(fields)
            }
        }
    };
}

/// An object whose `"type"` chooses among variants, each with its own fields.
///
/// `variants! { "title"; /// docs pub enum Name { /// docs "type" => Variant { … } } }`
///
/// `checked by path` after a variant is as for `object!`.
///
/// `with Fields` after the name lets every variant have the fields of that `object!` type as well: whoever decodes the
/// variant decodes them too.
macro_rules! variants {
    (
        $title:literal;
        $(#[doc = $doc:literal])+
        $(#[derive($($derive:ident),+)])?
        $vis:vis enum $name:ident $(with $with:ty)? {
            $(
                $(#[doc = $variant_doc:literal])+
                $tag:literal => $variant:ident $(checked by $check:path)? {
                    $( $(#[doc = $field_doc:literal])+ $field:ident : $ty:ty = $rule:expr; )*
                }
            )+
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, PartialEq $($(, $derive)+)?)]
        $vis enum $name {
            $(
                $(#[doc = $variant_doc])+
                $variant { $( $(#[doc = $field_doc])+ $field: $ty, )* },
            )+
        }

        impl $crate::scene::document::decode::Decode for $name {
            fn decode(
                at: &$crate::scene::document::cursor::Cursor<'_>,
                _: &$crate::scene::document::rule::Allowed,
            ) -> Option<Self> {
                let more: &[&[&str]] = &[$(<$with as $crate::scene::document::decode::Fields>::NAMES)?];
                match at.tag($title, &[$($tag),+])? {
                    $(
                        $tag => {
                            at.only(concat!($tag, " ", $title), &[&["type" $(, stringify!($field))*][..], &more.concat()[..]].concat());
                            $( let $field: Option<$ty> = at.field(stringify!($field), $rule); )*
                            let value = Self::$variant { $( $field: $field?, )* };
                            $( if !$check(&value, at) { return None; } )?
                            Some(value)
                        }
                    )+
                    _ => None,
                }
            }

            fn expected(_: &$crate::scene::document::rule::Allowed) -> String {
                $crate::scene::document::cursor::an_object($title)
            }

            fn schema(
                _: &$crate::scene::document::rule::Allowed,
                definitions: &mut $crate::scene::document::schema::Definitions,
            ) -> serde_json::Value {
                fn add_more(
                    fields: &mut $crate::scene::document::schema::Fields,
                    definitions: &mut $crate::scene::document::schema::Definitions,
                ) {
                    $( <$with as $crate::scene::document::decode::Fields>::add_fields(fields, definitions); )?
                    // Used whether or not there are more.
                    let _ = (fields, definitions);
                }
                definitions.define($title, |definitions| {
                    let mut variants = Vec::new();
                    $(
                        let mut fields = $crate::scene::document::schema::Fields::new(concat!($($variant_doc),+));
                        fields.tag($tag);
                        $( fields.add::<$ty>(stringify!($field), concat!($($field_doc),+), &$rule, definitions); )*
                        add_more(&mut fields, definitions);
                        variants.push(fields.finish());
                    )+
                    $crate::scene::document::schema::one_of(concat!($($doc),+), &variants)
                })
            }

            fn show(&self) -> serde_json::Value {
                let mut fields = serde_json::Map::new();
                match self {
                    $(
                        Self::$variant { $( $field, )* } => {
                            fields.insert("type".to_owned(), serde_json::Value::from($tag));
                            $( fields.insert(
                                stringify!($field).to_owned(),
                                $crate::scene::document::decode::Decode::show($field),
                            ); )*
                        }
                    )+
                }
                fields.retain(|_, value| !value.is_null());
                serde_json::Value::Object(fields)
            }
        }
    };
}

/// An enum, declared elsewhere, that the document says by one of a few words.
///
/// `words! { "title"; Name { /// docs "word" => Variant, … } }`
macro_rules! words {
    (
        $title:literal;
        $name:ty {
            $( $(#[doc = $word_doc:literal])+ $word:literal => $variant:ident, )+
        }
    ) => {
        impl $crate::scene::document::decode::Decode for $name {
            fn decode(
                at: &$crate::scene::document::cursor::Cursor<'_>,
                allowed: &$crate::scene::document::rule::Allowed,
            ) -> Option<Self> {
                use $crate::scene::document::tree::Value;
                let Value::Text(found) = &at.node.value else {
                    at.expected(&Self::expected(allowed));
                    return None;
                };
                match found.as_str() {
                    $( $word => Some(Self::$variant), )+
                    other => {
                        let hint = at.context.nearest(other, [$($word),+]).map(|word| format!("did you mean {word:?}?"));
                        at.problem(format!("found {}, expected {}", at.found(), Self::expected(allowed)), hint);
                        None
                    }
                }
            }

            fn expected(_: &$crate::scene::document::rule::Allowed) -> String {
                [$(concat!("\"", $word, "\"")),+].join(" or ")
            }

            fn schema(
                _: &$crate::scene::document::rule::Allowed,
                definitions: &mut $crate::scene::document::schema::Definitions,
            ) -> serde_json::Value {
                definitions.define($title, |_| {
                    let words = vec![
                        $( serde_json::json!({"const": $word, "description": concat!($($word_doc),+).trim()}) ),+
                    ];
                    serde_json::json!({"oneOf": words})
                })
            }

            fn show(&self) -> serde_json::Value {
                match self {
                    $( Self::$variant => serde_json::Value::from($word), )+
                }
            }
        }
    };
}

pub(super) use {object, variants, words};
