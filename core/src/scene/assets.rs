//! Stub.
use super::object::PreparedMesh;
use crate::texture::{ColorSpace, Image};
use std::collections::BTreeMap;
use std::sync::Arc;
/// Stub.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    /// Stub.
    pub meshes: BTreeMap<String, Arc<PreparedMesh>>,
}
impl Assets {
    /// Stub.
    pub fn mesh(&self, path: &str) -> Option<Arc<PreparedMesh>> {
        self.meshes.get(path).cloned()
    }
    /// Stub.
    pub fn image(&self, _path: &str) -> Option<Arc<Image>> {
        let _ = ColorSpace::Srgb;
        None
    }
}
