//! Owns the extensions of materials: transmission, clearcoat, sheen, index of refraction, specular.

use serde_json::{Value, json};

use super::description::{Clearcoat, MaterialExtensions, Sheen, Specular};
use super::material::Surface;
use crate::ConvertError;

/// The coat of `principled_bsdf` has a quarter of the strength of glTF's.
const COAT: f64 = 4.0;
/// Width of the coat's microfacets at `clearcoat_gloss` 0.
const DULL_COAT: f64 = 0.1;
/// Width of the coat's microfacets at `clearcoat_gloss` 1.
const GLOSSY_COAT: f64 = 0.001;
/// Luminance of Rec.709, as `principled_bsdf` has it.
const LUMINANCE: [f64; 3] = [0.212_671, 0.715_160, 0.072_169];

impl Surface<'_, '_> {
    /// Everything that lies on or in the base.
    pub(super) fn layers(&mut self, extensions: &MaterialExtensions) -> Result<(), ConvertError> {
        let ior = extensions.ior.as_ref().map_or(1.5, |found| found.ior);
        let eta = self.clamped("KHR_materials_ior", ior, 0.1, 10.0)?;
        self.set("eta", eta);
        self.specular(extensions.specular.as_ref())?;
        self.transmission(extensions)?;
        if let Some(coat) = &extensions.clearcoat {
            self.clearcoat(coat)?;
        }
        if let Some(sheen) = &extensions.sheen {
            self.sheen(sheen)?;
        }
        Ok(())
    }

    fn specular(&mut self, found: Option<&Specular>) -> Result<(), ConvertError> {
        let field = "KHR_materials_specular";
        let none = Specular::default();
        let found = found.unwrap_or(&none);
        let color = found.specular_color_factor.unwrap_or([1.0; 3]);
        let grey = color.iter().zip(LUMINANCE).map(|(channel, weight)| channel * weight).sum::<f64>();
        if color[0] != color[1] || color[1] != color[2] {
            self.differs(field, "the colour of the highlight is taken as a grey of the same luminance");
        }
        if found.specular_color_texture.is_some() {
            self.untranslated(field, "the texture of the highlight's colour");
        }
        // Weights add up to 1 but for rounding, which must not make a texture's factor differ from 1.
        let grey = if color == [1.0; 3] { 1.0 } else { grey };
        let factor = found.specular_factor.unwrap_or(1.0) * grey;
        let specular = self.share(field, factor, found.specular_texture.as_ref(), "alpha")?;
        self.set("specular", specular);
        Ok(())
    }

    fn transmission(&mut self, extensions: &MaterialExtensions) -> Result<(), ConvertError> {
        let field = "KHR_materials_transmission";
        let volume = extensions.volume.as_ref();
        if let Some(found) = &extensions.transmission {
            let map = found.transmission_texture.as_ref();
            let share = self.share(field, found.transmission_factor, map, "red")?;
            if share != json!(0.0) {
                self.set("specular_transmission", share);
                if volume.is_none_or(|volume| volume.thickness_factor <= 0.0) {
                    self.differs(
                        field,
                        "a thin sheet of glass becomes the surface of solid glass, which refracts",
                    );
                }
            }
        }
        if volume.is_some_and(|volume| volume.attenuation_distance.is_some()) {
            self.untranslated("KHR_materials_volume", "the colour that light takes on in the glass");
        }
        Ok(())
    }

    fn clearcoat(&mut self, found: &Clearcoat) -> Result<(), ConvertError> {
        let field = "KHR_materials_clearcoat";
        let factor = self.clamped(field, found.clearcoat_factor, 0.0, 1.0)?;
        if factor == 0.0 {
            return Ok(());
        }
        let strength = match &found.clearcoat_texture {
            None => json!((COAT * factor).min(1.0)),
            Some(map) => self.share(field, 1.0, Some(map), "red")?,
        };
        self.set("clearcoat", strength);
        let roughness = self.clamped(field, found.clearcoat_roughness_factor, 0.0, 1.0)?;
        let gloss = (DULL_COAT - roughness * roughness) / (DULL_COAT - GLOSSY_COAT);
        self.set("clearcoat_gloss", gloss.clamp(0.0, 1.0));
        let text = format!(
            "the coat of {factor} with roughness {roughness} becomes that of principled_bsdf: it reflects at most a \
             quarter as much, is never rougher than {:.2}, and takes no light from what is below",
            DULL_COAT.sqrt()
        );
        self.differs(field, &text);
        if found.clearcoat_roughness_texture.is_some() || found.clearcoat_normal_texture.is_some() {
            self.untranslated(field, "textures of the coat's roughness and bumps");
        }
        Ok(())
    }

    fn sheen(&mut self, found: &Sheen) -> Result<(), ConvertError> {
        let field = "KHR_materials_sheen";
        if found.sheen_color_texture.is_some() {
            self.untranslated(field, "the texture of the sheen's colour");
        }
        let mut color = found.sheen_color_factor;
        for channel in &mut color {
            *channel = self.clamped(field, *channel, 0.0, 1.0)?;
        }
        let strength = luminance(color);
        if strength == 0.0 {
            return Ok(());
        }
        let tint = match self.field("base_color") {
            Some(Value::Array(base)) => {
                let base: Vec<f64> = base.iter().filter_map(Value::as_f64).collect();
                nearest_tint(color.map(|channel| channel / strength), &base)
            }
            _ => 0.0,
        };
        self.set("sheen", strength.min(1.0));
        self.set("sheen_tint", tint);
        self.differs(
            field,
            "the sheen becomes that of principled_bsdf: as wide for every roughness, its colour between white and \
             the base colour, and it takes no light from what is below",
        );
        Ok(())
    }
}

fn luminance(color: [f64; 3]) -> f64 {
    color.iter().zip(LUMINANCE).map(|(channel, weight)| channel * weight).sum()
}

/// The share of the base colour's hue with which a hue is met best: least squares between white and that of the base.
fn nearest_tint(hue: [f64; 3], base: &[f64]) -> f64 {
    let &[r, g, b] = base else { return 0.0 };
    let bright = luminance([r, g, b]);
    if bright == 0.0 {
        return 0.0;
    }
    let away = [r, g, b].map(|channel| channel / bright - 1.0);
    let length: f64 = away.iter().map(|channel| channel * channel).sum();
    if length == 0.0 {
        return 0.0;
    }
    let along: f64 = away.iter().zip(hue).map(|(away, channel)| away * (channel - 1.0)).sum();
    (along / length).clamp(0.0, 1.0)
}
