//! Owns the scene document: JSON text to a checked [`Description`] of one frame.
//!
//! A document is parsed to a tree that keeps the place of every value ([`tree`]), tracks replace values in
//! that tree ([`animation`]), and the tree is decoded to plain data ([`description`]) with every problem
//! collected ([`cursor`]). Types, defaults, ranges and docs stand once, in the definitions under
//! [`description`]: the decoder, the JSON Schema and the reference page are made from them.

mod animation;
mod asset;
mod blend;
mod cursor;
mod decode;
mod description;
mod limits;
mod macros;
mod named;
mod nearest;
mod overrides;
mod path;
mod problem;
mod reference;
mod root;
mod rule;
mod schema;
mod source;
#[cfg(test)]
mod tests;
mod tree;

use std::collections::BTreeSet;
use std::sync::Arc;

pub use asset::{AssetKind, AssetRef};
pub use description::{
    Bounds, Camera, ColorTexture, Components, Crop, Description, ErrorOf, Film, Filter, Goal, Instance,
    Integrator, Light, LookAt, Material, Medium, MeshFile, Model, NumberTexture, Relief, Sampling, Scale,
    SdfNode, SdfObject, SdfSettings, Shade, Sphere, Texture,
};
pub use limits::Limits;
pub use named::Named;
pub use overrides::Overrides;
pub use problem::{Problem, Problems};
pub use reference::{json_schema, reference_page};

use animation::{Animation, check_targets};
use cursor::Context;
use root::Root;
use source::Source;
use tree::Node;

/// Values that may be decoded, over all key frames, to validate an animation.
const MAX_KEY_WORK: u64 = 1 << 26;
/// Up to this many values over all frames, every frame is validated and not only those with keys.
const MAX_FRAME_WORK: u64 = 1 << 22;

/// A scene document that has been read and checked; cheap to clone.
#[derive(Debug, Clone)]
pub struct Document(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    source: Source,
    limits: Limits,
    /// The document without its animation.
    root: Node,
    animation: Option<Animation>,
    assets: Vec<AssetRef>,
}

/// The frames of a document.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRange {
    /// First frame.
    pub first: i32,
    /// Last frame, not before the first.
    pub last: i32,
    /// Frames per second.
    pub fps: f64,
}

impl FrameRange {
    /// Number of frames, at least 1.
    pub fn count(&self) -> u64 {
        (i64::from(self.last) - i64::from(self.first) + 1) as u64
    }
}

impl Document {
    /// Reads a document and checks it, as it is written and at the frames where its animation has keys (at
    /// every frame, where that is little work).
    ///
    /// # Errors
    /// Everything that is wrong with it, with lines and columns; `origin` names the document there.
    pub fn parse(text: &str, origin: &str, limits: &Limits) -> Result<Self, Problems> {
        // Offsets are kept in 32 bits.
        let limit = limits.max_document_bytes.min(u64::from(u32::MAX));
        if text.len() as u64 > limit {
            let message = format!("the document has {} bytes, the limit is {limit}", text.len());
            return Err(Problem::new(origin, "", message).into());
        }
        let source = Source::new(origin, text);
        let mut problems = Problems::default();
        let mut root = tree::parse(&source, limits, &mut problems)?;
        let (animation, assets) = {
            let context = Context::new(&source, limits, &root, None);
            context.problems.replace(problems);
            let read = Root::read(&root, &context);
            check_targets(&root, &context);
            (read.and_then(|read| read.animation), context.finish()?)
        };
        root.remove("animation");
        let inner = Inner { source, limits: limits.clone(), root, animation, assets };
        inner.check_frames()?;
        Ok(Self(Arc::new(inner)))
    }

    /// Name of the document.
    pub fn origin(&self) -> &str {
        &self.0.source.origin
    }

    /// The frames: 1 to 1 without an animation.
    pub fn frames(&self) -> FrameRange {
        let still = FrameRange { first: 1, last: 1, fps: 24.0 };
        self.0.animation.as_ref().map_or(still, |animation| FrameRange {
            first: animation.frames.first,
            last: animation.frames.last,
            fps: animation.fps,
        })
    }

    /// The files that the document names, each once, in the order in which it names them.
    pub fn assets(&self) -> &[AssetRef] {
        &self.0.assets
    }

    /// The scene at a frame; outside its keys a track keeps its first or last value.
    ///
    /// # Errors
    /// What interpolation made of valid keys, such as a transform that is singular between them.
    pub fn at(&self, frame: i32) -> Result<Description, Problems> {
        self.0.at(frame)
    }
}

impl Inner {
    fn at(&self, frame: i32) -> Result<Description, Problems> {
        let animated = self.animation.as_ref().filter(|animation| !animation.tracks.is_empty());
        let mut replaced = None;
        if let Some(animation) = animated {
            animation.apply(replaced.insert(self.root.clone()), frame);
        }
        let root = replaced.as_ref().unwrap_or(&self.root);
        let context = Context::new(&self.source, &self.limits, root, animated.map(|_| frame));
        let read = Root::read(root, &context);
        context.finish()?;
        read.map(|read| read.into_description(self.source.origin.clone())).ok_or_else(Problems::default)
    }

    /// Decodes the document at every key frame, or at every frame where that is little work.
    fn check_frames(&self) -> Result<(), Problems> {
        let Some(animation) = self.animation.as_ref().filter(|animation| !animation.tracks.is_empty()) else {
            return Ok(());
        };
        let mut frames = animation.key_frames();
        let (values, keyed) = (self.root.count(), frames.len() as u64);
        let refuse = |message: String| Err(Problem::new(&self.source.origin, "animation", message).into());
        if keyed > self.limits.max_key_frames {
            return refuse(format!(
                "found keys on {keyed} frames, the limit is {}",
                self.limits.max_key_frames
            ));
        }
        if keyed * values > MAX_KEY_WORK {
            return refuse(format!(
                "found keys on {keyed} frames of a document of {values} values, the limit of their product is \
                 {MAX_KEY_WORK}"
            ));
        }
        let span = animation.frames;
        let count = (i64::from(span.last) - i64::from(span.first) + 1) as u64;
        if count * values <= MAX_FRAME_WORK {
            frames.extend(span.first..=span.last);
            frames.sort_unstable();
            frames.dedup();
        }
        let mut problems = Problems::default();
        let mut seen = BTreeSet::new();
        for found in frames.into_iter().filter_map(|frame| self.at(frame).err()) {
            let new = |problem: &Problem| seen.insert((problem.line, problem.column, problem.path.clone()));
            let unlisted = found.total - found.problems.len();
            found.problems.into_iter().filter(new).for_each(|problem| problems.push(problem));
            problems.total += unlisted;
            if problems.total > Problems::KEPT {
                break;
            }
        }
        problems.or(())
    }
}
