//! Owns the tests of materials and textures.

use karst_core::scene::Model;
use serde_json::{Value, json};

use super::{PNG, differs, near, ok, untranslated, with_material};
use crate::{Asset, Converted};

/// The one material of a file with the square under it.
fn material(material: &Value) -> (Converted, Value) {
    let (converted, description) = ok(&with_material(material, &json!({})));
    assert!(matches!(description.materials.values().next().unwrap().model, Model::Principled { .. }));
    let found = converted.document["materials"].as_object().unwrap().values().next().unwrap().clone();
    (converted, found)
}

fn image(channel: Option<&str>, space: &str) -> Value {
    let mut image = json!({"type": "image", "file": "textures/0-white.png", "color_space": space});
    if let Some(channel) = channel {
        image["channel"] = json!(channel);
    }
    image
}

#[test]
fn factors_and_textures_of_the_base() {
    let (converted, found) = material(&json!({"pbrMetallicRoughness": {
        "baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0.25, "roughnessFactor": 0.75,
    }}));
    assert_eq!(
        found,
        json!({
            "type": "principled_bsdf", "base_color": [0.1, 0.2, 0.3], "metallic": 0.25, "roughness": 0.75,
            "eta": 1.5, "specular": 1.0, "two_sided": false,
        })
    );
    assert!(differs(&converted).is_empty() && untranslated(&converted).is_empty());
    let (converted, found) = material(&json!({"doubleSided": true, "pbrMetallicRoughness": {
        "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0},
    }, "normalTexture": {"index": 0}}));
    assert_eq!(
        found,
        json!({
            "type": "principled_bsdf", "base_color": image(None, "srgb"),
            "metallic": image(Some("blue"), "linear"), "roughness": image(Some("green"), "linear"),
            "eta": 1.5, "specular": 1.0, "two_sided": true, "normal_map": image(None, "linear"),
        })
    );
    assert!(differs(&converted).is_empty() && untranslated(&converted).is_empty());
    assert_eq!(converted.assets.keys().collect::<Vec<_>>(), ["meshes/0.ply", "textures/0-white.png"][..]);
}

#[test]
fn a_material_that_says_nothing_is_a_rough_metal() {
    let (_, found) = material(&json!({}));
    assert_eq!(
        (&found["base_color"], &found["metallic"], &found["roughness"]),
        (&json!([1.0, 1.0, 1.0]), &json!(1.0), &json!(1.0))
    );
}

#[test]
fn a_factor_beside_a_texture_is_noted_unless_it_is_0_or_1() {
    let (converted, found) = material(&json!({"pbrMetallicRoughness": {
        "baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0.5, 1, 1],
        "metallicRoughnessTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.5,
    }, "normalTexture": {"index": 0, "scale": 2}}));
    assert_eq!(found["metallic"], json!(0.0));
    assert_eq!(
        differs(&converted),
        [
            "materials[0].baseColorFactor: the texture is taken without its factor [1.0, 0.5, 1.0]",
            "materials[0].roughnessFactor: the texture is taken without its factor 0.5",
            "materials[0].normalTexture: the bumps are taken as they are, not 2 times as steep",
        ]
    );
}

#[test]
fn every_extension() {
    let (converted, found) = material(&json!({
        "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [0.8, 0.1, 0.1, 1]},
        "emissiveFactor": [1, 0.5, 0.25],
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.9},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.1, "clearcoatRoughnessFactor": 0.1},
            "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.5, 0.5], "sheenRoughnessFactor": 0.3},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_specular": {"specularFactor": 0.5},
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_iridescence": {},
        },
    }));
    let number = |field: &str| found[field].as_f64().unwrap();
    near(
        ["specular_transmission", "eta", "specular", "clearcoat", "sheen", "sheen_tint"].map(number),
        &[0.9, 1.33, 0.5, 0.4, 0.5, 0.0],
    );
    // Microfacets of width 0.01, between 0.1 at gloss 0 and 0.001 at gloss 1.
    near([0.1 - 0.099 * number("clearcoat_gloss")], &[0.01]);
    assert_eq!(converted.document["instances"]["square"]["emission"], json!([8.0, 4.0, 2.0]));
    assert_eq!(
        untranslated(&converted),
        [
            "materials[0].KHR_materials_volume: the colour that light takes on in the glass",
            "materials[0]: the extension KHR_materials_iridescence",
        ]
    );
    let said = differs(&converted).join("\n");
    assert!(said.contains("KHR_materials_clearcoat") && said.contains("KHR_materials_sheen"), "{said}");
    assert!(!said.contains("KHR_materials_transmission"), "{said}");
}

#[test]
fn a_sheen_of_the_base_colour_is_a_tinted_one() {
    let (_, found) = material(&json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.2, 0.2, 1]},
        "extensions": {"KHR_materials_sheen": {"sheenColorFactor": [0.4, 0.1, 0.1]}},
    }));
    near([found["sheen_tint"].as_f64().unwrap()], &[1.0]);
}

#[test]
fn thin_glass_and_tinted_highlights_are_noted() {
    let (converted, found) = material(&json!({"doubleSided": true, "extensions": {
        "KHR_materials_transmission": {"transmissionTexture": {"index": 0}, "transmissionFactor": 1},
        "KHR_materials_specular": {"specularColorFactor": [1, 0, 0], "specularTexture": {"index": 0}},
    }}));
    assert_eq!(found["two_sided"], json!(false));
    assert_eq!(found["specular_transmission"], image(Some("red"), "linear"));
    assert_eq!(found["specular"], image(Some("alpha"), "linear"));
    assert_eq!(
        differs(&converted),
        [
            "materials[0].KHR_materials_specular: the colour of the highlight is taken as a grey of the same luminance",
            "materials[0].KHR_materials_specular: the texture is taken without its factor 0.212671",
            "materials[0].KHR_materials_transmission: a thin sheet of glass becomes the surface of solid glass, which \
             refracts",
        ]
    );
}

#[test]
fn alpha_becomes_opacity() {
    let opacity = |more: Value| {
        let mut all = more;
        all["name"] = json!("m");
        let (converted, found) = material(&all);
        (found.get("opacity").cloned(), differs(&converted).len())
    };
    let half = json!({"baseColorFactor": [1, 1, 1, 0.4]});
    let textured = json!({"baseColorTexture": {"index": 0}});
    assert_eq!(opacity(json!({"pbrMetallicRoughness": half})), (None, 0));
    assert_eq!(opacity(json!({"pbrMetallicRoughness": half, "alphaMode": "BLEND"})), (Some(json!(0.4)), 0));
    assert_eq!(opacity(json!({"pbrMetallicRoughness": half, "alphaMode": "MASK"})), (Some(json!(0.0)), 0));
    let low = json!({"pbrMetallicRoughness": half, "alphaMode": "MASK", "alphaCutoff": 0.4});
    assert_eq!(opacity(low), (None, 0));
    let alpha = Some(image(Some("alpha"), "linear"));
    assert_eq!(opacity(json!({"pbrMetallicRoughness": textured, "alphaMode": "BLEND"})), (alpha.clone(), 0));
    assert_eq!(opacity(json!({"pbrMetallicRoughness": textured, "alphaMode": "MASK"})), (alpha, 1));
}

#[test]
fn textured_light_is_noted_and_constant_light_is_not() {
    let (converted, _) = material(&json!({"emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 1]}));
    assert_eq!(
        untranslated(&converted),
        ["materials[0].emissiveTexture: a surface sends out the same light everywhere, this one none"]
    );
    let (converted, _) = material(&json!({"emissiveTexture": {"index": 0}}));
    assert!(untranslated(&converted).is_empty());
    let (converted, _) = material(&json!({"emissiveFactor": [1, 1, 1], "doubleSided": true}));
    assert_eq!(differs(&converted).len(), 1);
}

/// The base colour's texture of a file with one sampler.
fn sampled(info: &Value, sampler: &Value) -> (Converted, Value) {
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": info}});
    let more = json!({"textures": [{"source": 0, "sampler": 0}], "samplers": [sampler]});
    let (converted, _) = ok(&with_material(&material, &more));
    let found = converted.document["materials"]["material_0"]["base_color"].clone();
    (converted, found)
}

#[test]
fn samplers() {
    let (_, found) =
        sampled(&json!({"index": 0}), &json!({"wrapS": 33648, "wrapT": 33648, "magFilter": 9728}));
    assert_eq!((&found["wrap"], &found["filter"]), (&json!("mirror"), &json!("nearest")));
    let (converted, found) = sampled(&json!({"index": 0}), &json!({"wrapS": 33071, "magFilter": 9729}));
    assert_eq!((&found["wrap"], found.get("filter")), (&json!("clamp"), None));
    assert_eq!(
        differs(&converted),
        ["samplers[0]: wrapS is clamp and wrapT is repeat: clamp is taken for both"]
    );
}

/// Where a texture transform of glTF takes a point, both with v downwards, through the transform in the document.
fn transformed(transform: &Value, [u, v]: [f64; 2]) -> [f64; 2] {
    let info = json!({"index": 0, "extensions": {"KHR_texture_transform": transform}});
    let (_, found) = sampled(&info, &json!({}));
    let rows = &found["transform"]["matrix"];
    let number = |row: usize, column: usize| rows[row][column].as_f64().unwrap();
    let apply = |row: usize| number(row, 0) * u + number(row, 1) * (1.0 - v) + number(row, 2);
    [apply(0), 1.0 - apply(1)]
}

#[test]
fn texture_transforms_are_those_of_the_other_v() {
    // The examples of the extension: the lower left quadrant, turned; and v turned around.
    let quadrant = json!({"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5]});
    near(transformed(&quadrant, [0.0, 0.0]), &[0.0, 1.0]);
    near(transformed(&quadrant, [1.0, 0.0]), &[0.0, 0.5]);
    near(transformed(&quadrant, [0.0, 1.0]), &[0.5, 1.0]);
    let turned = json!({"offset": [0, 1], "scale": [1, -1]});
    near(transformed(&turned, [0.3, 0.2]), &[0.3, 0.8]);
    near(transformed(&json!({"offset": [0.5, 0.25], "scale": [2, 4]}), [0.1, 0.2]), &[0.7, 1.05]);
}

#[test]
fn a_mesh_brings_the_coordinates_that_its_textures_are_on() {
    let material = json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}},
        "normalTexture": {"index": 0},
    });
    let mut file = with_material(&material, &json!({}));
    file["meshes"][0]["primitives"][0]["attributes"] =
        json!({"POSITION": 0, "TEXCOORD_0": 9, "TEXCOORD_1": 1});
    let (converted, _) = ok(&file);
    assert_eq!(
        untranslated(&converted),
        ["materials[0].normalTexture: a texture on TEXCOORD_0; a mesh has one set, this one TEXCOORD_1"]
    );
}

#[test]
fn images_that_karst_cannot_read_are_noted() {
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let webp = json!({"images": [{"uri": "data:image/webp;base64,UklGRg=="}]});
    let (converted, _) = ok(&with_material(&material, &webp));
    assert_eq!(untranslated(&converted), ["images[0]: the image is neither PNG nor JPEG"]);
    let basis = json!({"textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]});
    let (converted, _) = ok(&with_material(&material, &basis));
    assert_eq!(untranslated(&converted), ["textures[0]: has no PNG or JPEG image, only KHR_texture_basisu"]);
}

#[test]
fn files_beside_the_scene_are_named_and_those_elsewhere_refused() {
    let folder = tempfile::tempdir().unwrap();
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let write = |uri: &str| {
        let file = with_material(&material, &json!({"images": [{"uri": uri}]}));
        let path = folder.path().join("scene.gltf");
        std::fs::write(&path, file.to_string()).unwrap();
        crate::convert(&path).map_err(|error| error.to_string())
    };
    std::fs::create_dir(folder.path().join("more")).unwrap();
    std::fs::write(folder.path().join("more/a b.png"), PNG).unwrap();
    let converted = write("more/a%20b.png").unwrap();
    assert_eq!(converted.assets["textures/0-a20b.png"], Asset::File(folder.path().join("more/a b.png")));
    for (uri, expected) in [
        ("../a.png", "expected a file in the scene's folder or below"),
        ("/etc/passwd", "expected a file in the scene's folder or below"),
        ("file:///etc/passwd", "expected a file in the scene's folder or below"),
        ("%2e%2e/a.png", "expected a file in the scene's folder or below"),
        ("missing.png", "images[0]: \"missing.png\": "),
    ] {
        let found = write(uri).unwrap_err();
        assert!(found.contains(expected), "{found}");
    }
}
