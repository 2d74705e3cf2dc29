//! Owns the lights that are not surfaces.

use glam::{DAffine3, DVec3, Vec3};

use crate::light::SpotFalloff;
use crate::scene::document::asset::AssetKind;
use crate::scene::document::cursor::Cursor;
use crate::scene::document::macros::variants;
use crate::scene::document::rule::{optional, or, required};

variants! {
    "light";
    /// A light that is not a surface.
    pub enum Light {
        /// Light from all directions, infinitely far away.
        "environment" => Environment {
            /// Radiance; with an image, the factor of its radiance.
            radiance: Vec3 = or(Vec3::ONE).from(0.0);
            /// Path of an EXR or Radiance HDR file (or PNG, JPEG), relative to the document: radiance by direction, as a
            /// map of longitude and latitude. Its middle is in direction +z of the light's own frame, its upper edge is
            /// +y, and it is seen from inside: what is on the right in the image is in direction -x.
            image: Option<String> = optional().file(AssetKind::Image);
            /// Whether the first and last row of texels lie on the poles, as Mitsuba has it, and not half a texel off them.
            rows_at_poles: bool = or(false);
            /// Turns the light's own frame; translation has no effect.
            transform: DAffine3 = or(DAffine3::IDENTITY);
        }
        /// A point that shines evenly in all directions.
        "point" => Point {
            /// Where it is, in world units.
            position: Vec3 = required();
            /// Radiant intensity (power per solid angle), linear Rec.709.
            intensity: Vec3 = required().from(0.0);
        }
        /// A point that shines in a direction.
        "spotlight" => Spotlight checked by is_spotlight {
            /// Where it is, in world units.
            position: Vec3 = required();
            /// Where it shines, of any length.
            direction: DVec3 = required();
            /// Radiant intensity (power per solid angle) along the axis, linear Rec.709.
            intensity: Option<Vec3> = optional().from(0.0);
            /// Older name of `intensity`.
            radiance: Option<Vec3> = optional().from(0.0);
            /// How narrow the light is: at an angle θ off the axis the intensity falls with max(cos θ, 0) to the power
            /// focus². 1 where no other falloff is given.
            focus: Option<f32> = optional().from(0.0).to(1000.0);
            /// Angle off the axis from which on there is no light, in degrees; 90 where `focus` stands alone.
            cutoff_angle: Option<f32> = optional().above(0.0).to(180.0);
            /// In place of `focus`, as Mitsuba has it: full light up to this angle off the axis, in degrees, then linear in
            /// the angle down to 0 at `cutoff_angle`.
            beam_width: Option<f32> = optional().from(0.0).to(180.0);
            /// In place of all these, as Blender has it: the angle across the whole cone, in degrees.
            cone_angle: Option<f32> = optional().above(0.0).to(180.0);
            /// The share of the cone over which the light fades in, by a smoothstep of the cosine; 0.15 where left out.
            blend: Option<f32> = optional().from(0.0).to(1.0);
        }
        /// Light from a disk infinitely far away.
        "sun" => Sun checked by is_sun {
            /// Where the light goes, of any length.
            direction: DVec3 = required();
            /// Irradiance of a surface that faces it, linear Rec.709.
            irradiance: Vec3 = required().from(0.0);
            /// Angle across the disk, in degrees; 0 makes all rays parallel and shadows sharp.
            angular_size: f32 = or(0.533).from(0.0).below(180.0);
        }
    }
}

impl Light {
    /// How a spotlight's intensity falls off; `Err` says which fields contradict each other. Other lights have none.
    pub(in crate::scene) fn falloff(&self) -> Result<SpotFalloff, &'static str> {
        let Self::Spotlight { focus, cutoff_angle, beam_width, cone_angle, blend, .. } = *self else {
            return Err("only a spotlight has a falloff");
        };
        match (focus, beam_width, cone_angle) {
            (_, None, None) if blend.is_some() => Err("\"blend\" has a meaning only with \"cone_angle\""),
            (_, None, None) => {
                let cutoff_angle = cutoff_angle.unwrap_or(90.0).min(90.0);
                Ok(SpotFalloff::Focus { focus: focus.unwrap_or(1.0), cutoff_angle })
            }
            (None, Some(beam_width), None) => match cutoff_angle {
                None => Err("\"beam_width\" needs \"cutoff_angle\""),
                Some(edge) if edge < beam_width => Err("\"cutoff_angle\" is less than \"beam_width\""),
                Some(cutoff_angle) => Ok(SpotFalloff::Linear { beam_width, cutoff_angle }),
            },
            (None, None, Some(_)) if cutoff_angle.is_some() => {
                Err("\"cone_angle\" and \"cutoff_angle\" both say where the light ends")
            }
            (None, None, Some(cone_angle)) => {
                Ok(SpotFalloff::Blend { cone_angle, blend: blend.unwrap_or(0.15) })
            }
            _ => Err("\"focus\", \"beam_width\" and \"cone_angle\" exclude each other"),
        }
    }
}

fn is_spotlight(light: &Light, at: &Cursor<'_>) -> bool {
    let Light::Spotlight { direction, intensity, radiance, .. } = light else { return true };
    let hint = "focus with cutoff_angle, or beam_width with cutoff_angle, or cone_angle with blend";
    let falloff = light.falloff();
    if let Err(wrong) = falloff {
        at.problem(wrong, Some(hint.to_owned()));
    }
    let one = intensity.is_some() != radiance.is_some();
    if !one {
        at.member_problem("intensity", "expected either \"intensity\" or its older name \"radiance\"", None);
    }
    is_direction(*direction, at) && one && falloff.is_ok()
}

fn is_sun(light: &Light, at: &Cursor<'_>) -> bool {
    let Light::Sun { direction, .. } = light else { return true };
    is_direction(*direction, at)
}

fn is_direction(direction: DVec3, at: &Cursor<'_>) -> bool {
    let ok = direction.try_normalize().is_some();
    if !ok {
        at.member_problem("direction", "found no direction, expected a vector that is not 0", None);
    }
    ok
}
