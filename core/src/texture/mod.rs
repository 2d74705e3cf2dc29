//! Owns colours and numbers that vary over a surface.
//!
//! Every texture maps the surface's uv, or a solid one the place in the space of the object, by its transform first.
//! Textures are y-up: v = 0 is the bottom of an image.
//! Where a coordinate is not finite, before or after the transform, a texture is black and 0. Values are what the
//! texture holds: ending them at the range of a parameter is the caller's.

mod checkerboard;
mod fbm;
mod image;
mod image_texture;
mod place;
mod solid;

use std::sync::Arc;

use glam::{Vec2, Vec3};

pub use self::checkerboard::Checkerboard;
pub use self::fbm::Fbm;
pub use self::image::{Image, ImageError};
pub use self::image_texture::ImageTexture;
pub use self::place::Place;
pub use self::solid::{OrbitTrap, SolidCheckerboard, SolidFbm};

/// What the numbers in an image file mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorSpace {
    /// The sRGB curve: pictures.
    Srgb,
    /// Proportional to light: data.
    Linear,
}

/// What an image is outside 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    /// It repeats.
    Repeat,
    /// It repeats, every second copy mirrored.
    Mirror,
    /// The texels at the edge go on.
    Clamp,
}

/// What lies between texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextureFilter {
    /// Values change linearly.
    Bilinear,
    /// The value of the nearest texel.
    Nearest,
}

/// Which channel of an image is taken as a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Luminance of the colour.
    Luminance,
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// Alpha, 1 where there is none.
    Alpha,
}

/// A colour that varies over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Texture {
    /// The texels of a file.
    Image(ImageTexture),
    /// Two colours in squares.
    Checkerboard(Checkerboard),
    /// Fractal noise between two colours.
    Fbm(Fbm),
    /// Two colours in cubes.
    SolidCheckerboard(SolidCheckerboard),
    /// Fractal noise in space.
    SolidFbm(SolidFbm),
    /// Colours of orbits.
    OrbitTrap(OrbitTrap),
}

impl Texture {
    /// Linear Rec.709 colour at a point of the surface.
    pub fn color(&self, at: &Place) -> Vec3 {
        match self {
            Self::Image(image) => image.color(at.uv),
            Self::Checkerboard(board) => board.color(at.uv),
            Self::Fbm(fbm) => fbm.color(at.uv),
            Self::SolidCheckerboard(board) => board.color(at.solid),
            Self::SolidFbm(fbm) => fbm.color(at.solid),
            Self::OrbitTrap(trap) => trap.color(&at.traps),
        }
    }

    /// A number at a point of the surface: the chosen channel of an image, otherwise the luminance.
    pub fn number(&self, at: &Place) -> f32 {
        match self {
            Self::Image(image) => image.number(at.uv),
            Self::Checkerboard(_)
            | Self::Fbm(_)
            | Self::SolidCheckerboard(_)
            | Self::SolidFbm(_)
            | Self::OrbitTrap(_) => crate::color::luminance(self.color(at)),
        }
    }

    /// Whether it varies with the surface's uv, and so has a slope along them.
    pub fn is_over_uv(&self) -> bool {
        match self {
            Self::Image(_) | Self::Checkerboard(_) | Self::Fbm(_) => true,
            Self::SolidCheckerboard(_) | Self::SolidFbm(_) | Self::OrbitTrap(_) => false,
        }
    }
}

impl Texture {
    /// Distance in the surface's uv over which the texture changes little: half a texel, a fraction of the finest cell.
    fn detail(&self) -> f32 {
        let (detail, transform) = match self {
            Self::Image(t) => (0.5 / t.image.width().max(t.image.height()) as f32, t.transform),
            Self::Checkerboard(t) => (1.0 / 1024.0, t.transform),
            Self::Fbm(t) => {
                let finest = t.frequency * crate::math::powf(t.lacunarity, (t.octaves - 1) as f32);
                (0.125 / finest, t.transform)
            }
            Self::SolidCheckerboard(_) | Self::SolidFbm(_) | Self::OrbitTrap(_) => return 1.0,
        };
        let stretch = transform.matrix2.x_axis.length().max(transform.matrix2.y_axis.length());
        // Finer differences would be rounding error.
        if stretch > 0.0 { (detail / stretch).clamp(1.0e-5, 1.0e3) } else { 1.0 }
    }
}

/// A colour that may vary over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Color {
    /// The same everywhere, linear Rec.709.
    Constant(Vec3),
    /// Another at every point.
    Texture(Arc<Texture>),
}

impl Color {
    /// Linear Rec.709 colour at a point of the surface.
    #[inline]
    pub fn at(&self, place: &Place) -> Vec3 {
        match self {
            Self::Constant(color) => *color,
            Self::Texture(texture) => texture.color(place),
        }
    }

    /// The texture that it is, if it varies.
    pub fn texture(&self) -> Option<&Texture> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(texture) => Some(texture),
        }
    }
}

/// A number that may vary over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Number {
    /// The same everywhere.
    Constant(f32),
    /// Another at every point.
    Texture(Arc<Texture>),
}

impl Number {
    /// The number at a point of the surface.
    #[inline]
    pub fn at(&self, place: &Place) -> f32 {
        match self {
            Self::Constant(number) => *number,
            Self::Texture(texture) => texture.number(place),
        }
    }

    /// The texture that it is, if it varies.
    pub fn texture(&self) -> Option<&Texture> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(texture) => Some(texture),
        }
    }

    /// How the number changes with u and with v, by central differences over the texture's finest detail.
    pub fn gradient(&self, uv: Vec2) -> Vec2 {
        let Self::Texture(texture) = self else { return Vec2::ZERO };
        let step = texture.detail();
        let change = |axis: Vec2| {
            texture.number(&(uv + axis * step).into()) - texture.number(&(uv - axis * step).into())
        };
        Vec2::new(change(Vec2::X), change(Vec2::Y)) / (2.0 * step)
    }
}

#[cfg(test)]
mod tests {
    use super::{
        Channel, Checkerboard, Color, ColorSpace, Fbm, Image, ImageTexture, Number, Texture, TextureFilter,
        Wrap,
    };
    use glam::{Affine2, Vec2, Vec3};
    use std::io::Cursor;
    use std::sync::Arc;

    /// Textures of all kinds, none of them black anywhere.
    fn all(transform: Affine2) -> Vec<Texture> {
        let mut png = Cursor::new(Vec::new());
        let texels = (0..15).map(|texel| 100 + 10 * texel).collect();
        let file = image::GrayImage::from_vec(5, 3, texels).unwrap();
        file.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let image = Arc::new(Image::read(&png.into_inner(), 15).unwrap());
        let colors = [Vec3::new(0.25, 0.5, 0.75), Vec3::new(0.75, 0.5, 0.25)];
        let fbm =
            Fbm { colors, octaves: 16, gain: 1.0, lacunarity: 16.0, frequency: 1.0e6, seed: 7, transform };
        let mut all = vec![Texture::Checkerboard(Checkerboard { colors, transform }), Texture::Fbm(fbm)];
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [TextureFilter::Bilinear, TextureFilter::Nearest] {
                all.push(Texture::Image(ImageTexture {
                    image: image.clone(),
                    color_space: ColorSpace::Linear,
                    channel: Channel::Red,
                    wrap,
                    filter,
                    transform,
                }));
            }
        }
        all
    }

    const HOSTILE: [f32; 12] = [
        0.0,
        -0.0,
        -1.0e-30,
        f32::MIN_POSITIVE / 2.0,
        1.0 - f32::EPSILON / 2.0,
        -1.0 + f32::EPSILON / 2.0,
        1.0e9,
        -1.0e9,
        8_388_607.5,
        1.0e30,
        f32::MAX,
        f32::MIN,
    ];

    #[test]
    fn any_finite_coordinate_has_a_value_that_the_texture_holds() {
        for texture in all(Affine2::IDENTITY) {
            for u in HOSTILE {
                for v in HOSTILE {
                    let uv = Vec2::new(u, v);
                    let (color, number) = (texture.color(&uv.into()), texture.number(&uv.into()));
                    let held = |value: f32| (0.2499..=0.9413).contains(&value);
                    assert!(color.to_array().into_iter().all(held), "({u}, {v}): {color} in {texture:?}");
                    assert!(held(number), "({u}, {v}): {number} in {texture:?}");
                }
            }
        }
    }

    #[test]
    fn coordinates_that_are_not_finite_are_black() {
        let black = |texture: &Texture, uv: Vec2| {
            assert_eq!(
                (texture.color(&uv.into()), texture.number(&uv.into())),
                (Vec3::ZERO, 0.0),
                "{uv}: {texture:?}"
            );
        };
        for texture in all(Affine2::IDENTITY) {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                black(&texture, Vec2::new(bad, 0.5));
                black(&texture, Vec2::new(0.5, bad));
            }
        }
        for texture in all(Affine2::from_scale(Vec2::splat(1.0e30))) {
            black(&texture, Vec2::new(0.5, 1.0e20));
        }
    }

    #[test]
    fn constants_are_the_same_everywhere_and_textures_are_looked_up() {
        let (here, there) = (Vec2::new(0.1, 0.1), Vec2::new(0.9, 0.1));
        let color = Color::Constant(Vec3::X);
        assert_eq!([color.at(&here.into()), color.at(&Vec2::NAN.into())], [Vec3::X; 2]);
        assert_eq!(Number::Constant(2.0).at(&there.into()), 2.0);
        let colors = [Vec3::X, Vec3::Y];
        let board = Arc::new(Texture::Checkerboard(Checkerboard { colors, transform: Affine2::IDENTITY }));
        let color = Color::Texture(board.clone());
        assert_eq!([color.at(&here.into()), color.at(&there.into())], colors);
        // The luminance of red and of green.
        let number = Number::Texture(board);
        assert_eq!([number.at(&here.into()), number.at(&there.into())], [0.2126, 0.7152]);
    }

    #[test]
    fn a_gradient_is_the_change_by_u_and_by_v() {
        let mut png = Cursor::new(Vec::new());
        let file = image::GrayImage::from_fn(8, 8, |x, y| image::Luma([(20 * x + 7 * (7 - y)) as u8]));
        file.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let image = Texture::Image(ImageTexture {
            image: Arc::new(Image::read(&png.into_inner(), 64).unwrap()),
            color_space: ColorSpace::Linear,
            channel: Channel::Luminance,
            wrap: Wrap::Clamp,
            filter: TextureFilter::Bilinear,
            transform: Affine2::from_scale(Vec2::new(0.5, 1.0)),
        });
        // 20 and 7 steps of 1/255 a texel, eight texels a unit, half as many along u.
        let found = Number::Texture(Arc::new(image)).gradient(Vec2::new(0.9, 0.4));
        let expected = Vec2::new(80.0, 56.0) / 255.0;
        assert!((found - expected).abs().max_element() < 1.0e-5, "{found}, expected {expected}");
        assert_eq!(Number::Constant(3.0).gradient(Vec2::ONE), Vec2::ZERO);
    }
}
