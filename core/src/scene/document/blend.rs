//! Owns linear interpolation between two values of a track.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::scene::document::description::{from_rows, to_rows};
use crate::scene::document::tree::{Member, Node, Value};

/// Why there is no way from one value to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mismatch {
    Shape,
    Sheared,
    Mirrored,
}

impl Mismatch {
    /// What was found, in words.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Shape => "a value of another shape than that of the key before",
            Self::Sheared => "a sheared or singular matrix, which cannot be interpolated",
            Self::Mirrored => "a mirrored matrix next to one that is not",
        }
    }
}

/// Cosine between axes above which a matrix counts as sheared.
const SHEAR: f64 = 1.0e-6;

/// Whether there is a way from `a` to `b`; `name` is the name of the field that holds them.
pub(super) fn blendable(a: &Node, b: &Node, name: &str) -> Result<(), Mismatch> {
    match (&a.value, &b.value) {
        (Value::Number(_), Value::Number(_)) => Ok(()),
        (Value::List(a), Value::List(b)) if name == "matrix" => {
            // What is no matrix is reported where the matrix is decoded.
            let (Some(a), Some(b)) = (rows(a), rows(b)) else { return Ok(()) };
            let (a, b) = (Parts::of(&a)?, Parts::of(&b)?);
            if (a.scale.x < 0.0) == (b.scale.x < 0.0) { Ok(()) } else { Err(Mismatch::Mirrored) }
        }
        (Value::List(a), Value::List(b)) if a.len() == b.len() => {
            a.iter().zip(b).try_for_each(|(a, b)| blendable(a, b, ""))
        }
        (Value::Object(a), Value::Object(members)) if a.len() == members.len() => {
            a.iter().try_for_each(|from| {
                blendable(&from.node, b.get(&from.name).ok_or(Mismatch::Shape)?, &from.name)
            })
        }
        _ => Err(Mismatch::Shape),
    }
}

/// The value a share `t` of the way from `a` to `b`, which are [`blendable`].
pub(super) fn blend(a: &Node, b: &Node, t: f64, name: &str) -> Node {
    let value = match (&a.value, &b.value) {
        (Value::Number(a), Value::Number(b)) => Value::Number(mix(*a, *b, t)),
        (Value::List(from), Value::List(to)) => match (name, rows(from), rows(to)) {
            ("matrix", Some(from), Some(to)) => return blend_matrix(a, &from, &to, t),
            _ => Value::List(from.iter().zip(to).map(|(a, b)| blend(a, b, t, "")).collect()),
        },
        (Value::Object(members), Value::Object(_)) => Value::Object(
            members
                .iter()
                .map(|from| {
                    let to = b.get(&from.name).unwrap_or(&from.node);
                    Member { node: blend(&from.node, to, t, &from.name), ..from.clone() }
                })
                .collect(),
        ),
        _ => a.value.clone(),
    };
    Node { start: a.start, end: a.end, blended: true, value }
}

/// Exact at both ends and for equal values, finite for finite values.
fn mix(a: f64, b: f64, t: f64) -> f64 {
    if a == b { a } else { a * (1.0 - t) + b * t }
}

fn rows(list: &[Node]) -> Option<[[f64; 4]; 4]> {
    let mut rows = [[0.0; 4]; 4];
    if list.len() != 4 {
        return None;
    }
    for (row, node) in rows.iter_mut().zip(list) {
        let Value::List(numbers) = &node.value else { return None };
        if numbers.len() != 4 {
            return None;
        }
        for (number, node) in row.iter_mut().zip(numbers) {
            let Value::Number(found) = node.value else { return None };
            *number = found;
        }
    }
    Some(rows)
}

fn blend_matrix(place: &Node, a: &[[f64; 4]; 4], b: &[[f64; 4]; 4], t: f64) -> Node {
    let (Ok(a), Ok(b)) = (Parts::of(a), Parts::of(b)) else { return place.clone() };
    let mixed = Parts {
        scale: mix_vectors(a.scale, b.scale, t),
        turn: a.turn.slerp(b.turn, t),
        translation: mix_vectors(a.translation, b.translation, t),
    };
    let made = |value: Value| Node { start: place.start, end: place.end, blended: true, value };
    let row = |row: [f64; 4]| made(Value::List(row.map(|number| made(Value::Number(number))).to_vec()));
    made(Value::List(to_rows(&mixed.affine()).map(row).to_vec()))
}

fn mix_vectors(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    DVec3::new(mix(a.x, b.x, t), mix(a.y, b.y, t), mix(a.z, b.z, t))
}

/// An affine map taken apart: scale, then turn, then translate. A mirroring map has a negative scale along x.
#[derive(Debug, Clone, Copy)]
struct Parts {
    scale: DVec3,
    turn: DQuat,
    translation: DVec3,
}

impl Parts {
    fn of(rows: &[[f64; 4]; 4]) -> Result<Self, Mismatch> {
        let map = from_rows(rows);
        let m = map.matrix3;
        let mut scale = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
        if m.determinant() < 0.0 {
            scale.x = -scale.x;
        }
        let axes = DMat3::from_cols(m.x_axis / scale.x, m.y_axis / scale.y, m.z_axis / scale.z);
        let cosines =
            [axes.x_axis.dot(axes.y_axis), axes.y_axis.dot(axes.z_axis), axes.z_axis.dot(axes.x_axis)];
        // Written so that a NaN, from a scale of 0, counts as sheared.
        if !cosines.into_iter().all(|cosine| cosine.abs() <= SHEAR) {
            return Err(Mismatch::Sheared);
        }
        Ok(Self { scale, turn: DQuat::from_mat3(&axes).normalize(), translation: map.translation })
    }

    fn affine(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.turn, self.translation)
    }
}
