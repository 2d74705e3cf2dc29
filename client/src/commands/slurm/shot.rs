//! A shot: the frames of one scene in one folder, each with a note of what it was made from.
//!
//! A frame is complete when its files are those that its note names, byte for byte, and the note says the same scene
//! and settings. The note is written last, so that whatever is interrupted leaves a frame that is not complete.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use karst_client::{Blob, Error, SceneFiles, open_scene, scene_error};
use karst_core::scene::{Description, ErrorOf, FrameRange, Goal, Limits};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::args::{DenoiseArg, FrameList, ShotArgs};
use crate::naming::{denoised, of_frame, safe_stem};

/// The frames of one scene in one folder.
#[derive(Debug)]
pub(super) struct Shot {
    pub(super) folder: PathBuf,
    /// The scene as the settings change it, at its first frame.
    pub(super) description: Description,
    stem: String,
    has_png: bool,
    has_denoised: bool,
    range: FrameRange,
    /// Digest of the document and all its files.
    scene: String,
    settings: Value,
}

/// What a frame was made from, and what it became.
#[derive(Debug, Serialize, Deserialize)]
struct Note {
    frame: i32,
    scene: String,
    settings: Value,
    /// The build of karst's core, for people: frames of another build count.
    build: String,
    /// SHA-256 of each file.
    files: BTreeMap<String, String>,
}

impl Shot {
    /// Reads the scene and applies the settings.
    ///
    /// # Errors
    /// The scene or one of its files cannot be read or is wrong; settings that do not fit it.
    pub(super) fn open(args: &ShotArgs) -> Result<Self, Error> {
        let limits = Limits::default();
        let scene = open_scene(&args.scene, &limits)?;
        let files = scene.hashed()?;
        let document = scene.document(&limits).map_err(|problems| scene_error(&problems))?;
        let range = document.frames();
        let mut description = document.at(range.first).map_err(|problems| scene_error(&problems))?;
        let overrides = args.settings.overrides();
        description.apply(&overrides, &limits).map_err(|problems| scene_error(&problems))?;
        Ok(Self {
            folder: args.output.clone(),
            settings: settings(&description, args.work.denoise),
            description,
            stem: safe_stem(&files.name),
            has_png: args.png,
            has_denoised: args.work.denoise != DenoiseArg::Off,
            range,
            scene: digest(&files),
        })
    }

    /// The frames asked for, or all.
    ///
    /// # Errors
    /// The scene does not have them all.
    pub(super) fn chosen(&self, asked: Option<FrameList>) -> Result<FrameList, Error> {
        let FrameRange { first, last, .. } = self.range;
        let chosen = asked.unwrap_or(FrameList { first, last, step: 1 });
        if chosen.first < first || chosen.last > last {
            return Err(Error::Usage(format!(
                "frames {} to {}: the scene has frames {first} to {last}",
                chosen.first, chosen.last
            )));
        }
        Ok(chosen)
    }

    /// Names of the files that `karst render` is to write for a frame.
    pub(super) fn outputs(&self, frame: i32) -> Vec<PathBuf> {
        let named = |ending: &str| of_frame(Path::new(&format!("{}.{ending}", self.stem)), frame, true);
        if self.has_png { vec![named("png"), named("exr")] } else { vec![named("exr")] }
    }

    /// Names of all files of a frame, the EXR last.
    pub(super) fn names(&self, frame: i32) -> Vec<PathBuf> {
        let mut names = self.outputs(frame);
        if self.has_png && self.has_denoised {
            names.insert(1, denoised(&names[0]));
        }
        names
    }

    /// Why a frame is not complete; `None` when it is.
    pub(super) fn lacks(&self, frame: i32) -> Option<&'static str> {
        let names = self.names(frame);
        if names.iter().any(|name| !self.folder.join(name).is_file()) {
            return Some("not there");
        }
        let note = std::fs::read(self.note_path(frame)).ok();
        let Some(note) = note.and_then(|bytes| serde_json::from_slice::<Note>(&bytes).ok()) else {
            return Some("without a note of what it was made from");
        };
        if note.frame != frame || note.scene != self.scene {
            return Some("made from another scene");
        }
        if note.settings != self.settings {
            return Some("made with other settings");
        }
        let is_whole = |name: &PathBuf| {
            let digest = note.files.get(name.to_string_lossy().as_ref());
            let found = Blob::of_file(&self.folder.join(name)).ok();
            digest.zip(found).is_some_and(|(digest, found)| found.digest() == digest)
        };
        if names.iter().all(is_whole) { None } else { Some("not the file that its note names") }
    }

    /// The note of a frame whose files are these.
    pub(super) fn note(&self, frame: i32, files: BTreeMap<String, String>) -> Vec<u8> {
        let (scene, settings) = (self.scene.clone(), self.settings.clone());
        let note = Note { frame, scene, settings, build: karst_core::BUILD.to_owned(), files };
        format!("{:#}\n", json!(note)).into_bytes()
    }

    /// Where the note of a frame is.
    pub(super) fn note_path(&self, frame: i32) -> PathBuf {
        self.folder.join(of_frame(Path::new(&format!("{}.json", self.stem)), frame, true))
    }

    /// Whether both are made from the same.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.scene == other.scene && self.settings == other.settings
    }
}

fn digest(scene: &SceneFiles) -> String {
    let mut text = format!("document {}\n", scene.document.digest());
    for (path, blob) in &scene.files {
        let _ = writeln!(text, "file {} {path}", blob.digest());
    }
    Blob::of_bytes(text.as_bytes()).digest().to_owned()
}

/// What decides the pixels besides the scene's own text, as it is after the settings.
fn settings(description: &Description, denoise: DenoiseArg) -> Value {
    let (sampling, film) = (&description.sampling, &description.film);
    let goal = match sampling.goal {
        Goal::Fixed { spp } => json!({"spp": spp}),
        Goal::Error { target, min_spp, max_spp, of } => {
            let error_of = match of {
                ErrorOf::Noisy => "noisy",
                ErrorOf::Denoised => "denoised",
            };
            json!({"target_error": target, "min_spp": min_spp, "max_spp": max_spp, "error_of": error_of})
        }
    };
    let window = film.window();
    json!({
        "goal": goal,
        "seed": sampling.seed,
        "time_limit": sampling.time_limit,
        "size": [film.width, film.height],
        "window": [window.x, window.y, window.width, window.height],
        "denoise": match denoise {
            DenoiseArg::Off => "off",
            DenoiseArg::Color => "color",
            DenoiseArg::Full => "full",
        },
    })
}
