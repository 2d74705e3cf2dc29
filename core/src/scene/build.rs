//! Owns compiling: a description and its assets to a scene that rays can ask.

use super::assets::Assets;
use super::compiled::{Scene, Strategy};
use super::document::{self as doc, Description, Problem, Problems};
use super::material::Material;
use super::materials;
use super::media::Media;
use super::object::{Object, Shape};
use super::tape;
use super::trees::Trees;
use crate::camera::{Camera, Perspective};
use crate::film::{FilterKind, FrameSize, PixelFilter, Region};
use crate::light::{self, EnvironmentLight, Light, Lights, PointLight, SphereLight, SpotLight, SunLight};
use crate::math::{Aabb, Transform};
use crate::medium::Medium;
use crate::mesh::Mesh;
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
            materials: Vec::new(),
            objects: Vec::new(),
            fillings: Vec::new(),
            lights: Vec::new(),
            emitters: Vec::new(),
        };
        let camera = builder.camera();
        builder.materials = materials::compile(description, assets, &mut builder.problems);
        builder.instances();
        builder.spheres();
        builder.sdf_objects(camera.as_ref());
        builder.lights();
        let around = description.medium.as_ref().and_then(|name| builder.medium(name));
        let Builder { mut problems, materials, mut objects, fillings, lights, emitters, .. } = builder;
        let trees = Trees::new(&objects, assets.kept())
            .map_err(|e| problems.push(problem(description, "", e.to_string())));
        let (Some(camera), Ok(trees), true) = (camera, trees, problems.is_empty()) else {
            return Err(problems);
        };
        // Through fog without end no light would come from infinity.
        let endless = lights.iter().all(|light| !light.is_infinite());
        let everything = lights.iter().filter_map(Light::bounds).fold(trees.tree.bounds(), Aabb::union);
        let everything = (!endless).then_some(everything);
        let many = lights.len() > Lights::WEIGH_ALL;
        let places = lights.iter().map(|light| light.bounds().map_or(Vec3::ZERO, |bounds| bounds.center()));
        let places: Vec<Vec3> = if many { Vec::new() } else { places.collect() };
        let media = Media::new(&mut objects, &fillings, around, (everything, camera.position()), &places);
        let has_holes = objects.iter().any(|object| object.holes);
        let function_names = description.sdf_objects.iter().map(|(name, _)| name.to_owned()).collect();
        let film = &description.film;
        let lights = Lights::new(lights, &trees.tree.bounds());
        let has_lobes = media.is_some() || materials.iter().any(Material::has_lobes);
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
            sides: lights.has_both_sides(),
            lights,
            objects,
            trees,
            materials,
            emitters,
            has_holes,
            has_lobes,
            media,
            function_names,
            stream: Stream::new(description.sampling.seed, frame),
            strategy: Strategy::default(),
        })
    }
}

/// Gathers objects and lights, and everything that is wrong with them.
struct Builder<'a> {
    description: &'a Description,
    assets: &'a Assets,
    problems: Problems,
    materials: Vec<Material>,
    objects: Vec<Object>,
    /// What fills each object.
    fillings: Vec<Option<Medium>>,
    lights: Vec<Light>,
    emitters: Vec<u32>,
}

impl Builder<'_> {
    fn problem(&mut self, path: &str, message: &str) {
        self.problems.push(problem(self.description, path, message.to_owned()));
    }

    /// The medium of that name, its coefficients by world unit.
    fn medium(&mut self, name: &str) -> Option<Medium> {
        let &doc::Medium { sigma_a, sigma_s, density, g } = self.description.media.get(name)?;
        let most = ((sigma_a + sigma_s) * density).max_element();
        if most > Self::DENSEST {
            let message = format!(
                "found a medium that takes {most:e} of the light per world unit, expected {:e} at most",
                Self::DENSEST
            );
            self.problem(&format!("media.{name}.density"), &message);
            return None;
        }
        Some(Medium::new(sigma_a * density, sigma_s * density, g))
    }

    /// Most that a medium takes: what single precision can still square and multiply.
    const DENSEST: f32 = 1e12;

    /// Reports a mesh that is to be filled and leaks. One that has lost triangles without area may be closed but for them.
    fn encloses(&mut self, path: &str, mesh: &Mesh) {
        let open = mesh.open_edges();
        if open > 0 && mesh.dropped == 0 {
            let message = format!(
                "found a mesh with {open} open edges, expected a closed one whose triangles all look outwards: a medium \
                 fills what is inside"
            );
            self.problem(&format!("{path}.interior"), &message);
        }
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

    /// Whether surfaces of a material are there in part only. Sampling a point of a light does not know which part that
    /// is, so that such lights are left to scattered rays.
    fn has_holes(&self, material: &str) -> bool {
        let number = self.description.materials.index_of(material).unwrap_or(0);
        self.materials.get(number).is_some_and(|material| material.opacity.is_some())
    }

    /// Adds an object and the lights that its primitives are; `lights` has one number for each primitive.
    fn add(
        &mut self,
        shape: Shape,
        (material, interior): (&str, Option<&String>),
        flip: bool,
        lights: &[u32],
    ) {
        let filling = interior.and_then(|name| self.medium(name));
        self.fillings.push(filling);
        let emitter = (!lights.is_empty()).then_some(self.emitters.len() as u32);
        let holes = self.has_holes(material);
        self.emitters.extend_from_slice(lights);
        let material = self.description.materials.index_of(material).unwrap_or(0);
        let needs = self.materials.get(material).map(Material::needs).unwrap_or_default();
        self.objects.push(Object {
            shape,
            material: material as u32,
            emitter,
            flip,
            needs,
            holes,
            interior: None,
        });
    }

    fn instances(&mut self) {
        let description = self.description;
        for (name, instance) in description.instances.iter() {
            let path = format!("instances.{name}");
            let Some(entry) = description.meshes.get(&instance.mesh) else { continue };
            let Some(mesh) = self.assets.mesh(&entry.file) else {
                self.problem(&path, &format!("the mesh {} has not been loaded", entry.file));
                continue;
            };
            let Some(transform) = self.transform(&path, instance.transform) else { continue };
            if mesh.mesh.triangles.is_empty() {
                continue;
            }
            if instance.interior.is_some() {
                self.encloses(&path, &mesh.mesh);
            }
            let lights = if instance.emission.max_element() <= 0.0 {
                Vec::new()
            } else if self.has_holes(&instance.material) {
                self.lights.push(Light::Unsampled(instance.emission));
                vec![self.lights.len() as u32 - 1; mesh.mesh.triangles.len()]
            } else {
                self.mesh_lights(&mesh.mesh, &transform, entry.face_normals, instance)
            };
            let shape = Shape::Mesh { mesh, transform, flat: entry.face_normals, flip_v: entry.flip_v };
            self.add(shape, (&instance.material, instance.interior.as_ref()), instance.flip_normals, &lights);
        }
    }

    /// Adds the lights of a placed mesh: their numbers by triangle. Corners are reordered so that they run
    /// counter-clockwise in the world, seen from the front.
    fn mesh_lights(
        &mut self,
        mesh: &Mesh,
        transform: &Transform,
        flat: bool,
        instance: &doc::Instance,
    ) -> Vec<u32> {
        let turned = transform.flips() != instance.flip_normals;
        let place = |(triangle, corners): (usize, &[u32; 3])| {
            let [a, b, c] = corners.map(|i| transform.point(mesh.positions[i as usize]));
            let behind = !flat && mesh.side(triangle) < 0.0;
            if turned == behind { [a, b, c] } else { [a, c, b] }
        };
        let triangles: Vec<[Vec3; 3]> = mesh.triangles.iter().enumerate().map(place).collect();
        let (lights, of) = light::mesh_lights(&triangles, instance.emission);
        let first = self.lights.len() as u32;
        self.lights.extend(lights);
        of.into_iter().map(|light| if light == u32::MAX { light } else { first + light }).collect()
    }

    fn spheres(&mut self) {
        let description = self.description;
        for sphere in description.spheres.values() {
            let doc::Sphere { center, radius, emission, flip_normals, .. } = *sphere;
            let mut lights = Vec::new();
            if emission.max_element() > 0.0 {
                lights.push(self.lights.len() as u32);
                self.lights.push(if flip_normals || self.has_holes(&sphere.material) {
                    Light::Unsampled(emission)
                } else {
                    Light::Sphere(SphereLight { center, radius, radiance: emission })
                });
            }
            let look = (sphere.material.as_str(), sphere.interior.as_ref());
            self.add(Shape::Sphere { center, radius }, look, flip_normals, &lights);
        }
    }

    fn sdf_objects(&mut self, camera: Option<&Camera>) {
        let description = self.description;
        for (number, (name, object)) in (0..).zip(description.sdf_objects.iter()) {
            let path = format!("sdf_objects.{name}");
            let doc::SdfSettings { hit_epsilon, normal_epsilon, step_clamp, max_steps } = object.settings;
            let settings = Settings { hit_epsilon, normal_epsilon, step_clamp, max_steps };
            let bounds = object.bounds.map(|b| Aabb { min: b.min, max: b.max });
            let sdf = tape::compile(&object.tree).and_then(|tape| Sdf::new(tape, settings, bounds));
            let transform = self.transform(&path, object.transform);
            let sdf = sdf.and_then(|sdf| {
                let (Some(camera), Some(transform)) = (camera, &transform) else { return Ok(sdf) };
                sdf.resolves(transform.local_point(camera.position()), camera.pixel_spread()).map(|()| sdf)
            });
            let look = (object.material.as_str(), object.interior.as_ref());
            match (sdf, transform) {
                (Ok(sdf), Some(transform)) => {
                    self.add(Shape::Sdf { sdf: Box::new(sdf), transform, number }, look, false, &[]);
                }
                (Err(error), _) => self.problem(&path, &error.to_string()),
                (Ok(_), None) => {}
            }
        }
    }

    fn lights(&mut self) {
        let description = self.description;
        for (name, light) in description.lights.iter() {
            let compiled = match light {
                doc::Light::Environment { radiance, image, rows_at_poles, transform } => {
                    self.environment(name, *radiance, image.as_deref(), *transform, *rows_at_poles)
                }
                doc::Light::Point { position, intensity } => {
                    Some(Light::Point(PointLight { position: *position, intensity: *intensity }))
                }
                doc::Light::Spotlight { position, direction, intensity, radiance, .. } => {
                    let intensity = intensity.or(*radiance).unwrap_or_default();
                    light.falloff().ok().map(|falloff| {
                        Light::Spotlight(SpotLight::new(*position, *direction, intensity, falloff))
                    })
                }
                doc::Light::Sun { direction, irradiance, angular_size } => {
                    Some(Light::Sun(SunLight::new(*direction, *irradiance, *angular_size)))
                }
            };
            self.lights.extend(compiled);
        }
    }

    fn environment(
        &mut self,
        name: &str,
        radiance: Vec3,
        image: Option<&str>,
        transform: DAffine3,
        rows_at_poles: bool,
    ) -> Option<Light> {
        let Some(file) = image else {
            return Some(Light::Environment(EnvironmentLight::constant(radiance)));
        };
        let image = self.assets.image(file);
        if image.is_none() {
            self.problem(&format!("lights.{name}.image"), &format!("the image {file} has not been loaded"));
        }
        image.map(|image| {
            Light::Environment(EnvironmentLight::image(radiance, image, transform.matrix3, rows_at_poles))
        })
    }
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
