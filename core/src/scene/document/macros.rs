//! Owns the macros that make, from one definition, a type of the document, its decoder and its schema.

/// An object with a fixed set of fields.
///
/// `object! { "title"; /// docs pub struct Name { /// docs field: Type = rule; … } }`
macro_rules! object {
    (
        $title:literal;
        $(#[doc = $doc:literal])+
        $(#[derive($($derive:ident),+)])?
        $vis:vis struct $name:ident {
            $( $(#[doc = $field_doc:literal])+ $field:ident : $ty:ty = $rule:expr; )*
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, PartialEq $($(, $derive)+)?)]
        $vis struct $name {
            $( $(#[doc = $field_doc])+ pub $field: $ty, )*
        }
    };
}

/// An object whose `"type"` chooses among variants, each with its own fields.
///
/// `variants! { "title"; /// docs pub enum Name { /// docs "type" => Variant { … } } }`
macro_rules! variants {
    (
        $title:literal;
        $(#[doc = $doc:literal])+
        $vis:vis enum $name:ident {
            $(
                $(#[doc = $variant_doc:literal])+
                $tag:literal => $variant:ident {
                    $( $(#[doc = $field_doc:literal])+ $field:ident : $ty:ty = $rule:expr; )*
                }
            )+
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, PartialEq)]
        $vis enum $name {
            $(
                $(#[doc = $variant_doc])+
                $variant { $( $(#[doc = $field_doc])+ $field: $ty, )* },
            )+
        }
    };
}

pub(super) use {object, variants};
