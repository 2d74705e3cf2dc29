//! The only file that names both wire and core types: translation, and validation of untrusted fields.

use karst_core::film::{Counters, FrameSize, FrameSummary, Region};
use karst_core::scene::{ErrorOf, Overrides, Problems};
use tonic::Status;

use crate::errors::{ErrorReason, Violation, bad_request_of};
use crate::{MAX_SCENE_FILES, v1};

/// Longest display name in bytes.
const MAX_NAME_BYTES: usize = 200;
/// Longest path of a scene file in bytes.
const MAX_PATH_BYTES: usize = 512;
const MAX_SPP: u32 = 1 << 31;
const TILE_SIZES: std::ops::RangeInclusive<u32> = 16..=256;

/// What a job asks for, with every field checked on its own. What needs the scene document is not checked yet:
/// frames inside its range, files that it names, a crop inside its film.
#[derive(Clone, Debug, PartialEq)]
pub struct JobRequest {
    /// For people; at most 200 bytes.
    pub display_name: String,
    /// SHA-256 of the scene document, 64 lower-case hexadecimal digits.
    pub scene_digest: String,
    /// Path and digest of each asset file; each path once.
    pub files: Vec<(String, String)>,
    /// First and last frame number and the step, or all frames of the document.
    pub frames: Option<(i32, i32, u32)>,
    /// What changes the document.
    pub overrides: Overrides,
    /// Edge of a tile in pixels, a multiple of 16 from 16 to 256; `None` leaves it to the server.
    pub tile_size: Option<u32>,
    /// Never `Unspecified`.
    pub denoise: v1::Denoise,
}

/// Checks every field of a job on its own.
///
/// # Errors
/// All violations, with paths such as `job.settings.spp`.
pub fn job_from_wire(job: Option<&v1::JobSpec>) -> Result<JobRequest, Vec<Violation>> {
    let mut found = Found::default();
    let Some(job) = job else {
        found.add("job", "is missing, it is required");
        return Err(found.0);
    };
    if job.display_name.len() > MAX_NAME_BYTES {
        let bytes = job.display_name.len();
        found.add("job.display_name", format!("found {bytes} bytes, expected at most {MAX_NAME_BYTES}"));
    }
    let no_scene = v1::Scene::default();
    if job.scene.is_none() {
        found.add("job.scene", "is missing, it is required");
    }
    let scene = job.scene.as_ref().unwrap_or(&no_scene);
    if job.scene.is_some() {
        found.check_digest("job.scene.digest", &scene.digest);
    }
    let files = files_from_wire(&scene.files, &mut found);
    let frames = job.frames.as_ref().map(|range| (range.first, range.last, range.step.max(1)));
    if let Some((first, last, _)) = frames.filter(|(first, last, _)| first > last) {
        found.add("job.frames.last", format!("found {last}, expected at least first, which is {first}"));
    }
    let settings = job.settings.unwrap_or_default();
    let overrides = settings_from_wire(&settings).unwrap_or_else(|violations| {
        found.0.extend(violations);
        Overrides::default()
    });
    let tile_size = (job.tile_size != 0).then_some(job.tile_size);
    if tile_size.is_some_and(|edge| !TILE_SIZES.contains(&edge) || edge % 16 != 0) {
        let text = format!("found {}, expected 0 or a multiple of 16 from 16 to 256", job.tile_size);
        found.add("job.tile_size", text);
    }
    let denoise = match job.denoise() {
        v1::Denoise::Unspecified => v1::Denoise::Off,
        mode @ (v1::Denoise::Off | v1::Denoise::Color | v1::Denoise::Full) => mode,
    };
    let (display_name, scene_digest) = (job.display_name.clone(), scene.digest.clone());
    found.or(JobRequest { display_name, scene_digest, files, frames, overrides, tile_size, denoise })
}

fn files_from_wire(files: &[v1::SceneFile], found: &mut Found) -> Vec<(String, String)> {
    if files.len() > MAX_SCENE_FILES {
        let text = format!("found {} files, expected at most {MAX_SCENE_FILES}", files.len());
        found.add("job.scene.files", text);
        return Vec::new();
    }
    let mut paths = std::collections::BTreeSet::new();
    for (index, file) in files.iter().enumerate() {
        let at = format!("job.scene.files[{index}]");
        found.check_digest(&format!("{at}.digest"), &file.digest);
        if let Some(wrong) = wrong_with_path(&file.path) {
            found.add(format!("{at}.path"), format!("found {:?}: {wrong}", shorten(&file.path)));
        } else if !paths.insert(file.path.as_str()) {
            found.add(format!("{at}.path"), format!("found {:?} a second time", file.path));
        }
    }
    files.iter().map(|file| (file.path.clone(), file.digest.clone())).collect()
}

/// What is wrong with the path of a scene file.
fn wrong_with_path(path: &str) -> Option<&'static str> {
    if path.is_empty() || path.len() > MAX_PATH_BYTES {
        Some("a path has 1 to 512 bytes")
    } else if path.chars().any(char::is_control) || path.contains('\\') {
        Some("a path has no control characters and no backslash")
    } else if path.split('/').any(|part| matches!(part, "" | "." | "..")) {
        Some("a path is relative, and no part of it is empty, '.' or '..'")
    } else {
        None
    }
}

/// Settings of a job as changes to a scene description.
///
/// # Errors
/// All violations, with paths such as `job.settings.spp`.
pub fn settings_from_wire(settings: &v1::RenderSettings) -> Result<Overrides, Vec<Violation>> {
    let mut found = Found::default();
    found.check_count("spp", settings.spp, 1);
    found.check_count("min_spp", settings.min_spp, 2);
    found.check_count("max_spp", settings.max_spp, 2);
    found.check_positive("target_error", settings.target_error);
    found.check_positive("time_limit_seconds", settings.time_limit_seconds);
    let adaptive =
        settings.target_error.is_some() || settings.min_spp.is_some() || settings.max_spp.is_some();
    if settings.spp.is_some() && adaptive {
        let text = "cannot be set together with target_error, min_spp or max_spp";
        found.add("job.settings.spp", text);
    }
    if let (Some(min), Some(max)) = (settings.min_spp, settings.max_spp)
        && min > max
    {
        found.add("job.settings.min_spp", format!("found {min}, expected at most max_spp, which is {max}"));
    }
    if let Some(size) = settings.size.filter(|size| size.width == 0 || size.height == 0) {
        let text = format!("found {}x{}, expected at least one pixel", size.width, size.height);
        found.add("job.settings.size", text);
    }
    let crop = settings.crop.map(|crop| region_from_wire(&crop));
    if let Some(crop) = crop.filter(|crop| crop.area() == 0) {
        let text = format!(
            "found x from {} to {} and y from {} to {}, expected at least one pixel",
            crop.x0, crop.x1, crop.y0, crop.y1
        );
        found.add("job.settings.crop", text);
    }
    found.or(Overrides {
        spp: settings.spp,
        target_error: settings.target_error,
        error_of: match settings.error_of() {
            v1::ErrorOf::Unspecified => None,
            v1::ErrorOf::Noisy => Some(ErrorOf::Noisy),
            v1::ErrorOf::Denoised => Some(ErrorOf::Denoised),
        },
        min_spp: settings.min_spp,
        max_spp: settings.max_spp,
        time_limit: settings.time_limit_seconds,
        seed: settings.seed,
        size: settings.size.map(|size| (size.width, size.height)),
        crop,
    })
}

/// Changes to a scene description as the settings of a job.
pub fn settings_to_wire(overrides: &Overrides) -> v1::RenderSettings {
    v1::RenderSettings {
        spp: overrides.spp,
        target_error: overrides.target_error,
        min_spp: overrides.min_spp,
        max_spp: overrides.max_spp,
        time_limit_seconds: overrides.time_limit,
        seed: overrides.seed,
        size: overrides.size.map(|(width, height)| v1::Size { width, height }),
        crop: overrides.crop.as_ref().map(region_to_wire),
        error_of: match overrides.error_of {
            None => v1::ErrorOf::Unspecified,
            Some(ErrorOf::Noisy) => v1::ErrorOf::Noisy,
            Some(ErrorOf::Denoised) => v1::ErrorOf::Denoised,
        }
        .into(),
    }
}

/// The size of a full frame for the wire.
pub fn size_to_wire(size: FrameSize) -> v1::Size {
    v1::Size { width: size.width, height: size.height }
}

/// A region for the wire.
pub fn region_to_wire(region: &Region) -> v1::Region {
    v1::Region { x0: region.x0, y0: region.y0, x1: region.x1, y1: region.y1 }
}

/// A region from the wire; it may be empty or lie anywhere.
pub fn region_from_wire(region: &v1::Region) -> Region {
    Region { x0: region.x0, y0: region.y0, x1: region.x1, y1: region.y1 }
}

/// What rendering cost.
pub fn statistics_to_wire(counters: &Counters) -> v1::Statistics {
    v1::Statistics {
        samples: counters.samples,
        rays: counters.rays,
        shadow_rays: counters.shadow_rays,
        nonfinite_samples: counters.nan_samples + counters.infinite_samples,
        exhausted_rays: counters.exhausted_rays,
        sdf_evaluations: counters.sdf_evaluations,
    }
}

/// A finished round of a frame, from the film's summary after it.
pub fn round_to_wire(frame: i32, round: u32, summary: &FrameSummary, seconds: f64) -> v1::RoundFinished {
    v1::RoundFinished { frame, round, spp: summary.spp_mean, rel_mse: summary.rel_mse, seconds }
}

/// Pixels as the `rgb_f32` of a collected tile.
pub fn rgb_f32(pixels: impl IntoIterator<Item = [f32; 3]>) -> Vec<u8> {
    pixels.into_iter().flatten().flat_map(f32::to_le_bytes).collect()
}

/// Pixels as the `rgb_f16` of a preview tile; values beyond the range of half floats become its ends.
pub fn rgb_f16(pixels: impl IntoIterator<Item = [f32; 3]>) -> Vec<u8> {
    let half = |value: f32| half::f16::from_f32(value.clamp(-65504.0, 65504.0)).to_le_bytes();
    pixels.into_iter().flatten().flat_map(half).collect()
}

/// The values of a preview tile's `rgb_f16`, R G B of each element; half a value at the end is left out.
pub fn from_f16(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.chunks_exact(2).map(|pair| half::f16::from_le_bytes([pair[0], pair[1]]).to_f32())
}

/// Problems of a scene document as violations: the place as the field, and the count of all of them.
pub fn problems_to_violations(problems: &Problems) -> (Vec<Violation>, usize) {
    let violation = |problem: &karst_core::scene::Problem| {
        let mut field = problem.origin.clone();
        if problem.line > 0 {
            field = format!("{field}:{}:{}", problem.line, problem.column);
        }
        if !problem.path.is_empty() {
            field = format!("{field}: {}", problem.path);
        }
        let hint = problem.hint.as_ref().map(|hint| format!("\n  hint: {hint}")).unwrap_or_default();
        Violation::new(field, format!("{}{hint}", problem.message))
    };
    (problems.problems.iter().map(violation).collect(), problems.total)
}

/// `INVALID_ARGUMENT` / `SCENE_INVALID` with the problems of a scene document.
pub fn problems_to_status(problems: &Problems) -> Status {
    let (violations, total) = problems_to_violations(problems);
    bad_request_of(ErrorReason::SceneInvalid, &violations, total)
}

/// Violations while a message is checked.
#[derive(Default)]
struct Found(Vec<Violation>);

impl Found {
    fn add(&mut self, field: impl Into<String>, description: impl Into<String>) {
        self.0.push(Violation::new(field, description));
    }

    fn check_digest(&mut self, field: &str, digest: &str) {
        if digest.len() != 64 || !digest.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b)) {
            let text = format!("found {:?}, expected 64 lower-case hexadecimal digits", shorten(digest));
            self.add(field, text);
        }
    }

    fn check_count(&mut self, name: &str, value: Option<u32>, least: u32) {
        if let Some(value) = value.filter(|value| !(least..=MAX_SPP).contains(value)) {
            self.add(format!("job.settings.{name}"), format!("found {value}, expected {least} to {MAX_SPP}"));
        }
    }

    fn check_positive(&mut self, name: &str, value: Option<f64>) {
        if let Some(value) = value.filter(|value| !value.is_finite() || *value <= 0.0) {
            let text = format!("found {value}, expected a finite number above 0");
            self.add(format!("job.settings.{name}"), text);
        }
    }

    fn or<T>(self, value: T) -> Result<T, Vec<Violation>> {
        if self.0.is_empty() { Ok(value) } else { Err(self.0) }
    }
}

/// The first characters of untrusted text.
fn shorten(text: &str) -> String {
    text.chars().take(80).collect()
}

#[cfg(test)]
#[path = "convert_tests.rs"]
mod tests;
