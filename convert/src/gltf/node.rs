//! Owns nodes: the walk over the scene, with what each node places in the world.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::json;

use super::camera::{self, View};
use super::description::{Node, Root};
use super::light::light;
use super::material::{Look, material};
use super::mesh::{Shape, shape};
use super::output::{Output, add};
use super::reader::Reader;
use crate::ConvertError;
use crate::parts::transform;

/// JSON values that a placed mesh takes in the document, at most.
const VALUES: u64 = 32;

/// What was found on the way.
#[derive(Debug)]
pub(super) struct Walk<'a, 'b, 'c> {
    reader: &'a Reader<'a>,
    output: &'c mut Output<'b>,
    /// Nodes that were met.
    seen: Vec<bool>,
    looks: BTreeMap<Option<u32>, Look>,
    /// Meshes of the document by mesh and primitive; none where there are no triangles.
    shapes: BTreeMap<(u32, usize), Option<Shape>>,
    /// The first camera.
    pub(super) view: Option<View>,
    /// Smallest and largest coordinates of everything placed.
    pub(super) bounds: (DVec3, DVec3),
    /// Whether a surface shines.
    pub(super) shines: bool,
}

/// The nodes at which the scene begins.
pub(super) fn roots(reader: &Reader<'_>, output: &mut Output<'_>) -> Result<Vec<u32>, ConvertError> {
    let root: &Root = reader.root;
    if root.scenes.is_empty() {
        let mut is_child = vec![false; root.nodes.len()];
        for child in root.nodes.iter().flat_map(|node| &node.children) {
            if let Some(entry) = is_child.get_mut(*child as usize) {
                *entry = true;
            }
        }
        return Ok((0..root.nodes.len() as u32).filter(|index| !is_child[*index as usize]).collect());
    }
    let index = root.scene.unwrap_or(0);
    let scene = reader.get(&root.scenes, index, "scene", "scenes")?;
    output.others(format!("scenes[{index}]"), &scene.extensions);
    if root.scenes.len() > 1 {
        let others = root.scenes.len() - 1;
        output.untranslated("scenes", format!("{others} scenes beside scenes[{index}]"));
    }
    Ok(scene.nodes.clone())
}

impl<'a, 'b, 'c> Walk<'a, 'b, 'c> {
    /// Visits the nodes and everything below them, and puts into the document what they place.
    pub(super) fn over(
        roots: &[u32],
        reader: &'a Reader<'a>,
        output: &'c mut Output<'b>,
    ) -> Result<Self, ConvertError> {
        let mut walk = Self {
            reader,
            output,
            seen: vec![false; reader.root.nodes.len()],
            looks: BTreeMap::new(),
            shapes: BTreeMap::new(),
            view: None,
            bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY),
            shines: false,
        };
        // A stack of its own: a chain of nodes may be as long as the file allows.
        let mut open = Vec::new();
        walk.enter(roots, &DAffine3::IDENTITY, &mut open)?;
        while let Some((index, parent)) = open.pop() {
            let node = reader.get(&reader.root.nodes, index, "nodes", "nodes")?;
            let place = format!("nodes[{index}]");
            let world = parent * local(reader, node, &place)?;
            if !world.is_finite() {
                return Err(reader.error(place, "its place in the world is not finite"));
            }
            walk.visit(node, &world, &place)?;
            walk.enter(&node.children, &world, &mut open)?;
        }
        Ok(walk)
    }

    /// Puts nodes below a place in the world on the stack, each once: it never has more entries than there are nodes.
    fn enter(
        &mut self,
        nodes: &[u32],
        world: &DAffine3,
        open: &mut Vec<(u32, DAffine3)>,
    ) -> Result<(), ConvertError> {
        for index in nodes.iter().rev() {
            self.reader.get(&self.reader.root.nodes, *index, "nodes", "nodes")?;
            if std::mem::replace(&mut self.seen[*index as usize], true) {
                let message = "is reached a second time: it has two parents, or is among its own descendants";
                return Err(self.reader.error(format!("nodes[{index}]"), message));
            }
            open.push((*index, *world));
        }
        Ok(())
    }

    fn visit(&mut self, node: &Node, world: &DAffine3, place: &str) -> Result<(), ConvertError> {
        self.output.others(place, &node.extensions.others);
        if let Some(mesh) = node.mesh {
            self.meshes(node, mesh, world, place)?;
        }
        if let Some(found) = &node.extensions.light {
            light(self.reader, self.output, found.light, world, node.name.as_deref(), place)?;
        }
        if let Some(index) = node.camera {
            if self.view.is_some() {
                self.output.untranslated(place, "a further camera");
            } else {
                self.view = camera::view(self.reader, self.output, index, world, place)?;
            }
        }
        Ok(())
    }

    fn meshes(&mut self, node: &Node, mesh: u32, world: &DAffine3, place: &str) -> Result<(), ConvertError> {
        let described = self.reader.get(&self.reader.root.meshes, mesh, place, "meshes")?;
        let inverse = world.inverse();
        if world.matrix3.determinant() == 0.0 || !inverse.is_finite() {
            self.output.untranslated(place, "a mesh that is scaled to nothing in some direction");
            return Ok(());
        }
        if node.skin.is_some() {
            self.output.differs(place, "bones do not move the mesh: it stands as it was modelled");
        }
        for (number, primitive) in described.primitives.iter().enumerate() {
            let look = self.look(primitive.material, mesh, number)?;
            let found = self.shapes.get(&(mesh, number)).cloned();
            let found = if let Some(found) = found {
                found
            } else {
                let found = shape(self.reader, self.output, mesh, number, look.set)?;
                self.shapes.insert((mesh, number), found.clone());
                found
            };
            if let Some(found) = found {
                self.place(&found, &look, node, world, place)?;
            }
        }
        Ok(())
    }

    fn look(&mut self, index: Option<u32>, mesh: u32, primitive: usize) -> Result<Look, ConvertError> {
        if let Some(look) = self.looks.get(&index) {
            return Ok(look.clone());
        }
        let place = format!("meshes[{mesh}].primitives[{primitive}].material");
        let look = material(self.reader, self.output, index, &place)?;
        self.looks.insert(index, look.clone());
        Ok(look)
    }

    fn place(
        &mut self,
        shape: &Shape,
        look: &Look,
        node: &Node,
        world: &DAffine3,
        place: &str,
    ) -> Result<(), ConvertError> {
        let placed = self.output.instances.len() as u64 + 1;
        let limit = self.reader.limits.max_values / VALUES;
        if placed > limit {
            return Err(self.reader.error(place, format!("places more than {limit} meshes, the limit")));
        }
        let mut entry = json!({"mesh": shape.name, "material": look.name});
        if *world != DAffine3::IDENTITY {
            entry["transform"] = transform(world);
        }
        if look.emission != [0.0; 3] {
            entry["emission"] = json!(look.emission);
            self.shines = true;
        }
        add(&mut self.output.instances, node.name.as_deref(), &shape.name, entry);
        for corner in 0..8 {
            let far = |axis: usize| {
                if corner >> axis & 1 == 0 { shape.low[axis] } else { shape.high[axis] }
            };
            let p = world.transform_point3(DVec3::new(far(0), far(1), far(2)));
            self.bounds = (self.bounds.0.min(p), self.bounds.1.max(p));
        }
        Ok(())
    }
}

/// The node's own transform.
fn local(reader: &Reader<'_>, node: &Node, place: &str) -> Result<DAffine3, ConvertError> {
    if let Some(matrix) = &node.matrix {
        let matrix = DMat4::from_cols_array(matrix);
        if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
            return Err(reader.error(place, "the last row of the matrix is not [0, 0, 0, 1]"));
        }
        return Ok(DAffine3::from_mat4(matrix));
    }
    let rotation = match node.rotation {
        None => DQuat::IDENTITY,
        Some(found) => {
            let wide = DQuat::from_array(found);
            let length = wide.length();
            // Files have it in single precision: it is a unit quaternion up to that.
            if !(0.5..=2.0).contains(&length) {
                let message = format!("found a rotation of length {length}, expected a unit quaternion");
                return Err(reader.error(place, message));
            }
            wide.normalize()
        }
    };
    let scale = node.scale.map_or(DVec3::ONE, DVec3::from);
    let translation = node.translation.map_or(DVec3::ZERO, DVec3::from);
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
}
