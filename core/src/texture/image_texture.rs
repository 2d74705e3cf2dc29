//! Owns the lookup of an image by uv: outside 0 to 1, and between texels.

use std::ops::{Add, Mul};
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};

use crate::color::luminance;
use crate::texture::{Channel, ColorSpace, Image, TextureFilter, Wrap};

/// An image over a surface: u to the right, v **upwards**, so that (0, 0) is the lower left corner of the image, as in
/// OBJ files. Texel centres lie at half integers.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageTexture {
    /// The texels.
    pub image: Arc<Image>,
    /// What the numbers in the file mean.
    pub color_space: ColorSpace,
    /// Which channel is taken where a number is asked for.
    pub channel: Channel,
    /// What lies outside 0 to 1.
    pub wrap: Wrap,
    /// What lies between texels.
    pub filter: TextureFilter,
    /// Maps the surface's uv to that of the image.
    pub transform: Affine2,
}

impl ImageTexture {
    /// Linear Rec.709 colour at a texture coordinate of the surface.
    pub(super) fn color(&self, uv: Vec2) -> Vec3 {
        self.lookup(uv, |x, y| self.image.texel(x, y, self.color_space)).unwrap_or(Vec3::ZERO)
    }

    /// The chosen channel at a texture coordinate of the surface.
    pub(super) fn number(&self, uv: Vec2) -> f32 {
        match self.channel {
            Channel::Luminance => luminance(self.color(uv)),
            Channel::Red => self.color(uv).x,
            Channel::Green => self.color(uv).y,
            Channel::Blue => self.color(uv).z,
            Channel::Alpha => self.lookup(uv, |x, y| self.image.alpha(x, y)).unwrap_or(0.0),
        }
    }

    /// What the filter makes of the texels around a coordinate; nothing where the coordinate is not finite.
    fn lookup<T>(&self, uv: Vec2, texel: impl Fn(u32, u32) -> T) -> Option<T>
    where
        T: Add<Output = T> + Mul<f32, Output = T>,
    {
        let place = self.transform.transform_point2(uv);
        if !place.is_finite() {
            return None;
        }
        let (u, v) = (inside(place.x, self.wrap), inside(place.y, self.wrap));
        let (width, height) = (self.image.width(), self.image.height());
        // Rows of the image run down, v upwards.
        let texel = |x: u32, up: u32| texel(x, height - 1 - up);
        Some(match self.filter {
            TextureFilter::Nearest => texel(nearest(u, width), nearest(v, height)),
            TextureFilter::Bilinear => {
                let (left, right, fx) = self.around(u, width);
                let (below, above, fy) = self.around(v, height);
                let row = |up: u32| texel(left, up) * (1.0 - fx) + texel(right, up) * fx;
                row(below) * (1.0 - fy) + row(above) * fy
            }
        })
    }

    /// The two texels of `size` around a coordinate from 0 to 1, and the weight of the second.
    fn around(&self, coordinate: f32, size: u32) -> (u32, u32, f32) {
        let position = coordinate * size as f32 - 0.5;
        let first = position.floor();
        (self.neighbour(first as i64, size), self.neighbour(first as i64 + 1, size), position - first)
    }

    /// The texel that continues the image one step outside of it; beside a mirrored edge stands the same texel again.
    fn neighbour(&self, index: i64, size: u32) -> u32 {
        let size = i64::from(size);
        match self.wrap {
            // At most one step outside.
            Wrap::Repeat if index < 0 => (index + size) as u32,
            Wrap::Repeat if index >= size => (index - size) as u32,
            Wrap::Repeat => index as u32,
            Wrap::Mirror | Wrap::Clamp => index.clamp(0, size - 1) as u32,
        }
    }
}

/// The coordinate inside the image, 0 to 1, that a finite coordinate stands for.
fn inside(coordinate: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::Mirror => {
            let there_and_back = coordinate - 2.0 * (coordinate * 0.5).floor();
            if there_and_back > 1.0 { 2.0 - there_and_back } else { there_and_back }
        }
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
    }
}

/// The texel of `size` that a coordinate from 0 to 1 lies in; 1 belongs to the last.
fn nearest(coordinate: f32, size: u32) -> u32 {
    ((coordinate * size as f32) as u32).min(size - 1)
}

#[cfg(test)]
mod tests {
    use super::ImageTexture;
    use crate::texture::{Channel, ColorSpace, Image, TextureFilter, Wrap};
    use glam::{Affine2, Vec2, Vec3};
    use image::{DynamicImage, ImageBuffer, ImageFormat};
    use std::f32::consts::FRAC_PI_2;
    use std::io::Cursor;
    use std::sync::Arc;

    fn texture(image: impl Into<DynamicImage>) -> ImageTexture {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
        ImageTexture {
            image: Arc::new(Image::read(&bytes.into_inner(), 1 << 20).unwrap()),
            color_space: ColorSpace::Linear,
            channel: Channel::Luminance,
            wrap: Wrap::Repeat,
            filter: TextureFilter::Bilinear,
            transform: Affine2::IDENTITY,
        }
    }

    /// Two rows of four: 10 20 30 40 above 50 60 70 80, of 255.
    fn rows(wrap: Wrap, filter: TextureFilter) -> ImageTexture {
        let image = image::GrayImage::from_vec(4, 2, vec![10, 20, 30, 40, 50, 60, 70, 80]).unwrap();
        ImageTexture { wrap, filter, ..texture(image) }
    }

    fn check(texture: &ImageTexture, u: f32, v: f32, expected: f32) {
        let found = texture.color(Vec2::new(u, v)) * 255.0;
        assert!((found - expected).abs().max_element() < 1.0e-4, "({u}, {v}): {found}, expected {expected}");
    }

    #[test]
    fn the_nearest_texel_is_found_outside_too() {
        let inside = [(0.125, 0.25, 50.0), (0.875, 0.25, 80.0), (0.125, 0.75, 10.0), (0.3, 0.9, 20.0)];
        for (wrap, outside) in [
            (Wrap::Repeat, [(-0.125, 80.0), (-0.9, 50.0), (1.1, 50.0), (-1.0e-30, 80.0), (-5.0, 50.0)]),
            (Wrap::Mirror, [(-0.125, 50.0), (-0.9, 80.0), (1.1, 80.0), (-1.1, 80.0), (2.1, 50.0)]),
            (Wrap::Clamp, [(-0.125, 50.0), (-0.9, 50.0), (1.1, 80.0), (-1.0e9, 50.0), (1.0e9, 80.0)]),
        ] {
            let texture = rows(wrap, TextureFilter::Nearest);
            for (u, v, expected) in inside {
                check(&texture, u, v, expected);
            }
            for (u, expected) in outside {
                check(&texture, u, 0.25, expected);
            }
        }
        // Below the image, and above it.
        for (wrap, below, above) in
            [(Wrap::Repeat, 10.0, 50.0), (Wrap::Mirror, 50.0, 10.0), (Wrap::Clamp, 50.0, 10.0)]
        {
            let texture = rows(wrap, TextureFilter::Nearest);
            check(&texture, 0.125, -0.25, below);
            check(&texture, 0.125, 1.25, above);
        }
    }

    #[test]
    fn between_texels_values_change_linearly() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let texture = rows(wrap, TextureFilter::Bilinear);
            check(&texture, 0.375, 0.75, 20.0);
            check(&texture, 0.25, 0.25, 55.0);
            check(&texture, 0.125, 0.5, 30.0);
            // 0.7 between 50 and 60 is 57, between 10 and 20 is 17, and 0.7 from 57 to 17 is 29.
            check(&texture, 0.3, 0.6, 29.0);
        }
    }

    #[test]
    fn at_the_edges_the_neighbour_is_that_of_the_wrap() {
        let repeat = rows(Wrap::Repeat, TextureFilter::Bilinear);
        for (u, v, expected) in
            [(0.0, 0.25, 65.0), (1.0, 0.25, 65.0), (-3.0, 0.25, 65.0), (0.125, 0.0, 30.0), (0.125, 2.0, 30.0)]
        {
            check(&repeat, u, v, expected);
        }
        // A quarter of a texel beyond the middle of the last one.
        check(&repeat, 0.9375, 0.25, 72.5);
        for wrap in [Wrap::Mirror, Wrap::Clamp] {
            let texture = rows(wrap, TextureFilter::Bilinear);
            for (u, v, expected) in [
                (0.0, 0.25, 50.0),
                (1.0, 0.25, 80.0),
                (0.125, 0.0, 50.0),
                (0.125, 1.0, 10.0),
                (0.9375, 0.25, 80.0),
            ] {
                check(&texture, u, v, expected);
            }
        }
        let mirror = rows(Wrap::Mirror, TextureFilter::Bilinear);
        check(&mirror, 1.25, 0.25, 75.0);
        check(&mirror, -0.25, -0.5, 35.0);
        check(&rows(Wrap::Clamp, TextureFilter::Bilinear), 1.25, 0.25, 80.0);
    }

    #[test]
    fn uv_is_mapped_by_the_transform_from_the_left() {
        // Scaled, then turned by a quarter counter-clockwise, then moved: (u, v) becomes (0.8 - v, 2 u + 0.25).
        let transform =
            Affine2::from_scale_angle_translation(Vec2::new(2.0, 1.0), FRAC_PI_2, Vec2::new(0.8, 0.25));
        let texture = ImageTexture { transform, ..rows(Wrap::Repeat, TextureFilter::Nearest) };
        check(&texture, 0.0, 0.0, 80.0);
        check(&texture, 0.2, 0.0, 40.0);
        check(&texture, 0.0, 0.5, 60.0);
        check(&texture, 0.2, 0.5, 20.0);
        check(&texture, 0.4, 0.5, 60.0);
    }

    #[test]
    fn a_number_is_the_chosen_channel() {
        let image = ImageBuffer::<image::Rgba<u8>, _>::from_vec(1, 1, vec![51, 102, 204, 153]).unwrap();
        let color = Vec3::new(0.2, 0.4, 0.8);
        for (channel, expected) in [
            (Channel::Luminance, 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.8),
            (Channel::Red, 0.2),
            (Channel::Green, 0.4),
            (Channel::Blue, 0.8),
            (Channel::Alpha, 0.6),
        ] {
            let texture = ImageTexture { channel, ..texture(image.clone()) };
            let found = texture.number(Vec2::splat(0.3));
            assert!((found - expected).abs() < 1.0e-6, "{channel:?}: {found}, expected {expected}");
            assert!((texture.color(Vec2::ZERO) - color).abs().max_element() < 1.0e-6);
        }
        let opaque = image::GrayImage::from_vec(1, 1, vec![51]).unwrap();
        let opaque = ImageTexture { channel: Channel::Alpha, ..texture(opaque) };
        assert_eq!(opaque.number(Vec2::ZERO), 1.0);
    }

    #[test]
    fn light_is_mixed_and_not_its_code() {
        let image = image::GrayImage::from_vec(2, 1, vec![0, 255]).unwrap();
        let texture = ImageTexture { color_space: ColorSpace::Srgb, ..texture(image) };
        assert_eq!(texture.color(Vec2::new(0.5, 0.5)), Vec3::splat(0.5));
    }

    #[test]
    fn alpha_is_mixed_like_a_colour() {
        let image = ImageBuffer::<image::LumaA<u16>, _>::from_vec(2, 1, vec![9, 0, 9, 65535]).unwrap();
        let texture =
            ImageTexture { channel: Channel::Alpha, color_space: ColorSpace::Srgb, ..texture(image) };
        assert_eq!(texture.number(Vec2::new(0.375, 0.5)), 0.25);
    }
}
