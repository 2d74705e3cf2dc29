//! Owns what a field of the document may be: its default and its range, in numbers and in words.

use crate::scene::document::asset::AssetKind;

/// What a field may be.
#[derive(Debug)]
pub(super) struct Rule<T> {
    /// The value of a field that is not there; `None` when it has to be there.
    pub(super) default: Option<T>,
    pub(super) allowed: Allowed,
}

/// The allowed values of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is one word of the rule and independent of the others"
)]
pub(super) struct Allowed {
    /// Least number, least component of a vector, or least number of entries.
    pub(super) min: f64,
    /// Greatest number or component.
    pub(super) max: f64,
    /// Whether `min` itself is left out.
    pub(super) above: bool,
    /// Whether `max` itself is left out.
    pub(super) below: bool,
    /// Whether 0 is left out.
    pub(super) nonzero: bool,
    /// Whether `"auto"` stands for no value.
    pub(super) auto: bool,
    /// What a string means.
    pub(super) meaning: Meaning,
}

/// What a string, or a name in a table, means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// Nothing more than itself.
    Word,
    /// The name of an entry of a table.
    NameIn(Table),
    /// A file beside the document.
    File(AssetKind),
    /// A path in the document.
    Path,
}

/// A table of named things that others refer to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Table {
    Materials,
    Meshes,
    Media,
}

impl Table {
    /// The field of the document that holds the table.
    pub(super) const fn field(self) -> &'static str {
        match self {
            Self::Materials => "materials",
            Self::Meshes => "meshes",
            Self::Media => "media",
        }
    }

    /// What one entry is.
    pub(super) const fn entry(self) -> &'static str {
        match self {
            Self::Materials => "material",
            Self::Meshes => "mesh",
            Self::Media => "medium",
        }
    }
}

impl Allowed {
    /// Every finite number, every string.
    pub(super) const ANY: Self = Self {
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        above: false,
        below: false,
        nonzero: false,
        auto: false,
        meaning: Meaning::Word,
    };

    /// Whether a number is allowed.
    pub(super) fn holds(&self, number: f64) -> bool {
        let low = if self.above { number > self.min } else { number >= self.min };
        let high = if self.below { number < self.max } else { number <= self.max };
        number.is_finite() && low && high && !(self.nonzero && number == 0.0)
    }

    /// Whether a number is what single precision makes of a limit that is allowed itself.
    pub(super) fn ends_at(&self, number: f32) -> bool {
        let is_end = |is_allowed: bool, end: f64| is_allowed && end.is_finite() && number == end as f32;
        is_end(!self.above, self.min) || is_end(!self.below, self.max)
    }

    /// `what` and its range in words, such as `a number above 0`.
    pub(super) fn words(&self, what: &str) -> String {
        let low = self.min.is_finite().then_some(if self.above { "above" } else { "of at least" });
        let high = self.max.is_finite().then_some(if self.below { "below" } else { "of at most" });
        let or_auto = if self.auto { " or \"auto\"" } else { "" };
        let other = if self.nonzero { " other than 0" } else { "" };
        let (min, max) = (short(self.min), short(self.max));
        let range = match (low, high) {
            (None, None) => String::new(),
            (Some("of at least"), Some("of at most")) => format!(" from {min} to {max}"),
            (Some(low), None) => format!(" {low} {min}"),
            (None, Some(high)) => format!(" {high} {max}"),
            (Some(low), Some(high)) => format!(" {low} {min} and {high} {max}"),
        };
        format!("{what}{range}{other}{or_auto}")
    }
}

/// A number in few characters: 65536, but 1e-12.
pub(super) fn short(number: f64) -> String {
    let plain = number == 0.0 || (1.0e-4..1.0e10).contains(&number.abs());
    if plain { number.to_string() } else { format!("{number:e}") }
}

impl<T> Rule<T> {
    const fn new(default: Option<T>) -> Self {
        Self { default, allowed: Allowed::ANY }
    }

    /// Numbers from `min` on; for tables and lists, at least that many entries.
    pub(super) fn from(mut self, min: f64) -> Self {
        (self.allowed.min, self.allowed.above) = (min, false);
        self
    }

    /// Numbers greater than `min`.
    pub(super) fn above(mut self, min: f64) -> Self {
        (self.allowed.min, self.allowed.above) = (min, true);
        self
    }

    /// Numbers up to `max`.
    pub(super) fn to(mut self, max: f64) -> Self {
        (self.allowed.max, self.allowed.below) = (max, false);
        self
    }

    /// Numbers less than `max`.
    pub(super) fn below(mut self, max: f64) -> Self {
        (self.allowed.max, self.allowed.below) = (max, true);
        self
    }

    /// Numbers other than 0.
    pub(super) fn nonzero(mut self) -> Self {
        self.allowed.nonzero = true;
        self
    }

    /// A string that names an entry of a table.
    pub(super) fn naming(mut self, table: Table) -> Self {
        self.allowed.meaning = Meaning::NameIn(table);
        self
    }

    /// A string that is the path of an asset file.
    pub(super) fn file(mut self, kind: AssetKind) -> Self {
        self.allowed.meaning = Meaning::File(kind);
        self
    }

    /// A table whose names are paths in the document.
    pub(super) fn paths(mut self) -> Self {
        self.allowed.meaning = Meaning::Path;
        self
    }
}

/// A field that has to be there.
pub(super) const fn required<T>() -> Rule<T> {
    Rule::new(None)
}

/// A field that stands for `default` when it is not there.
pub(super) const fn or<T>(default: T) -> Rule<T> {
    Rule::new(Some(default))
}

/// A field that may be left out.
pub(super) const fn optional<T>() -> Rule<Option<T>> {
    Rule::new(Some(None))
}

/// A field that may be left out or be `"auto"`.
pub(super) const fn auto<T>() -> Rule<Option<T>> {
    let mut rule = Rule::new(Some(None));
    rule.allowed.auto = true;
    rule
}
