//! Owns the top level of the document.

use crate::scene::document::animation::Animation;
use crate::scene::document::cursor::{Context, Cursor};
use crate::scene::document::decode::Decode;
use crate::scene::document::description::{
    Camera, Description, Film, Instance, Integrator, Light, Material, Medium, MeshFile, Sampling, SdfObject,
    Sphere,
};
use crate::scene::document::macros::object;
use crate::scene::document::named::Named;
use crate::scene::document::rule::{Allowed, Table, optional, or, required};
use crate::scene::document::tree::Node;

object! {
    "scene";
    /// A scene, or an animation of it: one JSON document, with asset files in the same folder or below.
    ///
    /// Coordinates are right-handed; angles are in degrees; colours are linear Rec.709; a world unit is whatever
    /// the scene takes it for.
    pub(super) struct Root {
        /// Version of the format: 1.
        version: u32 = required().from(1.0).to(1.0);
        /// Where the picture is taken from.
        camera: Camera = required();
        /// The picture: its size and how samples become pixels.
        film: Film = required();
        /// How many samples the pixels get.
        sampling: Sampling = or(Sampling::DEFAULT);
        /// Limits of the light paths.
        integrator: Integrator = or(Integrator::DEFAULT);
        /// Materials by name.
        materials: Named<Material> = or(Named::default());
        /// Mesh files by name.
        meshes: Named<MeshFile> = or(Named::default());
        /// Placed meshes by name.
        instances: Named<Instance> = or(Named::default());
        /// Spheres by name.
        spheres: Named<Sphere> = or(Named::default());
        /// Objects made of distance functions, by name.
        sdf_objects: Named<SdfObject> = or(Named::default());
        /// Lights that are not surfaces, by name.
        lights: Named<Light> = or(Named::default());
        /// What fills space, by name.
        media: Named<Medium> = or(Named::default());
        /// Name of the medium that is wherever no object's interior is. Where lights at infinity shine, it ends with a ball
        /// around all objects, lights and the camera; else nowhere.
        medium: Option<String> = optional().naming(Table::Media);
        /// What changes from frame to frame.
        animation: Option<Animation> = optional();
    }
}

impl Root {
    /// Reads the document at the root of a tree; what is wrong is in the context.
    pub(super) fn read(node: &Node, context: &Context<'_>) -> Option<Self> {
        Self::decode(&Cursor::root(node, context), &Allowed::ANY)
    }

    /// The description without the animation.
    pub(super) fn into_description(self, origin: String) -> Description {
        Description {
            origin,
            camera: self.camera,
            film: self.film,
            sampling: self.sampling,
            integrator: self.integrator,
            materials: self.materials,
            meshes: self.meshes,
            instances: self.instances,
            spheres: self.spheres,
            sdf_objects: self.sdf_objects,
            lights: self.lights,
            media: self.media,
            medium: self.medium,
        }
    }
}
