//! Owns the checkerboard: two by two fields in the unit square, repeated.

use glam::{Affine2, Vec2, Vec3};

/// Two colours in squares of half a unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checkerboard {
    /// Linear Rec.709; the first from the corner (0, 0) to (0.5, 0.5), where both halves are equal, the second beside.
    pub colors: [Vec3; 2],
    /// Maps the surface's uv to that of the board.
    pub transform: Affine2,
}

impl Checkerboard {
    /// The colour at a texture coordinate of the surface.
    pub(super) fn color(&self, uv: Vec2) -> Vec3 {
        let place = self.transform.transform_point2(uv);
        if !place.is_finite() {
            return Vec3::ZERO;
        }
        let part = place - place.floor();
        self.colors[usize::from((part.x < 0.5) != (part.y < 0.5))]
    }
}

#[cfg(test)]
mod tests {
    use super::Checkerboard;
    use glam::{Affine2, Vec2, Vec3};

    fn board(transform: Affine2) -> Checkerboard {
        Checkerboard { colors: [Vec3::X, Vec3::Y], transform }
    }

    #[test]
    fn fields_alternate_from_the_corner_in_all_directions() {
        let board = board(Affine2::IDENTITY);
        for (u, v, expected) in [
            (0.0, 0.0, Vec3::X),
            (0.25, 0.25, Vec3::X),
            (0.75, 0.75, Vec3::X),
            (0.75, 0.25, Vec3::Y),
            (0.25, 0.75, Vec3::Y),
            (0.5, 0.25, Vec3::Y),
            (0.25, 0.5, Vec3::Y),
            (0.5, 0.5, Vec3::X),
            (1.0, 0.0, Vec3::X),
            (-0.25, 0.25, Vec3::Y),
            (-0.25, -0.25, Vec3::X),
            (-0.75, 0.25, Vec3::X),
            (7.75, -3.75, Vec3::Y),
        ] {
            assert_eq!(board.color(Vec2::new(u, v)), expected, "({u}, {v})");
        }
    }

    #[test]
    fn the_transform_maps_the_surface_to_the_board() {
        // Twice as many fields, then moved by one field along u.
        let board = board(Affine2::from_scale_angle_translation(Vec2::splat(2.0), 0.0, Vec2::new(0.5, 0.0)));
        assert_eq!(board.color(Vec2::new(0.1, 0.1)), Vec3::Y);
        assert_eq!(board.color(Vec2::new(0.3, 0.1)), Vec3::X);
        assert_eq!(board.color(Vec2::new(0.3, 0.3)), Vec3::Y);
    }
}
