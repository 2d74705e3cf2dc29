//! Owns the tests of what valid documents mean.

use glam::{DAffine2, DAffine3, DVec2, DVec3, Vec3};

use super::{frame, parse, scene};
use crate::color::View;
use crate::light::SpotFalloff;
use crate::scene::document::decode::Decode;
use crate::scene::document::{
    Camera, ColorTexture, Crop, Document, ErrorOf, Filter, Goal, Integrator, Light, Limits, Medium, Model,
    NumberTexture, Sampling, SdfNode, SdfSettings, Texture,
};
use crate::texture::{Channel, ColorSpace, TextureFilter, Wrap};

#[test]
fn defaults_are_those_of_the_format() {
    let scene = frame(&scene(""));
    assert_eq!(scene.sampling, Sampling { goal: Goal::Fixed { spp: 64 }, seed: 0, time_limit: None });
    assert_eq!(scene.integrator, Integrator { max_depth: 16, roulette_depth: 2 });
    assert_eq!((scene.film.width, scene.film.height, scene.film.crop), (8, 6, None));
    assert_eq!(scene.film.window(), Crop { x: 0, y: 0, width: 8, height: 6 });
    assert_eq!((scene.film.filter, scene.film.view), (Filter::BlackmanHarris { radius: 1.5 }, View::Filmic));
    let Camera::Perspective { vfov, transform, lens_radius, focus_distance } = scene.camera;
    assert_eq!((vfov, transform, lens_radius, focus_distance), (40.0, DAffine3::IDENTITY, 0.0, 1.0));
    assert!(scene.materials.is_empty() && scene.lights.is_empty());
    let frames = parse(&super::scene("")).frames();
    assert_eq!((frames.first, frames.last), (1, 1));
}

#[test]
fn every_kind_of_thing_is_read() {
    let scene = frame(&scene(
        r#""sampling":{"target_error":0.1,"min_spp":4,"seed":9,"time_limit":2.5},
        "materials":{"a":{"type":"diffuse","reflectance":{"type":"image","file":"t/a.PNG","color_space":"linear"}},
                     "b":{"type":"diffuse"}},
        "meshes":{"m":{"file":"m.ply"}},
        "instances":{"i":{"mesh":"m","material":"b","emission":[1,2,3],"flip_normals":true}},
        "spheres":{"s":{"center":[1,2,3],"radius":0.25,"material":"a"}},
        "sdf_objects":{"o":{"material":"a","bounds":"auto","settings":{"max_steps":"auto","step_clamp":0.5},
            "tree":{"type":"union","children":{"t":{"type":"torus","major_radius":1,"minor_radius":0.25},
                                               "b":{"type":"mandelbulb"}}}}},
        "lights":{"sky":{"type":"environment","radiance":[1,1,1]}}"#,
    ));
    let goal = Goal::Error { target: 0.1, min_spp: 4, max_spp: 1024, of: ErrorOf::Noisy };
    assert_eq!(scene.sampling, Sampling { goal, seed: 9, time_limit: Some(2.5) });
    let image = Texture::Image {
        file: "t/a.PNG".to_owned(),
        color_space: Some(ColorSpace::Linear),
        channel: Channel::Luminance,
        wrap: Wrap::Repeat,
        filter: TextureFilter::Bilinear,
        transform: DAffine2::IDENTITY,
    };
    let model = |name: &str| scene.materials.get(name).map(|material| material.model.clone());
    let reflectance = ColorTexture::Texture(Box::new(image));
    assert_eq!(model("a"), Some(Model::Diffuse { reflectance, two_sided: true }));
    let reflectance = ColorTexture::Constant(Vec3::splat(0.5));
    assert_eq!(model("b"), Some(Model::Diffuse { reflectance, two_sided: true }));
    assert_eq!(
        scene.instances.get("i").map(|i| (i.emission, i.flip_normals)),
        Some((Vec3::new(1.0, 2.0, 3.0), true))
    );
    assert_eq!(scene.spheres.get("s").map(|s| (s.center, s.radius)), Some((Vec3::new(1.0, 2.0, 3.0), 0.25)));
    let object = scene.sdf_objects.get("o").unwrap();
    assert_eq!(object.settings, SdfSettings { step_clamp: Some(0.5), ..SdfSettings::AUTO });
    assert_eq!((object.bounds, object.tree.size()), (None, (3, 2)));
    let SdfNode::Union { children } = &object.tree else { panic!("{:?}", object.tree) };
    assert_eq!(children.index_of("b"), Some(1));
    assert_eq!(children.get("b"), Some(&SdfNode::Mandelbulb { power: 8.0, iterations: 12, bailout: 4.0 }));
    let sky = Light::Environment {
        radiance: Vec3::ONE,
        image: None,
        rows_at_poles: false,
        transform: DAffine3::IDENTITY,
    };
    assert_eq!(scene.lights.get("sky"), Some(&sky));
}

#[test]
fn media_fill_space_and_the_inside_of_things() {
    let scene = frame(&scene(
        r#""media":{"fog":{"sigma_s":[0.1,0.2,0.3],"g":0.5},"ink":{"sigma_a":[1,2,3],"density":4}},"medium":"fog",
            "materials":{"b":{"type":"diffuse"}},
            "spheres":{"s":{"center":[1,2,3],"radius":0.25,"material":"b","interior":"ink"}}"#,
    ));
    let fog = Medium { sigma_a: Vec3::ZERO, sigma_s: Vec3::new(0.1, 0.2, 0.3), density: 1.0, g: 0.5 };
    let ink = Medium { sigma_a: Vec3::new(1.0, 2.0, 3.0), sigma_s: Vec3::ZERO, density: 4.0, g: 0.0 };
    assert_eq!((scene.media.get("fog"), scene.media.get("ink")), (Some(&fog), Some(&ink)));
    assert_eq!(scene.medium.as_deref(), Some("fog"));
    assert_eq!(scene.spheres.get("s").unwrap().interior.as_deref(), Some("ink"));
}

#[test]
fn a_material_has_a_model_and_a_relief() {
    let scene = frame(&scene(
        r#""materials":{"p":{"type":"principled_bsdf","roughness":{"type":"checkerboard","color0":0.25,
            "color1":[0,0,1],"transform":{"scale":[2,4],"rotate":90,"translate":[1,0]}},
            "opacity":0.25,"bump":{"type":"fbm"},"bump_scale":0.5}}"#,
    ));
    let material = scene.materials.get("p").unwrap();
    assert_eq!(material.relief.opacity, NumberTexture::Constant(0.25));
    assert!(material.relief.bump.is_some() && material.relief.normal_map.is_none());
    let Model::Principled { roughness: NumberTexture::Texture(texture), eta, two_sided, .. } =
        &material.model
    else {
        panic!("{:?}", material.model)
    };
    assert_eq!((eta, two_sided), (&NumberTexture::Constant(1.5), &false));
    let Texture::Checkerboard { color0, color1, transform } = **texture else { panic!("{texture:?}") };
    assert_eq!((color0.0, color1.0), (Vec3::splat(0.25), Vec3::Z));
    // (1, 1) is scaled to (2, 4), turned to (-4, 2), moved to (-3, 2).
    assert!((transform.transform_point2(DVec2::ONE) - DVec2::new(-3.0, 2.0)).length() < 1.0e-12);
}

/// What a spotlight with these fields is, or what is wrong with it.
fn spotlight(fields: &str) -> Result<SpotFalloff, String> {
    let light = format!(r#"{{"type":"spotlight","position":[0,0,0],"direction":[0,-2,0],{fields}}}"#);
    let text = scene(&format!(r#""lights":{{"l":{light}}}"#));
    let document = Document::parse(&text, "scene.json", &Limits::default()).map_err(|p| p.to_string())?;
    let frame = document.at(1).unwrap();
    frame.lights.get("l").unwrap().falloff().map_err(ToOwned::to_owned)
}

#[test]
fn a_spotlight_has_one_falloff() {
    let focus = SpotFalloff::Focus { focus: 3.0, cutoff_angle: 90.0 };
    assert_eq!(spotlight(r#""radiance":[1,1,1],"focus":3"#), Ok(focus));
    let linear = SpotFalloff::Linear { beam_width: 10.0, cutoff_angle: 20.0 };
    assert_eq!(spotlight(r#""intensity":[1,1,1],"beam_width":10,"cutoff_angle":20"#), Ok(linear));
    let blend = SpotFalloff::Blend { cone_angle: 40.0, blend: 0.5 };
    assert_eq!(spotlight(r#""intensity":[1,1,1],"cone_angle":40,"blend":0.5"#), Ok(blend));
    for (fields, wrong) in [
        (r#""focus":1"#, "either"),
        (r#""intensity":[1,1,1],"radiance":[1,1,1]"#, "either"),
        (r#""intensity":[1,1,1],"focus":1,"beam_width":5"#, "exclude each other"),
        (r#""intensity":[1,1,1],"beam_width":5"#, "needs"),
        (r#""intensity":[1,1,1],"beam_width":5,"cutoff_angle":4"#, "less than"),
        (r#""intensity":[1,1,1],"blend":0.5"#, "only with"),
        (r#""intensity":[1,1,1],"cone_angle":40,"cutoff_angle":4"#, "both say"),
    ] {
        let found = spotlight(fields).unwrap_err();
        assert!(found.contains(wrong) && found.contains("lights.l"), "{fields}: {found}");
    }
}

/// The transform of the camera when it is written like this.
fn transform(written: &str) -> DAffine3 {
    let camera =
        format!(r#"{{"version":1,"camera":{{"type":"perspective","vfov":40,"transform":{written}}},"#);
    let Camera::Perspective { transform, .. } = frame(&(camera + r#""film":{"width":8,"height":6}}"#)).camera;
    transform
}

#[test]
fn transforms_mean_what_the_page_says() {
    let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1.0e-12, "{a} {b}");
    // Scale first, then x, y, z, then the translation: x goes to 2x, which turns about z to 2y, then moves.
    let map = transform(r#"{"translate":[1,2,3],"rotate":[0,0,90],"scale":2}"#);
    near(map.transform_point3(DVec3::X), DVec3::new(1.0, 4.0, 3.0));
    // y turns about x to z, and z about y to x.
    near(transform(r#"{"rotate":[90,90,0]}"#).transform_point3(DVec3::Y), DVec3::X);
    near(transform(r#"{"scale":[1,2,3]}"#).transform_point3(DVec3::ONE), DVec3::new(1.0, 2.0, 3.0));
    let map = transform(r#"{"matrix":[[0,-1,0,5],[1,0,0,6],[0,0,1,7],[0,0,0,1]]}"#);
    near(map.transform_point3(DVec3::X), DVec3::new(5.0, 7.0, 7.0));
    let map = transform(r#"{"look_at":{"eye":[0,1,5],"target":[0,1,0]}}"#);
    near(map.transform_point3(DVec3::ZERO), DVec3::new(0.0, 1.0, 5.0));
    near(map.transform_vector3(DVec3::NEG_Z), DVec3::NEG_Z);
    near(map.transform_vector3(DVec3::Y), DVec3::Y);
    let map = transform(r#"{"look_at":{"eye":[3,0,0],"target":[0,0,0],"up":[1,0,9]}}"#);
    near(map.transform_vector3(DVec3::NEG_Z), DVec3::NEG_X);
    near(map.transform_vector3(DVec3::Y), DVec3::Z);
    assert!((map.matrix3.determinant() - 1.0).abs() < 1.0e-12);
    assert_eq!(transform("{}"), DAffine3::IDENTITY);
}

#[test]
fn what_is_shown_reads_the_same() {
    let example = parse(crate::scene::document::reference::EXAMPLE).at(20).unwrap();
    let shown = serde_json::json!({
        "version": 1,
        "camera": example.camera.show(),
        "film": example.film.show(),
        "sampling": example.sampling.show(),
        "integrator": example.integrator.show(),
        "materials": example.materials.show(),
        "meshes": example.meshes.show(),
        "instances": example.instances.show(),
        "spheres": example.spheres.show(),
        "sdf_objects": example.sdf_objects.show(),
        "lights": example.lights.show(),
    });
    assert_eq!(frame(&shown.to_string()), example);
}

#[test]
fn a_file_that_is_named_twice_is_one_asset() {
    let document =
        parse(&scene(r#""meshes":{"a":{"file":"m.obj"},"b":{"file":"m.obj"},"c":{"file":"n.obj"}}"#));
    assert_eq!(document.assets().iter().map(|asset| &asset.path).collect::<Vec<_>>(), ["m.obj", "n.obj"]);
}
