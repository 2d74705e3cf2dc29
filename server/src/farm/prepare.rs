//! Owns how a job becomes something that can be rendered: document and assets once per job, scene and film per
//! frame, where a frame goes on after a crash. All of it heavy, all of it on blocking threads.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;

use karst_core::film::{Film, Round, TileGrid, TileResult};
use karst_core::render::next_round;
use karst_core::scene::{AssetSource, Assets, Description, Document, ErrorOf, Goal, Limits, Problems, Scene};
use karst_proto::convert::problems_to_violations;
use karst_proto::errors::Violation;
use tokio::runtime::Handle;
use tokio::task::spawn_blocking;

use crate::blobs::{Blobs, Kind};
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::denoised::Replicates;
use crate::farm::ledger::unpack;
use crate::farm::live::{LiveFrame, Merged, Vote};
use crate::farm::queue::SERVER;
use crate::films::read_film;
use crate::past::Past;
use crate::spec::{Denoise, Frames, JobSpec};
use crate::state::{State, StoredRound};

/// What problems call the document: the server does not know its file.
const ORIGIN: &str = "scene.json";

/// What all frames of a job share.
#[derive(Debug)]
pub(crate) struct Context {
    pub spec: JobSpec,
    pub document: Document,
    pub assets: Assets,
}

/// A frame that is ready to be rendered.
#[derive(Debug)]
pub(crate) struct Opened {
    /// The frame with everything that survived.
    pub frame: Arc<LiveFrame>,
    /// The round that comes next; `None` when there is none.
    pub round: Option<Arc<Round>>,
    /// What has gone wrong with its tiles.
    pub past: BTreeMap<u32, Past>,
}

/// Reads, parses and checks the scene of a job and loads its assets.
///
/// # Errors
/// [`Error::Scene`] with all problems, [`Error::Gone`] or [`Error::Corrupt`] for its blobs.
pub(crate) async fn load(blobs: &Blobs, limits: &Limits, spec: JobSpec) -> Result<Context, Error> {
    let text = read_document(blobs, limits, &spec).await?;
    let source = BlobSource { blobs: blobs.clone(), files: spec.files.clone(), runtime: Handle::current() };
    let limits = limits.clone();
    spawn_blocking(move || load_from(&text, &source, &limits, spec)).await?
}

/// What one frame of a job will be, without its assets.
///
/// # Errors
/// [`Error::Scene`] with all problems, [`Error::Gone`] or [`Error::Corrupt`] for the document.
pub(crate) async fn describe(
    blobs: &Blobs,
    limits: &Limits,
    spec: JobSpec,
    frame: i32,
) -> Result<Description, Error> {
    let text = read_document(blobs, limits, &spec).await?;
    let limits = limits.clone();
    spawn_blocking(move || description(&parse(&text, &limits)?, &spec, &limits, frame)).await?
}

async fn read_document(blobs: &Blobs, limits: &Limits, spec: &JobSpec) -> Result<Vec<u8>, Error> {
    let size = blobs.size(Kind::Asset, &spec.scene).await?.ok_or(Error::Gone(spec.scene))?;
    if size > limits.max_document_bytes {
        let most = limits.max_document_bytes;
        return Err(Error::limit(
            "job.scene.digest",
            format!("the document has {size} bytes, at most {most}"),
        ));
    }
    blobs.get(Kind::Asset, spec.scene).await
}

/// Parses and checks a scene document and loads its assets. Blocks.
///
/// # Errors
/// [`Error::Scene`] with all problems.
pub(crate) fn load_from(
    text: &[u8],
    source: &impl AssetSource,
    limits: &Limits,
    spec: JobSpec,
) -> Result<Context, Error> {
    let document = parse(text, limits)?;
    let missing: Vec<Violation> = document
        .assets()
        .iter()
        .filter(|asset| !spec.files.contains_key(&asset.path))
        .map(|asset| {
            let text = format!("the document names {:?}, which is not among job.scene.files", asset.path);
            Violation::new("scene", text)
        })
        .collect();
    if !missing.is_empty() {
        let total = missing.len();
        return Err(Error::Scene(missing, total));
    }
    let assets = Assets::load(&document, source, limits).map_err(|p| scene_error(&p))?;
    Ok(Context { spec, document, assets })
}

fn parse(text: &[u8], limits: &Limits) -> Result<Document, Error> {
    let text = std::str::from_utf8(text)
        .map_err(|e| Error::Scene(vec![Violation::new("scene", format!("expected UTF-8 text: {e}"))], 1))?;
    Document::parse(text, ORIGIN, limits).map_err(|p| scene_error(&p))
}

/// The frames that a job asks for, all of the document's where it does not say.
///
/// # Errors
/// Frames outside the document's range, or too many.
pub(crate) fn frames_of(context: &Context, limits: &Limits) -> Result<Frames, Error> {
    let range = context.document.frames();
    let asked = context.spec.frames.unwrap_or(Frames { first: range.first, last: range.last, step: 1 });
    if asked.first < range.first || asked.last > range.last || asked.last < asked.first {
        let text = format!(
            "found {} to {}, expected frames from {} to {}",
            asked.first, asked.last, range.first, range.last
        );
        return Err(Error::field("job.frames", text));
    }
    if asked.count() > limits.max_frames {
        let text = format!("{} frames, at most {}", asked.count(), limits.max_frames);
        return Err(Error::limit("job.frames", text));
    }
    Ok(asked)
}

/// Compiles the scene of one frame. Blocks.
///
/// # Errors
/// [`Error::Scene`] with all problems.
pub(crate) fn build(context: &Context, limits: &Limits, frame: i32) -> Result<Scene, Error> {
    let description = description(&context.document, &context.spec, limits, frame)?;
    Scene::build(&description, &context.assets, frame).map_err(|p| scene_error(&p))
}

fn description(
    document: &Document,
    spec: &JobSpec,
    limits: &Limits,
    frame: i32,
) -> Result<Description, Error> {
    let mut description = document.at(frame).map_err(|p| scene_error(&p))?;
    description.apply(&spec.settings.overrides(), limits).map_err(|p| settings_error(&p))?;
    let is_judged_denoised = matches!(description.sampling.goal, Goal::Error { of: ErrorOf::Denoised, .. });
    if is_judged_denoised && spec.denoise == Denoise::Off {
        let text = "found no denoising, expected color or full: the denoised picture has to reach the target error (error_of)";
        return Err(Error::Fields(vec![Violation::new("job.denoise".to_owned(), text)]));
    }
    Ok(description)
}

/// How a frame is rendered, besides its scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct How {
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Whether and how it is denoised.
    pub denoise: Denoise,
    /// Whether it was decided before that there is no further round: time, which nobody asks for again, may have been the
    /// reason.
    pub is_rendered: bool,
}

/// Makes a frame ready: its scene, and the film and results that survived.
///
/// Blobs that are damaged or gone are rendered again: that errs towards work, never towards wrong pixels.
///
/// # Errors
/// Problems of the scene, a failing disk.
pub(crate) async fn open(
    place: (i64, Arc<str>, i32),
    scene: Arc<Scene>,
    how: How,
    stores: (&State, &Blobs),
) -> Result<Opened, Error> {
    let (state, blobs) = stores;
    let stored = state.round(&place.1, place.2).await?;
    let survived = read_stored(blobs, stored).await?;
    let past = state.past(&place.1, place.2, survived.rounds).await?;
    let mut opened = spawn_blocking(move || restore(place, scene, how, survived)).await?;
    opened.past = past;
    Ok(opened)
}

/// What could be read of a frame.
pub(crate) struct Survived {
    /// The film after `rounds` rounds; `None` before the first.
    pub film: Option<(Film, Digest)>,
    pub rounds: u32,
    /// Results of the round of that index.
    pub packs: Vec<(Digest, Vec<u8>)>,
}

/// Reads what survived of a frame; what is damaged is left out.
///
/// # Errors
/// A failing disk.
pub(crate) async fn read_stored(blobs: &Blobs, stored: StoredRound) -> Result<Survived, Error> {
    let mut survived = Survived { film: None, rounds: stored.rounds, packs: Vec::new() };
    if let Some(digest) = stored.film {
        match read_film(blobs, digest).await {
            Ok(film) => survived.film = Some((film, digest)),
            Err(e @ (Error::Gone(_) | Error::Corrupt(_))) => {
                tracing::error!("the frame is rendered from its beginning: {e}");
                return Ok(Survived { film: None, rounds: 0, packs: Vec::new() });
            }
            Err(e) => return Err(e),
        }
    }
    for digest in stored.packs {
        match blobs.get(Kind::Pack, digest).await {
            Ok(bytes) => survived.packs.push((digest, bytes)),
            Err(e @ (Error::Gone(_) | Error::Corrupt(_))) => {
                tracing::error!("the results in it are rendered again: {e}");
            }
            Err(e) => return Err(e),
        }
    }
    Ok(survived)
}

fn restore(place: (i64, Arc<str>, i32), scene: Arc<Scene>, how: How, survived: Survived) -> Opened {
    let grid = TileGrid::new(scene.window(), how.tile_size);
    let (film, stored) = match survived.film {
        Some((film, digest)) => (film, Some(digest)),
        None => (Film::new(scene.size(), scene.window(), scene.exposure()), None),
    };
    let judge = |film: &Film| Replicates::of(film, &scene)?.judgement(&film.picture(), how.denoise).of(film);
    let round = if how.is_rendered {
        None
    } else {
        next_round(scene.sampling(), &grid, &film, survived.rounds, &judge)
    };
    let mut merged = Merged {
        film,
        rounds: vec![survived.rounds; grid.tile_count() as usize],
        complete: round.is_none(),
        stored,
        packs: survived.packs.iter().map(|(digest, _)| *digest).collect(),
        round: survived.rounds,
        version: 0,
        accepted: BTreeMap::new(),
        disputes: BTreeMap::new(),
    };
    if let Some(round) = &round {
        for (_, pack) in &survived.packs {
            merged.take_pack(pack, &grid, round);
        }
    }
    let frame = Arc::new(LiveFrame::new(place, scene, grid, merged));
    Opened { frame, round: round.map(Arc::new), past: BTreeMap::new() }
}

impl Merged {
    /// Merges the stored results that are not merged already.
    fn take_pack(&mut self, pack: &[u8], grid: &TileGrid, round: &Round) {
        for result in results(pack, grid, round) {
            let merged_already = self.rounds[result.tile as usize] > round.index;
            if !merged_already && self.film.merge(&result).is_ok() {
                self.rounds[result.tile as usize] = round.index + 1;
                let vote = Vote { worker: SERVER.to_owned(), digest: Digest::of(&result.to_bytes()) };
                self.accepted.insert(result.tile, vote);
            }
        }
    }
}

/// The results of a pack; those that do not fit the plan are rendered again.
pub(crate) fn results(pack: &[u8], grid: &TileGrid, round: &Round) -> Vec<TileResult> {
    let parse = |bytes: &[u8]| match TileResult::from_bytes(bytes, grid, round) {
        Ok(result) => Some(result),
        Err(e) => {
            tracing::error!("a stored result is rendered again: {e}");
            None
        }
    };
    unpack(pack).unwrap_or_default().into_iter().filter_map(parse).collect()
}

/// The files of a job, for the loaders of the core; used on blocking threads only.
struct BlobSource {
    blobs: Blobs,
    files: BTreeMap<String, Digest>,
    runtime: Handle,
}

impl BlobSource {
    fn digest(&self, path: &str) -> io::Result<Digest> {
        let missing = || io::Error::new(io::ErrorKind::NotFound, "not among the files of the job");
        self.files.get(path).copied().ok_or_else(missing)
    }
}

impl AssetSource for BlobSource {
    fn read(&self, path: &str) -> Result<Vec<u8>, io::Error> {
        let digest = self.digest(path)?;
        self.runtime.block_on(self.blobs.get(Kind::Asset, digest)).map_err(io::Error::other)
    }

    fn len(&self, path: &str) -> Result<u64, io::Error> {
        let digest = self.digest(path)?;
        let size = self.runtime.block_on(self.blobs.size(Kind::Asset, &digest)).map_err(io::Error::other)?;
        size.ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))
    }
}

/// Problems of the document or its files.
fn scene_error(problems: &Problems) -> Error {
    let (violations, total) = problems_to_violations(problems);
    Error::Scene(violations, total)
}

/// Problems with what the job changes, with the paths of the request: the core names the places in the document
/// that would have had the same values.
fn settings_error(problems: &Problems) -> Error {
    let field = |path: &str| match path.split_once('.') {
        Some(("film", rest)) if rest.starts_with("crop") => "job.settings.crop".to_owned(),
        Some(("sampling", rest)) => format!("job.settings.{rest}"),
        _ if path.starts_with("film") => "job.settings.size".to_owned(),
        _ => "job.settings".to_owned(),
    };
    Error::Fields(problems.problems.iter().map(|p| Violation::new(field(&p.path), &p.message)).collect())
}

#[cfg(test)]
mod tests {
    use super::{Assets, Denoise, Document, How, Limits, Scene, Survived, restore};
    use karst_core::scene::Folder;
    use std::path::Path;
    use std::sync::Arc;

    const SCENE: &str = r#"{ "version": 1, "film": {"width": 32, "height": 32},
      "camera": {"type": "perspective", "vfov": 40, "transform":
        {"look_at": {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0]}}},
      "sampling": {"spp": 64, "time_limit": 1}, "materials": {"clay": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}},
      "spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "clay"}} }"#;

    /// Its time was over, or its denoised picture good enough, when the server stopped: nobody decides that again.
    #[test]
    fn a_frame_whose_rounds_are_over_has_no_further_round() {
        let limits = Limits::default();
        let document = Document::parse(SCENE, "scene.json", &limits).unwrap();
        let assets = Assets::load(&document, &Folder::new(Path::new(".")).unwrap(), &limits).unwrap();
        let scene = Arc::new(Scene::build(&document.at(1).unwrap(), &assets, 1).unwrap());
        for is_rendered in [false, true] {
            let how = How { tile_size: 16, denoise: Denoise::Off, is_rendered };
            let survived = Survived { film: None, rounds: 1, packs: Vec::new() };
            let opened = restore((1, Arc::from("j"), 1), Arc::clone(&scene), how, survived);
            assert_eq!(opened.round.is_none(), is_rendered);
            assert_eq!(opened.frame.merged().complete, is_rendered);
        }
    }
}
