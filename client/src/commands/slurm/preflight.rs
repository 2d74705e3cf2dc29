//! `karst slurm preflight`: one frame, small and noisy, to find now what would go wrong on a hundred nodes later.

use std::path::Path;

use karst_client::{Error, open_scene};
use karst_core::film::Region;
use karst_core::scene::{Goal, Limits};
use karst_denoise::Denoiser;
use serde_json::json;
use tempfile::TempDir;

use super::render::prepare;
use super::shot::Shot;
use crate::args::{DenoiseArg, FrameList, PreflightArgs, RenderArgs, SettingsArgs};
use crate::commands::render::render_each;
use crate::report::Report;
use crate::talk::Talk;

/// The edges of the trial are those of the film divided by this.
const SMALLER: u32 = 10;

pub(super) fn run(args: &PreflightArgs, talk: Talk) -> Result<(), Error> {
    let shot = Shot::open(&args.shot)?;
    let chosen = shot.chosen(args.chosen.frames)?;
    check(args, &shot, chosen, talk)
}

/// Renders the trial of the first frame and says what all the frames would take.
pub(super) fn check(args: &PreflightArgs, shot: &Shot, chosen: FrameList, talk: Talk) -> Result<(), Error> {
    talk.say(&format_args!("scene {}: valid, its files are there", args.shot.scene.display()));
    prepare(&shot.folder)?;
    talk.say(&format_args!("folder {}: can be written to", shot.folder.display()));
    let is_denoised = args.shot.work.denoise != DenoiseArg::Off;
    let denoiser = Denoiser::find();
    match &denoiser {
        Ok(_) => talk.say(&"denoiser: found"),
        Err(error) if is_denoised => return Err(Error::Failed(error.to_string())),
        Err(error) => talk.say(&format_args!("denoiser: not needed, and not here: {error}")),
    }
    let folder = TempDir::with_prefix_in(".karst-preflight-", &shot.folder);
    let folder = folder.map_err(|source| Error::file(&shot.folder, source))?;
    let film = &shot.description.film;
    let small = (film.width.div_ceil(SMALLER), film.height.div_ceil(SMALLER));
    let trial = trial(args, chosen.first, small, folder.path());
    let scene = open_scene(&trial.scene, &Limits::default())?;
    let reports = render_each(&trial, &scene, &|_, _| {})?;
    let frames = chosen.iter().count();
    for report in &reports {
        let estimate = Estimate::of(shot, report);
        let seconds = estimate.seconds;
        talk.say(&format_args!(
            "trial: frame {}, {}x{} pixels, 1 sample per pixel, {:.2} s",
            chosen.first, small.0, small.1, report.wall_seconds
        ));
        let bound = if estimate.is_bound { "at most " } else { "about " };
        let text = format!(
            "estimate of the rendering alone: {bound}{} a frame with {} threads of this machine; {frames} frames: \
             {bound}{}, divided by as many as run at once",
            duration(seconds),
            report.threads,
            duration(seconds * frames as f64)
        );
        let line = json!({
            "event": "preflight",
            "frame": chosen.first,
            "frames": frames,
            "threads": report.threads,
            "denoiser": denoiser.is_ok(),
            "trial_seconds": report.wall_seconds,
            "estimated_seconds_per_frame": seconds,
            "estimated_seconds": seconds * frames as f64,
            "at_most": estimate.is_bound,
        });
        talk.result(&text, &line);
    }
    Ok(())
}

fn trial(args: &PreflightArgs, frame: i32, (width, height): (u32, u32), folder: &Path) -> RenderArgs {
    let whole = Region { x0: 0, y0: 0, x1: width, y1: height };
    RenderArgs {
        scene: args.shot.scene.clone(),
        output: vec![folder.join("trial.exr")],
        frame: Some(frame),
        frames: None,
        threads: args.threads,
        report: Vec::new(),
        profile: false,
        settings: SettingsArgs {
            spp: Some(1),
            seed: args.shot.settings.seed,
            size: Some((width, height)),
            crop: Some(whole),
            ..SettingsArgs::default()
        },
        work: args.shot.work.clone(),
    }
}

/// How long one frame may take.
struct Estimate {
    seconds: f64,
    /// Whether it is more likely to take less: with a target error nobody knows before how many samples it takes.
    is_bound: bool,
}

impl Estimate {
    /// Scales a trial with one sample per pixel by pixels and samples.
    fn of(shot: &Shot, trial: &Report) -> Self {
        let (film, sampling) = (&shot.description.film, &shot.description.sampling);
        let window = film.window();
        let pixels = f64::from(window.width) * f64::from(window.height);
        let larger = pixels / (f64::from(trial.width) * f64::from(trial.height));
        let (spp, is_bound) = match sampling.goal {
            Goal::Fixed { spp } => (spp, sampling.time_limit.is_some()),
            Goal::Error { max_spp, .. } => (max_spp, true),
        };
        let render = trial.render_seconds * larger * f64::from(spp);
        // A time limit ends a frame between rounds: the one that runs is finished.
        let render = sampling.time_limit.map_or(render, |limit| render.min(2.0 * limit));
        let seconds = trial.stages.get("build").copied().unwrap_or(0.0) + render;
        Self { seconds, is_bound }
    }
}

/// `850 ms`, `12.5 s`, `3.4 min`, `5.1 h`.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{:.0} ms", s * 1e3),
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 7200.0 => format!("{:.1} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn durations_are_for_people() {
        for (seconds, text) in [(0.85, "850 ms"), (12.5, "12.5 s"), (204.0, "3.4 min"), (18_360.0, "5.1 h")] {
            assert_eq!(duration(seconds), text);
        }
    }
}
