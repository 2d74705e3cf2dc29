//! Owns the changes that a person or a job makes to a description without editing the document.

use crate::film::Region;
use crate::scene::document::cursor::{Context, Cursor};
use crate::scene::document::decode::Decode;
use crate::scene::document::description::{Description, ErrorOf, Film, Goal, Sampling};
use crate::scene::document::limits::Limits;
use crate::scene::document::problem::Problems;
use crate::scene::document::rule::Allowed;
use crate::scene::document::source::Source;
use crate::scene::document::tree::{Member, Node, Value};

/// Changes to a description; what is `None` stays as the document says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overrides {
    /// Samples per pixel; replaces a target error.
    pub spp: Option<u32>,
    /// Relative error at which a frame is finished; replaces a number of samples per pixel.
    pub target_error: Option<f64>,
    /// Which picture has to reach a target error.
    pub error_of: Option<ErrorOf>,
    /// Samples per pixel before the first decision of a target error.
    pub min_spp: Option<u32>,
    /// Samples per pixel at which a target error is given up.
    pub max_spp: Option<u32>,
    /// Time after which no further round of samples begins, in seconds.
    pub time_limit: Option<f64>,
    /// Chooses the random numbers.
    pub seed: Option<u32>,
    /// Width and height of the film, in pixels.
    pub size: Option<(u32, u32)>,
    /// The part of the film that is rendered.
    pub crop: Option<Region>,
}

impl Description {
    /// Changes what the overrides say; on errors nothing is changed.
    ///
    /// # Errors
    /// What the document would get for the same values, with paths such as `sampling.spp`, the origin
    /// `overrides` and no lines.
    pub fn apply(&mut self, overrides: &Overrides, limits: &Limits) -> Result<(), Problems> {
        let source = Source::new("overrides", "");
        let root = object([
            ("sampling", Some(sampling(&self.sampling, overrides))),
            ("film", Some(film(&self.film, overrides))),
        ]);
        let context = Context::new(&source, limits, &root, None);
        let at = Cursor::root(&root, &context);
        let sampling = at.member("sampling").and_then(|at| Sampling::decode(&at, &Allowed::ANY));
        let film = at.member("film").and_then(|at| Film::decode(&at, &Allowed::ANY));
        let mut problems = context.problems.take();
        for problem in &mut problems.problems {
            (problem.line, problem.column) = (0, 0);
        }
        problems.or(())?;
        if let (Some(sampling), Some(film)) = (sampling, film) {
            self.sampling = sampling;
            let Film { width, height, crop, .. } = film;
            (self.film.width, self.film.height, self.film.crop) = (width, height, crop);
        }
        Ok(())
    }
}

/// The film's size and crop as a document would say them.
fn film(film: &Film, overrides: &Overrides) -> Node {
    let (width, height) = overrides.size.unwrap_or((film.width, film.height));
    let given = overrides.crop.map(|region| [region.x0, region.y0, region.width(), region.height()]);
    let kept = film.crop.map(|crop| [crop.x, crop.y, crop.width, crop.height]);
    let crop = given.or(kept).map(|numbers| {
        let [x, y, width, height] = numbers.map(|number| integer(Some(number)));
        object([("x", x), ("y", y), ("width", width), ("height", height)])
    });
    object([("width", integer(Some(width))), ("height", integer(Some(height))), ("crop", crop)])
}

/// The sampling as a document would say it.
fn sampling(sampling: &Sampling, overrides: &Overrides) -> Node {
    let (mut spp, mut target, mut min_spp, mut max_spp, mut error_of) = (None, None, None, None, None);
    match sampling.goal {
        _ if overrides.spp.is_some() || overrides.target_error.is_some() => {}
        Goal::Fixed { spp: fixed } => spp = Some(fixed),
        Goal::Error { target: error, .. } => target = Some(error),
    }
    if let (Goal::Error { min_spp: min, max_spp: max, of, .. }, None) = (sampling.goal, overrides.spp) {
        (min_spp, max_spp, error_of) = (Some(min), Some(max), Some(of));
    }
    object([
        ("spp", integer(overrides.spp.or(spp))),
        ("target_error", number(overrides.target_error.or(target))),
        ("error_of", overrides.error_of.or(error_of).map(word)),
        ("min_spp", integer(overrides.min_spp.or(min_spp))),
        ("max_spp", integer(overrides.max_spp.or(max_spp))),
        ("seed", integer(Some(overrides.seed.unwrap_or(sampling.seed)))),
        ("time_limit", number(overrides.time_limit.or(sampling.time_limit))),
    ])
}

/// The word that a document has for it.
fn word(of: ErrorOf) -> Node {
    Node::made(Value::Text(of.show().as_str().unwrap_or_default().to_owned()))
}

fn integer(value: Option<u32>) -> Option<Node> {
    number(value.map(f64::from))
}

fn number(value: Option<f64>) -> Option<Node> {
    value.map(|value| Node::made(Value::Number(value)))
}

/// An object of the members that are there.
fn object<const N: usize>(members: [(&str, Option<Node>); N]) -> Node {
    let member =
        |(name, node): (&str, Option<Node>)| Some(Member { name: name.to_owned(), start: 0, node: node? });
    Node::made(Value::Object(members.into_iter().filter_map(member).collect()))
}
