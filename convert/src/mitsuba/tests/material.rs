//! Materials and textures of small scenes.

use serde_json::json;

use super::{SENSOR, folder, material, near, notes, older, scene, within};
use crate::NoteKind;

#[test]
fn materials_become_these() {
    let air = 1.000_277;
    for (bsdf, expected) in [
        (
            "<bsdf type='diffuse'/>",
            json!({"type": "diffuse", "reflectance": [0.5, 0.5, 0.5], "two_sided": false}),
        ),
        (
            "<bsdf type='twosided'><bsdf type='diffuse'><float name='reflectance' value='0.2'/></bsdf></bsdf>",
            json!({"type": "diffuse", "reflectance": [0.2, 0.2, 0.2], "two_sided": true}),
        ),
        ("<bsdf type='dielectric'/>", json!({"type": "dielectric", "ior": 1.5046 / air})),
        (
            "<bsdf type='roughdielectric'><string name='int_ior' value='water'/><string name='ext_ior' value='vacuum'/></bsdf>",
            json!({"type": "dielectric", "ior": 1.333, "alpha": 0.1, "distribution": "beckmann"}),
        ),
        (
            "<bsdf type='dielectric'><float name='int_ior' value='1.3'/><float name='ext_ior' value='1.3'/></bsdf>",
            json!({"type": "null"}),
        ),
        ("<bsdf type='null'/>", json!({"type": "null"})),
        (
            "<bsdf type='thindielectric'><rgb name='specular_transmittance' value='1 0.5 0'/></bsdf>",
            json!({"type": "thin_dielectric", "ior": 1.5046 / air, "specular_transmittance": [1.0, 0.5, 0.0]}),
        ),
        ("<bsdf type='conductor'/>", json!({"type": "conductor", "two_sided": false})),
        (
            "<bsdf type='roughconductor'><rgb name='eta' value='1 2 3'/><string name='distribution' value='ggx'/><float \
             name='alpha_u' value='0.2'/><float name='alpha_v' value='0.3'/></bsdf>",
            json!({"type": "conductor", "eta": [1.0, 2.0, 3.0], "k": [1.0, 1.0, 1.0], "alpha": 0.2, "alpha_v": 0.3,
                "distribution": "ggx", "two_sided": false}),
        ),
        (
            "<bsdf type='plastic'><boolean name='nonlinear' value='true'/></bsdf>",
            json!({"type": "plastic", "diffuse_reflectance": [0.5, 0.5, 0.5], "ior": 1.49 / air, "nonlinear": true,
                "two_sided": false}),
        ),
        (
            "<bsdf type='disneybsdf'><rgb name='baseColor' value='0.1 0.2 0.3'/><float name='clearcoatGloss' value='0.4'/>\
             <float name='eta' value='1.4'/></bsdf>",
            json!({"type": "principled_bsdf", "base_color": [0.1, 0.2, 0.3], "specular_transmission": 0.0,
                "metallic": 0.0, "subsurface": 0.0, "specular": 0.5, "roughness": 0.5, "specular_tint": 0.0,
                "anisotropic": 0.0, "sheen": 0.0, "sheen_tint": 0.5, "clearcoat": 0.0, "clearcoat_gloss": 0.4,
                "eta": 1.4, "two_sided": false}),
        ),
        (
            "<bsdf type='disneyglass'><float name='roughness' value='0.3'/></bsdf>",
            json!({"type": "disney_glass", "base_color": [0.5, 0.5, 0.5], "roughness": 0.3, "anisotropic": 0.0,
                "eta": 1.5}),
        ),
        (
            "<bsdf type='disneyclearcoat'/>",
            json!({"type": "disney_clearcoat", "clearcoat_gloss": 1.0, "two_sided": false}),
        ),
        (
            "<bsdf type='mask'><float name='opacity' value='0.3'/><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></bsdf>",
            json!({"type": "diffuse", "reflectance": [0.5, 0.5, 0.5], "two_sided": true, "opacity": 0.3}),
        ),
    ] {
        let bsdf = bsdf.replacen("<bsdf", "<bsdf id='m'", 1);
        let found = scene(&bsdf).unwrap();
        assert_eq!(found.document["materials"]["m"], expected, "{bsdf}");
        assert!(notes(&found).is_empty(), "{bsdf}: {:?}", notes(&found));
    }
}

#[test]
fn metals_have_their_indices() {
    let gold = material("<bsdf type='conductor'><string name='material' value='Au'/></bsdf>");
    assert_eq!(gold["k"][0], 3.983_160_424_7);
    assert!(
        material("<bsdf type='conductor'><string name='material' value='none'/></bsdf>").get("eta").is_none()
    );
    let old = older("<bsdf type='conductor' id='m'/>").unwrap();
    // Copper, in air.
    near(&old.document["materials"]["m"]["eta"][0], 0.200_437_697 / 1.000_277);
}

#[test]
fn mitsubas_principled_is_said_to_differ() {
    let found = scene("<bsdf type='principled' id='m'><float name='specular' value='0.5'/><float name='spec_tint' value='0.2'/></bsdf>").unwrap();
    let material = &found.document["materials"]["m"];
    near(&material["eta"], 2.0 / (1.0 - 0.2) - 1.0);
    assert_eq!((&material["specular_tint"], &material["sheen_tint"]), (&json!(0.2), &json!(0.0)));
    assert_eq!((&material["specular"], &material["clearcoat_gloss"]), (&json!(1.0), &json!(0.0)));
    assert!(found.notes.len() == 1 && found.notes[0].kind == NoteKind::Differs);
}

#[test]
fn textures_keep_their_way_up() {
    let files = [("a.png", ""), ("n.exr", "")];
    let with = |inner: &str| {
        let mut files = files.to_vec();
        let text =
            format!("<scene version='3.0.0'>{SENSOR}<bsdf type='diffuse' id='m'>{inner}</bsdf></scene>");
        files.push(("scene.xml", &text));
        within(&folder(&files)).unwrap().document["materials"]["m"]["reflectance"].clone()
    };
    let bitmap = |inner: &str| with(&format!("<texture name='reflectance' type='bitmap'>{inner}</texture>"));
    let plain = json!({"type": "image", "file": "textures/a.png", "color_space": "srgb"});
    assert_eq!(bitmap("<string name='filename' value='a.png'/>"), plain);
    let linear = bitmap("<string name='filename' value='a.png'/><boolean name='raw' value='true'/>");
    assert_eq!(linear["color_space"], "linear");
    assert_eq!(bitmap("<string name='filename' value='n.exr'/>")["color_space"], "linear");
    let shifted = bitmap(
        "<string name='filename' value='a.png'/><string name='wrap_mode' value='clamp'/><string name='filter_type' \
         value='nearest'/><transform name='to_uv'><scale x='2' y='4'/><translate x='0.5' y='0.25'/></transform>",
    );
    // u' = 2u + 1/2; with v = 1 - w upwards, v' = 4v + 1/4 is w' = 4w - 13/4.
    assert_eq!(shifted["transform"]["matrix"], json!([[2.0, 0.0, 0.5], [0.0, 4.0, -3.25]]));
    assert_eq!((&shifted["wrap"], &shifted["filter"]), (&json!("clamp"), &json!("nearest")));
    let board =
        with("<texture name='reflectance' type='checkerboard'><rgb name='color1' value='1'/></texture>");
    let expected = json!({"type": "checkerboard", "color0": [0.4, 0.4, 0.4], "color1": [1.0, 1.0, 1.0],
        "transform": {"matrix": [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]]}});
    assert_eq!(board, expected);
    let old = with(
        "<texture name='reflectance' type='checkerboard'><float name='uscale' value='10'/><float name='voffset' \
         value='0.5'/></texture>",
    );
    assert_eq!(old["transform"]["matrix"], json!([[10.0, 0.0, 0.0], [0.0, -1.0, 1.5]]));
}

#[test]
fn maps_and_bumps_become_fields_of_the_material() {
    let text = format!(
        "<scene version='3.0.0'>{SENSOR}<texture type='bitmap' id='t'><string name='filename' value='a.png'/><boolean \
         name='raw' value='true'/></texture><bsdf type='bumpmap' id='b'><ref id='t'/><float name='scale' value='2'/><bsdf \
         type='diffuse'/></bsdf><bsdf type='normalmap' id='n'><ref name='normalmap' id='t'/><bsdf type='diffuse'/></bsdf>\
         <bsdf type='bumpmap' id='o'><texture type='scale'><float name='scale' value='3'/><ref id='t'/></texture><bsdf \
         type='diffuse'/></bsdf></scene>"
    );
    let found = within(&folder(&[("scene.xml", &text), ("a.png", "")])).unwrap();
    assert!(notes(&found).is_empty(), "{:?}", notes(&found));
    let materials = &found.document["materials"];
    let image = json!({"type": "image", "file": "textures/a.png", "color_space": "linear"});
    assert_eq!((&materials["b"]["bump"], &materials["b"]["bump_scale"]), (&image, &json!(2.0)));
    assert_eq!((&materials["o"]["bump"], &materials["o"]["bump_scale"]), (&image, &json!(3.0)));
    assert_eq!(materials["n"]["normal_map"], image);
}

#[test]
fn other_curves_than_that_of_srgb_are_told() {
    let files = [("a.png", ""), ("n.exr", "")];
    for (name, gamma, space, note) in [
        ("a.png", "-1", "srgb", None),
        ("a.png", "1", "linear", None),
        ("a.png", "2.2", "srgb", Some("a texture with the gamma 2.2: taken as sRGB")),
        ("n.exr", "1", "linear", None),
        ("n.exr", "-1", "linear", Some("a texture with the gamma -1: taken as numbers as they are")),
    ] {
        let text = format!(
            "<scene version='0.6.0'>{SENSOR}<bsdf type='diffuse' id='m'><texture name='reflectance' type='bitmap'>\
             <string name='filename' value='{name}'/><float name='gamma' value='{gamma}'/></texture></bsdf></scene>"
        );
        let mut files = files.to_vec();
        files.push(("scene.xml", &text));
        let found = within(&folder(&files)).unwrap();
        assert_eq!(found.document["materials"]["m"]["reflectance"]["color_space"], space, "{name} {gamma}");
        let expected: Vec<String> = note.map(|note| format!("1 Differs {note}")).into_iter().collect();
        assert_eq!(notes(&found), expected, "{name} {gamma}");
    }
}
