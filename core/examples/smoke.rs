use glam::{DAffine3, DVec3, Vec3};
use karst_core::color::View;
use karst_core::render::*;
use karst_core::scene::*;
struct Quiet;
impl FrameObserver for Quiet {}
fn main() {
    let spp: u32 = std::env::args().nth(1).unwrap().parse().unwrap();
    let d = Description {
        origin: "x".into(),
        camera: Camera::Perspective {
            vfov: 60.0,
            transform: DAffine3::IDENTITY,
            lens_radius: 0.0,
            focus_distance: 1.0,
        },
        film: Film {
            width: 128,
            height: 128,
            crop: None,
            filter: Filter::Box { radius: 0.5 },
            exposure: 0.0,
            view: View::Standard,
        },
        sampling: Sampling { goal: Goal::Fixed { spp }, seed: 1, time_limit: None },
        integrator: Integrator { max_depth: 64, roulette_depth: 5 },
        materials: [(
            "m".to_string(),
            Material::Diffuse { reflectance: ColorTexture::Constant(Vec3::splat(0.5)) },
        )]
        .into_iter()
        .collect(),
        meshes: Named::default(),
        instances: Named::default(),
        spheres: [(
            "s".to_string(),
            Sphere {
                center: Vec3::ZERO,
                radius: 2.0,
                material: "m".into(),
                emission: Vec3::splat(0.5),
                flip_normals: true,
            },
        )]
        .into_iter()
        .collect(),
        sdf_objects: Named::default(),
        lights: Named::default(),
    };
    let scene = Scene::build(&d, &Assets::default(), 1).unwrap();
    let film = render_frame(&scene, 32, &Default::default(), &Quiet).unwrap();
    let p = film.picture();
    let mean: f64 = p.color.iter().map(|c| c.x as f64).sum::<f64>() / p.color.len() as f64;
    println!("mean {mean} {:?}", film.summary());
    let _ = DVec3::ZERO;
}
