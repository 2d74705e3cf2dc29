//! Owns how much a document and its assets may ask for.

/// The most that a scene may ask for; what is larger is refused before memory is taken for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limits {
    /// Size of the document, in bytes.
    pub max_document_bytes: u64,
    /// JSON values in the document.
    pub max_values: u64,
    /// Entries of one table of named things.
    pub max_names: u64,
    /// Width times height of the film, in pixels.
    pub max_pixels: u64,
    /// Nodes of all SDF trees together.
    pub max_sdf_nodes: u64,
    /// Frames of an animation.
    pub max_frames: u64,
    /// Different frames that keys of animation tracks stand on.
    pub max_key_frames: u64,
    /// Size of all asset files together, in bytes.
    pub max_asset_bytes: u64,
    /// Triangles of all meshes together, instances not counted.
    pub max_triangles: u64,
    /// Texels of all images together.
    pub max_texels: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_document_bytes: 64 << 20,
            max_values: 1 << 21,
            max_names: 1 << 20,
            max_pixels: 1 << 28,
            max_sdf_nodes: 1 << 16,
            max_frames: 100_000,
            max_key_frames: 100_000,
            max_asset_bytes: 4 << 30,
            max_triangles: 1 << 26,
            max_texels: 1 << 29,
        }
    }
}
