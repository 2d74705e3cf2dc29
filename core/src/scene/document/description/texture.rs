//! Owns colours and numbers that may vary over a surface.

use glam::{Affine2, DAffine2, DAffine3, DMat2, DVec2, Vec3};
use serde_json::{Value as Json, json};

use crate::scene::document::asset::AssetKind;
use crate::scene::document::cursor::Cursor;
use crate::scene::document::decode::{Decode, elements};
use crate::scene::document::macros::{object, variants};
use crate::scene::document::rule::{Allowed, auto, or, required};
use crate::scene::document::schema::Definitions;
use crate::scene::document::tree::Value;
use crate::sdf::Trap;
use crate::texture::{Channel, ColorSpace, TextureFilter, Wrap};

variants! {
    "texture";
    /// A colour that varies over a surface. Where a number is asked for, it is the luminance of the colour, and where
    /// the range of a parameter ends, values end too.
    pub enum Texture {
        /// An image over the surface's uv: u to the right, v upwards from the bottom of the image.
        "image" => Image {
            /// Path of a PNG, JPEG, EXR or Radiance HDR file, relative to the document. Cannot be animated.
            file: String = required().file(AssetKind::Image);
            /// What the numbers in the file mean; `"auto"` is sRGB for colours in PNG and JPEG files, else linear.
            color_space: Option<ColorSpace> = auto();
            /// Which channel is taken where a number is asked for.
            channel: Channel = or(Channel::Luminance);
            /// What lies outside 0 to 1.
            wrap: Wrap = or(Wrap::Repeat);
            /// What lies between texels.
            filter: TextureFilter = or(TextureFilter::Bilinear);
            /// Maps the surface's uv to that of the texture.
            transform: DAffine2 = or(DAffine2::IDENTITY);
        }
        /// A checkerboard of two by two fields in the unit square, repeated.
        "checkerboard" => Checkerboard {
            /// Colour at the corners (0, 0) and (1, 1); a number is a grey.
            color0: Shade = or(Shade(Vec3::splat(0.4)));
            /// Colour at the corners (1, 0) and (0, 1); a number is a grey.
            color1: Shade = or(Shade(Vec3::splat(0.2)));
            /// Maps the surface's uv to that of the texture.
            transform: DAffine2 = or(DAffine2::IDENTITY);
        }
        /// Fractal noise: octaves of gradient noise (Perlin 2002), their sum mapped from -1 to 1 to the two colours.
        "fbm" => Fbm {
            /// Colour where the noise is lowest; a number is a grey.
            color0: Shade = or(Shade(Vec3::ZERO));
            /// Colour where the noise is highest; a number is a grey.
            color1: Shade = or(Shade(Vec3::ONE));
            /// Number of octaves.
            octaves: u32 = or(6).from(1.0).to(16.0);
            /// Amplitude of an octave, in units of the one before.
            gain: f32 = or(0.5).from(0.0).to(1.0);
            /// Frequency of an octave, in units of the one before.
            lacunarity: f32 = or(2.0).from(1.0).to(16.0);
            /// Cells of the first octave per unit of uv.
            frequency: f32 = or(8.0).above(0.0).to(1.0e6);
            /// Chooses the noise.
            seed: u32 = or(0);
            /// Maps the surface's uv to that of the texture.
            transform: DAffine2 = or(DAffine2::IDENTITY);
        }
        /// Cubes of half a unit in the space of the object, in two colours by turns: needs no uv. The space is that of a
        /// mesh's file, of a tree of distance functions, or around the centre of a sphere.
        "solid_checkerboard" => SolidCheckerboard {
            /// Colour of the cube from (0, 0, 0) to (0.5, 0.5, 0.5); a number is a grey.
            color0: Shade = or(Shade(Vec3::splat(0.4)));
            /// Colour of the cubes beside it; a number is a grey.
            color1: Shade = or(Shade(Vec3::splat(0.2)));
            /// Maps the space of the object to that of the texture.
            transform: DAffine3 = or(DAffine3::IDENTITY);
        }
        /// Fractal noise in the space of the object: needs no uv. With equal numbers it is the noise of `fbm_noise`, and a
        /// displaced surface has the colours of its height.
        "solid_fbm" => SolidFbm {
            /// Colour where the noise is `low` or less; a number is a grey.
            color0: Shade = or(Shade(Vec3::ZERO));
            /// Colour where the noise is `high` or more; a number is a grey.
            color1: Shade = or(Shade(Vec3::ONE));
            /// Value with the first colour. All octaves together reach -1 and 1, and are rarely beyond half of that.
            low: f32 = or(-0.5).from(-1.0).to(1.0);
            /// Value with the second colour; above `low`.
            high: f32 = or(0.5).from(-1.0).to(1.0);
            /// Number of octaves.
            octaves: u32 = or(6).from(1.0).to(16.0);
            /// Amplitude of an octave, in units of the one before.
            gain: f32 = or(0.5).from(0.0).to(1.0);
            /// Frequency of an octave, in units of the one before.
            lacunarity: f32 = or(2.0).from(1.0).to(8.0);
            /// Cells of the first octave per unit of length.
            frequency: f32 = or(1.0).from(1.0e-6).to(1.0e6);
            /// Chooses the noise.
            seed: u32 = or(0);
            /// Maps the space of the object to that of the texture.
            transform: DAffine3 = or(DAffine3::IDENTITY);
        }
        /// Colours of a Mandelbulb or a Julia set: how close the orbit of a point comes to a trap. Everything else has
        /// the second colour.
        "orbit_trap" => OrbitTrap {
            /// Colour of orbits that come as close as `near`; a number is a grey.
            color0: Shade = or(Shade(Vec3::ZERO));
            /// Colour of orbits that stay as far away as `far`; a number is a grey.
            color1: Shade = or(Shade(Vec3::ONE));
            /// What orbits come close to.
            trap: Trap = or(Trap::Origin);
            /// Distance from the trap with the first colour, in the fractal's own units.
            near: f32 = or(0.0).from(0.0);
            /// Distance from the trap with the second colour; above `near`.
            far: f32 = or(1.0).above(0.0);
        }
    }
}

/// A colour, or a grey written as one number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade(pub Vec3);

/// A colour that may vary over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum ColorTexture {
    /// The same everywhere, linear Rec.709.
    Constant(Vec3),
    /// Another at every point.
    Texture(Box<Texture>),
}

/// A number that may vary over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum NumberTexture {
    /// The same everywhere.
    Constant(f32),
    /// Another at every point.
    Texture(Box<Texture>),
}

impl Decode for Shade {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        match at.node.value {
            Value::List(_) => Vec3::decode(at, allowed).map(Self),
            Value::Number(_) => f32::decode(at, allowed).map(|grey| Self(Vec3::splat(grey))),
            Value::Null | Value::Bool(_) | Value::Object(_) | Value::Text(_) => {
                at.expected(&Self::expected(allowed));
                None
            }
        }
    }

    fn expected(allowed: &Allowed) -> String {
        format!("{} or {}", f32::expected(allowed), Vec3::expected(allowed))
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        json!({"anyOf": [f32::schema(allowed, definitions), Vec3::schema(allowed, definitions)]})
    }

    fn show(&self) -> Json {
        if self.0 == Vec3::splat(self.0.x) { self.0.x.show() } else { self.0.show() }
    }
}

macro_rules! or_texture {
    ($name:ty, $constant:ty, $written:pat) => {
        impl Decode for $name {
            fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
                match at.node.value {
                    $written => <$constant>::decode(at, allowed).map(Self::Constant),
                    Value::Object(_) => Some(Self::Texture(Box::new(Texture::decode(at, allowed)?))),
                    _ => {
                        at.expected(&Self::expected(allowed));
                        None
                    }
                }
            }

            fn expected(allowed: &Allowed) -> String {
                format!("{} or a texture object", <$constant>::expected(allowed))
            }

            fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
                json!({"anyOf": [<$constant>::schema(allowed, definitions), Texture::schema(allowed, definitions)]})
            }

            fn show(&self) -> Json {
                match self {
                    Self::Constant(constant) => constant.show(),
                    Self::Texture(texture) => texture.show(),
                }
            }
        }
    };
}

or_texture!(ColorTexture, Vec3, Value::List(_));
or_texture!(NumberTexture, f32, Value::Number(_));

object! {
    "texture transform";
    /// Scale first, then rotation, then translation of texture coordinates; each may be left out.
    struct UvComponents {
        /// Factors along u and v: 8 repeats a texture eight times in the unit square.
        scale: DVec2 = or(DVec2::ONE).nonzero();
        /// Rotation counter-clockwise, in degrees.
        rotate: f64 = or(0.0);
        /// Translation.
        translate: DVec2 = or(DVec2::ZERO);
    }
}

object! {
    "texture transform by matrix";
    /// The matrix itself.
    struct UvMatrix {
        /// Two rows of three numbers, for column vectors: translation in the last column.
        matrix: UvRows = required();
    }
}

/// Rows of a matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
struct UvRows([[f64; 3]; 2]);

impl Decode for UvRows {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let expected = Self::expected(allowed);
        let rows = elements(at, 2, &expected)?;
        let row = |index: usize| {
            let row = at.element(index, &rows[index]);
            let numbers = elements(&row, 3, &expected)?;
            let number = |column: usize| f64::decode(&row.element(column, &numbers[column]), allowed);
            let [a, b, c] = [number(0), number(1), number(2)];
            Some([a?, b?, c?])
        };
        let [first, second] = [row(0), row(1)];
        Some(Self([first?, second?]))
    }

    fn expected(_: &Allowed) -> String {
        "a list of 2 rows, each a list of 3 numbers".to_owned()
    }

    fn schema(_: &Allowed, _: &mut Definitions) -> Json {
        let list = |items: Json, length: u32| json!({"type": "array", "items": items, "minItems": length, "maxItems": length});
        list(list(json!({"type": "number"}), 3), 2)
    }

    fn show(&self) -> Json {
        json!(self.0)
    }
}

impl Decode for DAffine2 {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let map = if at.node.get("matrix").is_some() {
            let UvMatrix { matrix: UvRows([x, y]) } = UvMatrix::decode(at, allowed)?;
            Self {
                matrix2: DMat2::from_cols(DVec2::new(x[0], y[0]), DVec2::new(x[1], y[1])),
                translation: DVec2::new(x[2], y[2]),
            }
        } else {
            let UvComponents { scale, rotate, translate } = UvComponents::decode(at, allowed)?;
            Self::from_scale_angle_translation(scale, rotate.to_radians(), translate)
        };
        // The renderer takes it in single precision.
        let single = Affine2::from_cols_array(&map.to_cols_array().map(|number| number as f32));
        if !single.is_finite() {
            at.problem("found a texture transform too large for single precision", None);
            return None;
        }
        Some(map)
    }

    fn expected(_: &Allowed) -> String {
        "a texture transform object".to_owned()
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        let forms = [UvComponents::schema(allowed, definitions), UvMatrix::schema(allowed, definitions)];
        json!({"anyOf": forms})
    }

    fn show(&self) -> Json {
        if *self == Self::IDENTITY {
            return json!({});
        }
        let (m, t) = (self.matrix2, self.translation);
        json!({"matrix": [[m.x_axis.x, m.y_axis.x, t.x], [m.x_axis.y, m.y_axis.y, t.y]]})
    }
}
