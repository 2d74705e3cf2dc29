//! Owns placements: the three ways to write one, and the affine map they stand for.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Value as Json, json};

use crate::scene::document::cursor::Cursor;
use crate::scene::document::decode::Decode;
use crate::scene::document::macros::object;
use crate::scene::document::rule::{Allowed, or, required};
use crate::scene::document::schema::Definitions;
use crate::scene::document::tree::Value;

object! {
    "look_at";
    /// An eye that looks at a target: −z of the local frame points from `eye` to `target`, and y lies in the
    /// plane of −z and `up`.
    pub struct LookAt checked by has_direction {
        /// Where the local origin is, in world units.
        eye: DVec3 = required();
        /// A point on the line of sight, in world units; not the eye.
        target: DVec3 = required();
        /// Direction that is up, of any length; not along the line of sight.
        up: DVec3 = or(DVec3::Y);
    }
}

object! {
    "transform components";
    /// Scale first, then rotation, then translation; each may be left out.
    #[derive(Copy)]
    pub struct Components {
        /// Translation, in units of the parent.
        translate: DVec3 = or(DVec3::ZERO);
        /// Rotations about x, y and z, in degrees, applied in this order.
        rotate: DVec3 = or(DVec3::ZERO);
        /// One factor for all directions, or factors along x, y and z.
        scale: Scale = or(Scale(DVec3::ONE)).nonzero();
    }
}

object! {
    "transform by matrix";
    /// The matrix itself.
    struct MatrixForm {
        /// Four rows of four numbers, for column vectors: translation in the last column, last row `[0, 0, 0, 1]`.
        matrix: Rows = required();
    }
}

object! {
    "transform by look_at";
    /// An eye and what it looks at.
    struct LookAtForm {
        /// The eye and what it looks at.
        look_at: LookAt = required();
    }
}

/// Factors along x, y and z, none of them 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale(pub DVec3);

/// Rows of a matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rows([[f64; 4]; 4]);

impl Components {
    /// The affine map: scale, then rotate about x, y, z, then translate.
    pub fn affine(&self) -> DAffine3 {
        let [x, y, z] = self.rotate.to_array().map(f64::to_radians);
        let turn = DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x);
        DAffine3::from_scale_rotation_translation(self.scale.0, turn, self.translate)
    }
}

impl LookAt {
    /// The rigid map whose −z looks from eye to target; `None` when the points give no direction.
    pub fn affine(&self) -> Option<DAffine3> {
        let z = (self.eye - self.target).try_normalize()?;
        let x = self.up.try_normalize()?.cross(z);
        // Below this the cross product is rounding error.
        let x = (x.length() > 1.0e-12).then(|| x.normalize())?;
        Some(DAffine3 { matrix3: DMat3::from_cols(x, z.cross(x), z), translation: self.eye })
    }
}

fn has_direction(look: &LookAt, at: &Cursor<'_>) -> bool {
    let ok = look.affine().is_some();
    if !ok {
        at.problem(
            "found no direction: \"eye\" and \"target\" coincide, or \"up\" is along the line of sight",
            Some("move \"target\", or give another \"up\" such as [0, 0, 1]".to_owned()),
        );
    }
    ok
}

impl Decode for Scale {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        if let Value::List(_) = at.node.value {
            return DVec3::decode(at, allowed).map(Self);
        }
        if let Value::Number(_) = at.node.value {
            return f64::decode(at, allowed).map(|factor| Self(DVec3::splat(factor)));
        }
        at.expected(&Self::expected(allowed));
        None
    }

    fn expected(allowed: &Allowed) -> String {
        format!("{} or a list of 3 numbers", allowed.words("a number"))
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        json!({"anyOf": [f64::schema(allowed, definitions), DVec3::schema(allowed, definitions)]})
    }

    fn show(&self) -> Json {
        if self.0 == DVec3::splat(self.0.x) { self.0.x.show() } else { self.0.show() }
    }
}

impl Decode for Rows {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let mut rows = [[0.0; 4]; 4];
        let shape = |value: &Value| matches!(value, Value::List(items) if items.len() == 4);
        let Value::List(found) = &at.node.value else {
            at.expected(&Self::expected(allowed));
            return None;
        };
        if !shape(&at.node.value) || !found.iter().all(|row| shape(&row.value)) {
            at.expected(&Self::expected(allowed));
            return None;
        }
        let mut complete = true;
        for (row, found_row) in found.iter().enumerate() {
            let Value::List(numbers) = &found_row.value else { continue };
            for (column, found_number) in numbers.iter().enumerate() {
                let row_at = at.element(row, found_row);
                match f64::decode(&row_at.element(column, found_number), allowed) {
                    Some(number) => rows[row][column] = number,
                    None => complete = false,
                }
            }
        }
        if complete && rows[3] != [0.0, 0.0, 0.0, 1.0] {
            at.element(3, &found[3]).problem("found another last row than [0, 0, 0, 1]", None);
            return None;
        }
        complete.then_some(Self(rows))
    }

    fn expected(_: &Allowed) -> String {
        "a list of 4 rows, each a list of 4 numbers".to_owned()
    }

    fn schema(_: &Allowed, _: &mut Definitions) -> Json {
        let list = |items: Json| json!({"type": "array", "items": items, "minItems": 4, "maxItems": 4});
        list(list(json!({"type": "number"})))
    }

    fn show(&self) -> Json {
        json!(self.0)
    }
}

/// The affine map of a matrix whose last row is `[0, 0, 0, 1]`.
pub(in crate::scene::document) fn from_rows(rows: &[[f64; 4]; 4]) -> DAffine3 {
    let column = |index: usize| DVec3::new(rows[0][index], rows[1][index], rows[2][index]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// The rows of an affine map.
pub(in crate::scene::document) fn to_rows(map: &DAffine3) -> [[f64; 4]; 4] {
    let row = |index: usize| {
        let m = map.matrix3.row(index);
        [m.x, m.y, m.z, map.translation[index]]
    };
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// Whether a map has a finite inverse.
fn is_invertible(map: &DAffine3) -> bool {
    map.is_finite() && map.matrix3.determinant() != 0.0 && map.inverse().is_finite()
}

impl Decode for DAffine3 {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let map = if at.node.get("matrix").is_some() {
            from_rows(&MatrixForm::decode(at, allowed)?.matrix.0)
        } else if at.node.get("look_at").is_some() {
            LookAtForm::decode(at, allowed)?.look_at.affine()?
        } else {
            Components::decode(at, allowed)?.affine()
        };
        if !is_invertible(&map) {
            let hint = "a transform must not flatten or blow up what it places".to_owned();
            at.problem("found a singular transform, expected one with an inverse", Some(hint));
            return None;
        }
        Some(map)
    }

    fn expected(_: &Allowed) -> String {
        "a transform object".to_owned()
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        definitions.define("transform", |definitions| {
            let forms = [
                Components::schema(allowed, definitions),
                LookAtForm::schema(allowed, definitions),
                MatrixForm::schema(allowed, definitions),
            ];
            json!({
                "description": "Places something: an invertible map from its own frame to the world's, \
                    written in one of three ways.",
                "anyOf": forms,
            })
        })
    }

    fn show(&self) -> Json {
        if *self == Self::IDENTITY { json!({}) } else { json!({"matrix": to_rows(self)}) }
    }
}
