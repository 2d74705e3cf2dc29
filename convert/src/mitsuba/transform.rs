//! Owns transforms: operations in the order in which they are written.

use glam::{DAffine2, DAffine3, DMat2, DMat3, DMat4, DVec2, DVec3, DVec4};

use super::value::{number, numbers, triple};
use super::xml::Attributes;

/// The matrix of the operation `tag`; `legacy` before version 2.
pub(super) fn operation(tag: &str, attributes: &Attributes, legacy: bool) -> Result<DMat4, String> {
    let need = |name: &str| attributes.get(name).ok_or(format!("found <{tag}> without {name:?}"));
    match tag {
        "translate" => xyz(attributes, 0.0).map(DMat4::from_translation),
        "scale" => xyz(attributes, 1.0).map(DMat4::from_scale),
        "rotate" => rotate(xyz(attributes, 0.0)?, number(need("angle")?)?),
        "lookat" | "lookAt" => look_at(need("origin")?, need("target")?, attributes.get("up"), legacy),
        "matrix" => matrix(need("value")?),
        other => Err(format!("found <{other}>, expected translate, rotate, scale, lookat or matrix")),
    }
}

/// `value`, or `x`, `y` and `z` with a default for what is left out.
pub(super) fn xyz(attributes: &Attributes, default: f64) -> Result<DVec3, String> {
    if let Some(value) = attributes.get("value") {
        return triple(value).map(DVec3::from_array);
    }
    let part = |name: &str| attributes.get(name).map_or(Ok(default), number);
    Ok(DVec3::new(part("x")?, part("y")?, part("z")?))
}

fn rotate(axis: DVec3, degrees: f64) -> Result<DMat4, String> {
    let axis =
        axis.try_normalize().ok_or("found a rotation about no axis, expected x, y or z other than 0")?;
    Ok(DMat4::from_axis_angle(axis, degrees.to_radians()))
}

/// z of the local frame points from the origin to the target, and y lies in the plane of z and up.
fn look_at(origin: &str, target: &str, up: Option<&str>, legacy: bool) -> Result<DMat4, String> {
    let [origin, target] = [origin, target].map(|text| triple(text).map(DVec3::from_array));
    let (origin, target) = (origin?, target?);
    let z = (target - origin)
        .try_normalize()
        .ok_or("found a target that is the origin, expected another point")?;
    let up = up.map_or(Ok([0.0; 3]), triple).map(DVec3::from_array)?;
    let up = if up == DVec3::ZERO { some_up(z, legacy) } else { up };
    let x = up.cross(z).normalize_or_zero();
    if x == DVec3::ZERO {
        return Err("found an up along the line of sight, expected another direction".to_owned());
    }
    let y = z.cross(x);
    Ok(DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), origin.extend(1.0)))
}

/// The up of a look along z that says none: the first of the two directions that Mitsuba puts beside it.
fn some_up(z: DVec3, legacy: bool) -> DVec3 {
    if !legacy {
        return tangents(z).0;
    }
    let beside = if z.x.abs() > z.y.abs() { DVec3::new(z.z, 0.0, -z.x) } else { DVec3::new(0.0, z.z, -z.y) };
    beside.normalize().cross(z)
}

/// Two directions that make a right-handed frame with a unit vector (Duff et al. 2017).
pub(super) fn tangents(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Rows of a 4×4 matrix, or of a 3×3 matrix that becomes its upper left part.
fn matrix(text: &str) -> Result<DMat4, String> {
    let found = numbers(text)?;
    let rows = match found.len() {
        16 => DMat4::from_cols_slice(&found).transpose(),
        9 => DMat4::from_mat3(DMat3::from_cols_slice(&found).transpose()),
        count => return Err(format!("found a matrix of {count} numbers, expected 16 or 9")),
    };
    if rows.row(3) != DVec4::W {
        return Err(format!("found {} as the last row of a matrix, expected 0 0 0 1", rows.row(3)));
    }
    Ok(rows)
}

/// A transform of space.
pub(super) fn affine(matrix: &DMat4) -> DAffine3 {
    DAffine3::from_mat4(*matrix)
}

/// A transform of texture coordinates: what the matrix does to u and v. Its translation is in the last column; a 3×3
/// matrix has it in the third.
pub(super) fn affine_uv(matrix: &DMat4) -> DAffine2 {
    let [x, y] = [matrix.x_axis, matrix.y_axis].map(|column| DVec2::new(column.x, column.y));
    let shift = matrix.w_axis + matrix.z_axis;
    DAffine2 { matrix2: DMat2::from_cols(x, y), translation: DVec2::new(shift.x, shift.y) }
}

/// Whether a map keeps shapes: it turns, mirrors and scales evenly. Gives the factor.
pub(super) fn similarity(map: &DAffine3) -> Option<f64> {
    let m = map.matrix3;
    let scale = m.x_axis.length();
    let tolerance = 1.0e-5 * scale * scale;
    let even =
        [m.y_axis, m.z_axis].iter().all(|axis| (axis.length_squared() - scale * scale).abs() <= tolerance);
    let square = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)];
    (even && scale > 0.0 && square.iter().all(|dot| dot.abs() <= tolerance)).then_some(scale)
}

#[cfg(test)]
mod tests {
    use super::{affine, affine_uv, operation, similarity, tangents};
    use crate::mitsuba::xml::parse;
    use glam::{DMat4, DVec2, DVec3};

    fn whole(text: &str) -> Result<DMat4, String> {
        read(text, false)
    }

    fn read(text: &str, legacy: bool) -> Result<DMat4, String> {
        let root = parse(&format!("<transform>{text}</transform>"), &"a.xml".into()).unwrap();
        root.children.iter().try_fold(DMat4::IDENTITY, |before, child| {
            Ok(operation(&child.tag, &child.attributes, legacy)? * before)
        })
    }

    fn maps(text: &str, from: [f64; 3], to: [f64; 3]) {
        let found = whole(text).unwrap().transform_point3(DVec3::from_array(from));
        assert!((found - DVec3::from_array(to)).length() < 1e-12, "{text}: {found}");
    }

    #[test]
    fn operations_apply_in_the_order_in_which_they_stand() {
        maps("<translate x='1'/><scale value='2'/>", [1.0, 0.0, 0.0], [4.0, 0.0, 0.0]);
        maps("<scale value='2'/><translate x='1'/>", [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]);
        maps("<scale x='2' y='3'/>", [1.0, 1.0, 1.0], [2.0, 3.0, 1.0]);
        maps("<rotate z='1' angle='90'/><translate value='0, 0, 5'/>", [1.0, 0.0, 0.0], [0.0, 1.0, 5.0]);
        maps("<rotate value='0 0 7' angle='90'/>", [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        maps("<matrix value='1 2 3 4 5 6 7 8 9 10 11 12 0 0 0 1'/>", [1.0, 0.0, 1.0], [8.0, 20.0, 32.0]);
        maps("<matrix value='0 1 0 1 0 0 0 0 1'/>", [1.0, 2.0, 3.0], [2.0, 1.0, 3.0]);
    }

    #[test]
    fn a_look_looks_along_z() {
        let look = "<lookat origin='1 2 3' target='1, 2, 7' up='0 1 0'/>";
        maps(look, [0.0, 0.0, 1.0], [1.0, 2.0, 4.0]);
        maps(look, [0.0, 1.0, 0.0], [1.0, 3.0, 3.0]);
        maps(look, [1.0, 0.0, 0.0], [2.0, 2.0, 3.0]);
        maps("<lookAt origin='0 0 0' target='0 -2 0'/>", [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]);
    }

    #[test]
    fn a_look_without_up_has_that_of_its_version() {
        for (target, new, old) in [
            ("0 0 5", [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
            ("5 0 0", [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]),
            ("0 -5 0", [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ] {
            for (legacy, up) in [(false, new), (true, old)] {
                for rest in ["", "up='0 0 0'"] {
                    let text = format!("<lookat origin='0 0 0' target='{target}' {rest}/>");
                    let found = read(&text, legacy).unwrap().transform_vector3(DVec3::Y);
                    assert!((found - DVec3::from_array(up)).length() < 1e-12, "{text} {legacy}: {found}");
                }
            }
        }
    }

    #[test]
    fn senseless_operations_are_refused() {
        for (text, expected) in [
            ("<rotate angle='9'/>", "found a rotation about no axis"),
            ("<rotate x='1'/>", "found <rotate> without \"angle\""),
            ("<lookat origin='0 0 0' target='0 0 0'/>", "found a target that is the origin"),
            ("<lookat origin='0 0 0' target='0 0 1' up='0 0 2'/>", "found an up along"),
            ("<matrix value='1 2 3'/>", "found a matrix of 3 numbers"),
            ("<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0'/>", "found [0, 0, 1, 0] as the last row"),
            ("<translate x='a'/>", "found \"a\", expected a number"),
            ("<shear x='1'/>", "found <shear>"),
        ] {
            let error = whole(text).unwrap_err();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
    }

    #[test]
    fn tangents_make_a_right_handed_frame() {
        for n in [
            DVec3::Z,
            DVec3::NEG_Z,
            DVec3::X,
            DVec3::new(1.0, -2.0, 3.0).normalize(),
            DVec3::new(0.3, 0.5, -0.9).normalize(),
        ] {
            let (s, t) = tangents(n);
            assert!((s.cross(t) - n).length() < 1e-12 && s.dot(t).abs() < 1e-12, "{n}");
        }
    }

    #[test]
    fn texture_transforms_have_their_translation() {
        let uv = |text: &str| affine_uv(&whole(text).unwrap()).transform_point2(DVec2::new(1.0, 2.0));
        assert_eq!(uv("<scale x='8' y='4'/><translate x='0.5' y='1'/>"), DVec2::new(8.5, 9.0));
        assert_eq!(uv("<matrix value='2 0 3 0 1 4 0 0 1'/>"), DVec2::new(5.0, 6.0));
    }

    #[test]
    fn similarities_are_told_from_other_maps() {
        let scale = |text: &str| similarity(&affine(&whole(text).unwrap()));
        assert!((scale("<rotate y='1' angle='33'/><scale value='-3'/>").unwrap() - 3.0).abs() < 1e-12);
        assert_eq!(scale("<scale x='2'/>"), None);
        assert_eq!(scale("<matrix value='1 1 0 0 1 0 0 0 1'/>"), None);
        assert_eq!(scale("<scale value='0'/>"), None);
    }
}
