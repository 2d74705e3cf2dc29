//! Owns materials: metallic and roughness become `principled_bsdf`.
//!
//! Both have microfacets as wide as the square of the roughness. `specular` is 1 where glTF says nothing, which is the
//! highlight of the index of refraction; karst's own default is half of it.

use serde_json::{Map, Value, json};

use super::description::{Material, TextureInfo};
use super::output::{Output, add};
use super::reader::Reader;
use super::texture::{Taken, texture};
use crate::ConvertError;

/// What instances of a material need to know.
#[derive(Debug, Clone)]
pub(super) struct Look {
    /// Name in the document.
    pub(super) name: String,
    /// Radiance that a surface of it sends out.
    pub(super) emission: [f64; 3],
    /// Number of the texture coordinates that its textures are on.
    pub(super) set: u32,
}

/// A material that becomes fields of the document.
#[derive(Debug)]
pub(super) struct Surface<'a, 'b> {
    pub(super) reader: &'a Reader<'a>,
    pub(super) output: &'a mut Output<'b>,
    /// Where it is in the file.
    pub(super) place: String,
    set: u32,
    fields: Map<String, Value>,
}

/// Adds a material to the document; without an index that of primitives that have none.
pub(super) fn material(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    index: Option<u32>,
    place: &str,
) -> Result<Look, ConvertError> {
    let plain = Material::default();
    let (found, here) = match index {
        None => (&plain, "materials".to_owned()),
        Some(index) => {
            let found = reader.get(&reader.root.materials, index, place, "materials")?;
            (found, format!("materials[{index}]"))
        }
    };
    let mut surface = Surface { reader, output, place: here, set: set_of(found), fields: Map::new() };
    surface.fields.insert("type".to_owned(), json!("principled_bsdf"));
    surface.base(found)?;
    surface.layers(&found.extensions)?;
    surface.sides(found);
    surface.opacity(found)?;
    surface.bumps(found)?;
    let emission = surface.emission(found)?;
    if found.occlusion_texture.is_some() {
        surface.untranslated("occlusionTexture", "a path tracer finds by itself what is in the shade");
    }
    let place = surface.place.clone();
    surface.output.others(place, &found.extensions.others);
    let Surface { fields, set, .. } = surface;
    let otherwise = index.map_or_else(|| "default".to_owned(), |index| format!("material_{index}"));
    let name = add(&mut output.materials, found.name.as_deref(), &otherwise, Value::Object(fields));
    Ok(Look { name, emission, set })
}

/// Number of the texture coordinates of the first texture.
fn set_of(material: &Material) -> u32 {
    let pbr = &material.pbr_metallic_roughness;
    let extensions = &material.extensions;
    let textures = [
        pbr.base_color_texture.as_ref(),
        pbr.metallic_roughness_texture.as_ref(),
        material.normal_texture.as_ref(),
        extensions.transmission.as_ref().and_then(|t| t.transmission_texture.as_ref()),
        extensions.clearcoat.as_ref().and_then(|c| c.clearcoat_texture.as_ref()),
        extensions.specular.as_ref().and_then(|s| s.specular_texture.as_ref()),
    ];
    textures.into_iter().flatten().next().map_or(0, |info| {
        info.extensions.transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord)
    })
}

impl Surface<'_, '_> {
    pub(super) fn untranslated(&mut self, field: &str, text: &str) {
        self.output.untranslated(format!("{}.{field}", self.place), text);
    }

    pub(super) fn differs(&mut self, field: &str, text: &str) {
        self.output.differs(format!("{}.{field}", self.place), text);
    }

    /// Sets a field of the document.
    pub(super) fn set(&mut self, field: &str, value: impl Into<Value>) {
        self.fields.insert(field.to_owned(), value.into());
    }

    /// A field of the document that was set.
    pub(super) fn field(&self, field: &str) -> Option<&Value> {
        self.fields.get(field)
    }

    /// The number, moved into a range where it is outside.
    pub(super) fn clamped(
        &mut self,
        field: &str,
        number: f64,
        low: f64,
        high: f64,
    ) -> Result<f64, ConvertError> {
        self.reader.finite(number, format!("{}.{field}", self.place))?;
        let moved = number.clamp(low, high);
        if moved != number {
            self.differs(field, &format!("{number:?} is taken as {moved:?}"));
        }
        Ok(moved)
    }

    /// A factor from 0 to 1 times a channel of a texture, as one value of the document.
    pub(super) fn share(
        &mut self,
        field: &str,
        factor: f64,
        map: Option<&TextureInfo>,
        channel: &'static str,
    ) -> Result<Value, ConvertError> {
        let factor = self.clamped(field, factor, 0.0, 1.0)?;
        let (true, Some(info)) = (factor > 0.0, map) else { return Ok(json!(factor)) };
        let Some(found) = self.texture(field, info, Taken::Channel(channel))? else {
            return Ok(json!(factor));
        };
        if factor != 1.0 {
            self.differs(field, &format!("the texture is taken without its factor {factor}"));
        }
        Ok(found)
    }

    fn texture(
        &mut self,
        field: &str,
        info: &TextureInfo,
        taken: Taken,
    ) -> Result<Option<Value>, ConvertError> {
        texture(self.reader, self.output, info, self.set, taken, &format!("{}.{field}", self.place))
    }

    fn base(&mut self, material: &Material) -> Result<(), ConvertError> {
        let pbr = &material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor.unwrap_or([1.0; 4]);
        let mut factor = [r, g, b];
        for number in &mut factor {
            *number = self.clamped("baseColorFactor", *number, 0.0, 1.0)?;
        }
        let map = pbr.base_color_texture.as_ref().filter(|_| factor != [0.0; 3]);
        let found = match map {
            Some(info) => self.texture("baseColorTexture", info, Taken::Color)?,
            None => None,
        };
        if found.is_some() && factor != [1.0; 3] {
            self.differs("baseColorFactor", &format!("the texture is taken without its factor {factor:?}"));
        }
        self.set("base_color", found.unwrap_or_else(|| json!(factor)));
        let map = pbr.metallic_roughness_texture.as_ref();
        let metallic = self.share("metallicFactor", pbr.metallic_factor.unwrap_or(1.0), map, "blue")?;
        self.set("metallic", metallic);
        let roughness = self.share("roughnessFactor", pbr.roughness_factor.unwrap_or(1.0), map, "green")?;
        self.set("roughness", roughness);
        Ok(())
    }

    fn sides(&mut self, material: &Material) {
        // Glass has an inside; the back of everything else is like its front, or black.
        let is_glass = self.fields.contains_key("specular_transmission");
        self.set("two_sided", material.double_sided && !is_glass);
    }

    fn opacity(&mut self, material: &Material) -> Result<(), ConvertError> {
        let mode = material.alpha_mode.as_deref().unwrap_or("OPAQUE");
        let pbr = &material.pbr_metallic_roughness;
        let [.., factor] = pbr.base_color_factor.unwrap_or([1.0; 4]);
        let map = pbr.base_color_texture.as_ref();
        let cutoff = material.alpha_cutoff.unwrap_or(0.5);
        let opacity = match mode {
            "OPAQUE" => return Ok(()),
            "BLEND" => self.share("alphaMode", factor, map, "alpha")?,
            "MASK" => match self.share("alphaMode", factor, map, "alpha")? {
                Value::Number(_) => json!(if factor >= cutoff { 1.0 } else { 0.0 }),
                found => {
                    let text = format!("the alpha of a mask is taken as it is, not cut at {cutoff}");
                    self.differs("alphaMode", &text);
                    found
                }
            },
            other => {
                let message = format!("found {other:.20?}, expected OPAQUE, MASK or BLEND");
                return Err(self.reader.error(format!("{}.alphaMode", self.place), message));
            }
        };
        if opacity != json!(1.0) {
            self.set("opacity", opacity);
        }
        Ok(())
    }

    fn bumps(&mut self, material: &Material) -> Result<(), ConvertError> {
        let Some(info) = &material.normal_texture else { return Ok(()) };
        if info.scale == 0.0 {
            return Ok(());
        }
        let Some(found) = self.texture("normalTexture", info, Taken::Data)? else { return Ok(()) };
        if info.scale != 1.0 {
            let text = format!("the bumps are taken as they are, not {} times as steep", info.scale);
            self.differs("normalTexture", &text);
        }
        self.set("normal_map", found);
        Ok(())
    }

    fn emission(&mut self, material: &Material) -> Result<[f64; 3], ConvertError> {
        let strength = material.extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength);
        let mut emission = material.emissive_factor;
        for number in &mut emission {
            *number = self.clamped("emissiveFactor", *number * strength, 0.0, f64::from(f32::MAX))?;
        }
        if emission == [0.0; 3] {
            return Ok(emission);
        }
        if material.emissive_texture.is_some() {
            self.untranslated(
                "emissiveTexture",
                "a surface sends out the same light everywhere, this one none",
            );
            return Ok([0.0; 3]);
        }
        if material.double_sided {
            self.differs("emissiveFactor", "a double-sided surface sends out light on its front only");
        }
        Ok(emission)
    }
}
