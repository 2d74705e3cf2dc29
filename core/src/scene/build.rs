//! Owns compiling: a description and its assets to a scene that rays can ask.

use super::assets::Assets;
use super::compiled::{Color, Material, Scene};
use super::document::{self as doc, ColorTexture, Description, Problem, Problems};
use super::object::{Object, Shape};
use super::tape;
use crate::bvh::Bvh;
use crate::camera::{Camera, Perspective};
use crate::film::{FilterKind, FrameSize, PixelFilter, Region};
use crate::light::{EnvironmentLight, Light, Lights, MeshLight, SphereLight};
use crate::math::{Aabb, Transform};
use crate::sampler::Stream;
use crate::sdf::{Sdf, Settings};
use glam::{DAffine3, Vec3};

impl Scene {
    /// Compiles one frame. `frame` takes part in the random numbers; the description is already that frame's.
    ///
    /// # Errors
    /// Every object that cannot be compiled, by its path in the document.
    pub fn build(description: &Description, assets: &Assets, frame: i32) -> Result<Self, Problems> {
        let mut builder = Builder {
            description,
            assets,
            problems: Problems::default(),
            objects: Vec::new(),
            lights: Vec::new(),
        };
        let camera = builder.camera();
        let materials = builder.materials();
        builder.instances();
        builder.spheres();
        builder.sdf_objects();
        builder.environments();
        let Builder { mut problems, objects, lights, .. } = builder;
        let boxes: Vec<Aabb> = objects.iter().map(Object::bounds).collect();
        let tree = Bvh::build(&boxes).map_err(|e| problems.push(problem(description, "", e.to_string())));
        let (Some(camera), Ok(tree), true) = (camera, tree, problems.is_empty()) else {
            return Err(problems);
        };
        let environments = (0..lights.len() as u32)
            .filter(|&i| matches!(lights[i as usize], Light::Environment(_)))
            .collect();
        let film = &description.film;
        Ok(Self {
            size: frame_size(description),
            window: window(description),
            sampling: description.sampling.clone(),
            exposure: film.exposure,
            view: film.view,
            camera,
            filter: filter(film.filter),
            max_depth: description.integrator.max_depth,
            roulette_depth: description.integrator.roulette_depth,
            lights: Lights::new(lights, &tree.bounds()),
            objects,
            tree,
            materials,
            environments,
            stream: Stream::new(description.sampling.seed, frame),
        })
    }
}

/// Gathers objects and lights, and everything that is wrong with them.
struct Builder<'a> {
    description: &'a Description,
    assets: &'a Assets,
    problems: Problems,
    objects: Vec<Object>,
    lights: Vec<Light>,
}

impl Builder<'_> {
    fn problem(&mut self, path: &str, message: &str) {
        self.problems.push(problem(self.description, path, message.to_owned()));
    }

    fn transform(&mut self, path: &str, to_world: DAffine3) -> Option<Transform> {
        let transform = Transform::new(to_world);
        if transform.is_none() {
            self.problem(path, "found a transform that cannot be inverted, expected one that can");
        }
        transform
    }

    fn camera(&mut self) -> Option<Camera> {
        let doc::Camera::Perspective { vfov, transform, lens_radius, focus_distance } =
            self.description.camera;
        let transform = self.transform("camera.transform", transform)?;
        let view = Perspective { transform, vfov, lens_radius, focus_distance };
        Some(Camera::new(view, frame_size(self.description)))
    }

    fn materials(&mut self) -> Vec<Material> {
        let description = self.description;
        let compile = |(name, material): (&str, &doc::Material)| match material {
            doc::Material::Diffuse { reflectance } => {
                let path = format!("materials.{name}.reflectance");
                self.color(&path, reflectance).map(|reflectance| Material::Diffuse { reflectance })
            }
        };
        description.materials.iter().filter_map(compile).collect()
    }

    fn color(&mut self, path: &str, color: &ColorTexture) -> Option<Color> {
        match color {
            ColorTexture::Constant(c) => Some(Color::Constant(*c)),
            ColorTexture::Image { file, color_space } => {
                let image = self.assets.image(file);
                if image.is_none() {
                    self.problem(path, &format!("the image {file} has not been loaded"));
                }
                image.map(|image| Color::Image(image, *color_space))
            }
        }
    }

    /// Adds an object, and the light that it is.
    fn add(&mut self, shape: Shape, material: &str, flip: bool, light: Option<Light>) {
        let light = light.map(|light| {
            self.lights.push(light);
            self.lights.len() as u32 - 1
        });
        let material = self.description.materials.index_of(material).unwrap_or(0) as u32;
        self.objects.push(Object { shape, material, light, flip });
    }

    fn instances(&mut self) {
        let description = self.description;
        for (name, instance) in description.instances.iter() {
            let path = format!("instances.{name}");
            let file = description.meshes.get(&instance.mesh).map_or("", |m| m.file.as_str());
            let Some(mesh) = self.assets.mesh(file) else {
                self.problem(&path, &format!("the mesh {file} has not been loaded"));
                continue;
            };
            let Some(transform) = self.transform(&path, instance.transform) else { continue };
            if mesh.mesh.triangles.is_empty() {
                continue;
            }
            let light = (instance.emission.max_element() > 0.0)
                .then(|| mesh_light(&mesh.mesh, &transform, instance))
                .flatten();
            self.add(Shape::Mesh { mesh, transform }, &instance.material, instance.flip_normals, light);
        }
    }

    fn spheres(&mut self) {
        let description = self.description;
        for sphere in description.spheres.values() {
            let doc::Sphere { center, radius, emission, flip_normals, .. } = *sphere;
            let light = (emission.max_element() > 0.0).then_some(Light::Sphere(SphereLight {
                center,
                radius,
                radiance: emission,
                inward: flip_normals,
            }));
            self.add(Shape::Sphere { center, radius }, &sphere.material, flip_normals, light);
        }
    }

    fn sdf_objects(&mut self) {
        let description = self.description;
        for (name, object) in description.sdf_objects.iter() {
            let path = format!("sdf_objects.{name}");
            let doc::SdfSettings { hit_epsilon, normal_epsilon, step_clamp, max_steps } = object.settings;
            let settings = Settings { hit_epsilon, normal_epsilon, step_clamp, max_steps };
            let bounds = object.bounds.map(|b| Aabb { min: b.min, max: b.max });
            let sdf = tape::compile(&object.tree).and_then(|tape| Sdf::new(tape, settings, bounds));
            let transform = self.transform(&path, object.transform);
            match (sdf, transform) {
                (Ok(sdf), Some(transform)) => {
                    self.add(Shape::Sdf { sdf: Box::new(sdf), transform }, &object.material, false, None);
                }
                (Err(error), _) => self.problem(&path, &error.to_string()),
                (Ok(_), None) => {}
            }
        }
    }

    fn environments(&mut self) {
        for light in self.description.lights.values() {
            let doc::Light::Environment { radiance } = light;
            if radiance.max_element() > 0.0 {
                self.lights.push(Light::Environment(EnvironmentLight { radiance: *radiance }));
            }
        }
    }
}

/// The light of a placed mesh; corners are reordered so that they run counter-clockwise in the world.
fn mesh_light(mesh: &crate::mesh::Mesh, transform: &Transform, instance: &doc::Instance) -> Option<Light> {
    let turned = transform.flips() != instance.flip_normals;
    let place = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|i| transform.point(mesh.positions[i as usize]));
        if turned { [a, c, b] } else { [a, b, c] }
    };
    let triangles: Vec<[Vec3; 3]> = mesh.triangles.iter().map(place).collect();
    MeshLight::new(triangles, instance.emission).map(Light::Mesh)
}

fn problem(description: &Description, path: &str, message: String) -> Problem {
    Problem::new(description.origin.clone(), path, message)
}

fn frame_size(description: &Description) -> FrameSize {
    FrameSize { width: description.film.width, height: description.film.height }
}

fn window(description: &Description) -> Region {
    let whole = frame_size(description).region();
    description.film.crop.map_or(whole, |c| {
        Region { x0: c.x, y0: c.y, x1: c.x.saturating_add(c.width), y1: c.y.saturating_add(c.height) }
            .intersection(&whole)
    })
}

fn filter(filter: doc::Filter) -> PixelFilter {
    match filter {
        doc::Filter::Box { radius } => PixelFilter::new(FilterKind::Box, radius),
        doc::Filter::Gaussian { radius } => PixelFilter::new(FilterKind::Gaussian, radius),
        doc::Filter::BlackmanHarris { radius } => PixelFilter::new(FilterKind::BlackmanHarris, radius),
    }
}
