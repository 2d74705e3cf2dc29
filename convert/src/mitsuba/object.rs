//! Owns the objects of a scene: plugins with their properties, and which of these somebody has asked for.

use std::cell::Cell;

use glam::{DMat4, DVec3};

use super::color::Color;
use super::place::Place;
use crate::ConvertError;

/// The value of a property.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Flag(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    Vector(DVec3),
    Color(Color),
    Transform(DMat4),
    /// Number of the object.
    Object(usize),
    /// The id of an object that has not been looked up yet.
    Reference(String),
}

impl Value {
    /// What it is, in words.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Flag(_) => "boolean",
            Self::Integer(_) => "integer",
            Self::Number(_) => "float",
            Self::Text(_) => "string",
            Self::Vector(_) => "point",
            Self::Color(_) => "colour",
            Self::Transform(_) => "transform",
            Self::Object(_) | Self::Reference(_) => "object",
        }
    }
}

/// A property of an object; those without a name are called "".
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) value: Value,
    /// Whether somebody has asked for it.
    pub(super) used: Cell<bool>,
}

/// A plugin with its properties.
#[derive(Debug)]
pub(super) struct Object {
    /// What it is: `bsdf`, `shape`, …
    pub(super) tag: String,
    /// Which one: `diffuse`, `sphere`, …
    pub(super) plugin: String,
    pub(super) id: Option<String>,
    pub(super) place: Place,
    pub(super) properties: Vec<Property>,
    /// Whether it has been converted: what is left unused of it is worth a note.
    pub(super) converted: Cell<bool>,
}

impl Object {
    /// What it is, for messages.
    pub(super) fn title(&self) -> String {
        format!("{} of type {:?}", self.tag, self.plugin)
    }

    /// The property of that name; of several the last one.
    pub(super) fn get(&self, name: &str) -> Option<&Property> {
        let mut found = None;
        for property in self.properties.iter().filter(|property| property.name == name) {
            property.used.set(true);
            found = Some(property);
        }
        found
    }

    /// Whether there is a property of that name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|property| property.name == name)
    }

    /// Takes note of properties that mean nothing for the picture.
    pub(super) fn ignore(&self, names: &[&str]) {
        for name in names {
            self.get(name);
        }
    }

    fn read<T>(
        &self,
        name: &str,
        expected: &str,
        take: impl Fn(&Value) -> Option<T>,
    ) -> Result<Option<T>, ConvertError> {
        let Some(property) = self.get(name) else { return Ok(None) };
        let wrong = || {
            let kind = property.value.kind();
            property
                .place
                .error(format!("found a {kind} as {name:?} of a {}, expected {expected}", self.title()))
        };
        take(&property.value).ok_or_else(wrong).map(Some)
    }

    /// A number.
    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, ConvertError> {
        self.read(name, "a number", number)
    }

    /// A number, or a default.
    pub(super) fn number_or(&self, name: &str, default: f64) -> Result<f64, ConvertError> {
        Ok(self.number(name)?.unwrap_or(default))
    }

    /// A whole number.
    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>, ConvertError> {
        self.read(name, "an integer", |value| {
            let whole = number(value).filter(|number| number.fract() == 0.0 && number.abs() < 9.0e15);
            if let Value::Integer(integer) = value {
                Some(*integer)
            } else {
                whole.map(|number| number as i64)
            }
        })
    }

    /// A whole number within a range, or a default.
    pub(super) fn count(&self, name: &str, default: u32, range: [u32; 2]) -> Result<u32, ConvertError> {
        let Some(found) = self.integer(name)? else { return Ok(default) };
        let [least, most] = range;
        u32::try_from(found).ok().filter(|count| (least..=most).contains(count)).ok_or_else(|| {
            let place = self.get(name).map_or(&self.place, |property| &property.place);
            place
                .error(format!("found {found} as {name:?} of a {}, expected {least} to {most}", self.title()))
        })
    }

    /// A truth value, or a default.
    pub(super) fn flag(&self, name: &str, default: bool) -> Result<bool, ConvertError> {
        let found =
            self.read(
                name,
                "a boolean",
                |value| {
                    if let Value::Flag(flag) = value { Some(*flag) } else { None }
                },
            )?;
        Ok(found.unwrap_or(default))
    }

    /// A word or a name.
    pub(super) fn text(&self, name: &str) -> Result<Option<&str>, ConvertError> {
        let Some(property) = self.get(name) else { return Ok(None) };
        let Value::Text(text) = &property.value else {
            let kind = property.value.kind();
            let message = format!("found a {kind} as {name:?} of a {}, expected a string", self.title());
            return Err(property.place.error(message));
        };
        Ok(Some(text))
    }

    /// A point or a vector.
    pub(super) fn vector(&self, name: &str) -> Result<Option<DVec3>, ConvertError> {
        self.read(
            name,
            "a point",
            |value| {
                if let Value::Vector(vector) = value { Some(*vector) } else { None }
            },
        )
    }

    /// A transform, or the identity.
    pub(super) fn transform(&self, name: &str) -> Result<DMat4, ConvertError> {
        let found = self.read(name, "a transform", |value| {
            if let Value::Transform(matrix) = value { Some(*matrix) } else { None }
        })?;
        Ok(found.unwrap_or(DMat4::IDENTITY))
    }

    /// The places and numbers of the objects in it, whatever they are called.
    pub(super) fn nested(&self) -> impl Iterator<Item = (&Property, usize)> {
        self.properties.iter().filter_map(|property| {
            if let Value::Object(index) = property.value { Some((property, index)) } else { None }
        })
    }
}

fn number(value: &Value) -> Option<f64> {
    if let Value::Number(number) | Value::Color(Color::Uniform(number)) = value {
        Some(*number)
    } else if let Value::Integer(integer) = value {
        Some(*integer as f64)
    } else {
        None
    }
}
