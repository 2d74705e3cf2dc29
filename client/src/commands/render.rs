//! `karst render`: renders frames on this machine and writes pictures and a report.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};

use karst_client::{Error, OpenScene, open_scene, scene_error};
use karst_core::encode::{object_statistics, statistics};
use karst_core::film::{CrossError, Film, FrameSummary};
use karst_core::integrator::StageObserver;
use karst_core::render::{FrameObserver, Progress, render_frame};
use karst_core::scene::{Assets, Document, ErrorOf, Goal, Limits, Scene};
use rayon::ThreadPool;
use serde_json::{Value, json};

use crate::args::{DenoiseArg, FrameList, RenderArgs};
use crate::clock::Stopwatch;
use crate::commands::convert::say_notes;
use crate::commands::pictures::{Pictures, denoised_error};
use crate::naming::of_frame;
use crate::profile::{Profile, Watch, table};
use crate::progress::{Bar, Shown, percent};
use crate::report::{Finished, Page, Report, RoundFigures};
use crate::talk::Talk;

/// Edge of a tile in pixels unless given; a tile is one piece of work for a thread.
const DEFAULT_TILE_SIZE: u32 = 32;

/// Hears of a frame whose files are written.
type Tell<'a> = &'a (dyn Fn(&Report, &[PathBuf]) + Sync);

pub(super) fn run(args: &RenderArgs, talk: Talk) -> Result<(), Error> {
    check_names("--output", &args.output, &["exr", "png"])?;
    check_names("--report", &args.report, &["json", "html"])?;
    let scene = open_scene(&args.scene, &Limits::default())?;
    say_notes(&scene, talk);
    let hear = |report: &Report, files: &[PathBuf]| {
        tell(talk, report, files);
        if args.profile {
            talk.say(&table(&report.profile));
        }
    };
    render_each(args, &scene, &hear).map(drop)
}

/// Renders and writes what the arguments ask for; `tell` hears of each frame.
pub(super) fn render_each(
    args: &RenderArgs,
    scene: &OpenScene,
    tell: Tell<'_>,
) -> Result<Vec<Report>, Error> {
    let limits = Limits::default();
    let document = scene.document(&limits).map_err(|problems| scene_error(&problems))?;
    let frames = chosen_frames(args, &document)?;
    let assets = Assets::load(&document, scene, &limits).map_err(|problems| scene_error(&problems))?;
    let page = args.report.iter().any(|path| is_page(path)).then(Mutex::default);
    let job = Job { args, tell, document, assets, limits, pool: pool(args.threads)?, bar: Bar::new(), page };
    let reports = job.render_all(frames)?;
    for path in &args.report {
        match &job.page {
            Some(page) if is_page(path) => {
                let title = args.scene.file_stem().unwrap_or(args.scene.as_os_str()).to_string_lossy();
                let html = page.lock().unwrap_or_else(PoisonError::into_inner).html(&title);
                std::fs::write(path, html).map_err(|source| Error::file(path, source))?;
            }
            _ => write_report(path, &reports)?,
        }
    }
    Ok(reports)
}

/// Refuses names of files whose ending is none of the `endings`, and those that come twice.
fn check_names(flag: &str, names: &[PathBuf], endings: &[&str]) -> Result<(), Error> {
    for (index, path) in names.iter().enumerate() {
        if !path.extension().is_some_and(|ending| endings.iter().any(|known| ending == *known)) {
            let endings = endings.join(" or .");
            return Err(Error::Usage(format!("{flag} {}: expected a name in .{endings}", path.display())));
        }
        if names[..index].contains(path) {
            return Err(Error::Usage(format!("{flag} {}: found twice", path.display())));
        }
    }
    Ok(())
}

fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "html")
}

fn chosen_frames(args: &RenderArgs, document: &Document) -> Result<FrameList, Error> {
    let range = document.frames();
    let chosen = args.frames.unwrap_or_else(|| FrameList::one(args.frame.unwrap_or(range.first)));
    if chosen.first < range.first || chosen.last > range.last {
        return Err(Error::Usage(format!(
            "frames {} to {}: the scene has frames {} to {}",
            chosen.first, chosen.last, range.first, range.last
        )));
    }
    Ok(chosen)
}

fn pool(threads: Option<u32>) -> Result<ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0) as usize)
        .build()
        .map_err(|error| Error::Failed(format!("cannot start {threads:?} threads: {error}")))
}

fn write_report(path: &Path, reports: &[Report]) -> Result<(), Error> {
    let value = match reports {
        [one] => json!(one),
        several => json!({"frames": several}),
    };
    std::fs::write(path, format!("{value:#}\n")).map_err(|source| Error::file(path, source))
}

/// Everything that the frames share.
struct Job<'a> {
    args: &'a RenderArgs,
    tell: Tell<'a>,
    document: Document,
    assets: Assets,
    limits: Limits,
    pool: ThreadPool,
    bar: Bar,
    /// The report as a page, if one is asked for.
    page: Option<Mutex<Page>>,
}

impl Job<'_> {
    fn render_all(&self, frames: FrameList) -> Result<Vec<Report>, Error> {
        let total = frames.iter().count() as u32;
        frames.iter().zip(0..).map(|(frame, finished)| self.render_one(frame, finished, total)).collect()
    }

    fn render_one(&self, frame: i32, finished: u32, total: u32) -> Result<Report, Error> {
        let wall = Stopwatch::start();
        let scene = self.pool.install(|| self.build(frame))?;
        let built = wall.seconds();
        let profile = Profile::default();
        let (film, rounds) = self.render(&scene, frame, (finished, total), &profile)?;
        let rendered = wall.seconds();
        let summary = film.summary();
        let threads = self.pool.current_num_threads();
        let mut report = Report::of(&summary, film.window(), frame, threads);
        report.objects = object_statistics(scene.function_names(), film.objects());
        report.rendered_in(rendered - built);
        report.profile = profile.to_json();
        report.rounds = rounds;
        let denoise = self.args.work.denoise;
        let pictures = Pictures::new(&film, &scene, denoise, threads)?;
        let denoised = wall.seconds();
        let error = denoised_error(&film, &scene, denoise, threads).unwrap_or_else(|error| {
            // The picture itself is denoised: an unknown error is no reason to lose it.
            report.warnings.push(format!("the error of the denoised picture is unknown: {error}"));
            None
        });
        let error = error.map(CrossError::at_least_zero);
        report.denoised_rel_mse = error.map(|error| error.rel_mse);
        report.denoised_rel_mse_ci95 = error.map(|error| error.ci95);
        let seed = scene.sampling().seed;
        let statistics = statistics(frame, seed, &summary, error.as_ref(), &report.objects);
        let judged = wall.seconds();
        let paths = self.args.output.iter().map(|path| of_frame(path, frame, self.args.frames.is_some()));
        let mut files = Vec::new();
        for path in paths {
            files.extend(pictures.write(&path, &statistics)?);
        }
        report.wall_seconds = wall.seconds();
        report.stages = [
            ("build", built),
            ("render", rendered - built),
            ("denoise", denoised - rendered),
            ("judge", judged - denoised),
            ("write", report.wall_seconds - judged),
        ]
        .into();
        if let Some(page) = &self.page {
            let target = match scene.sampling().goal {
                Goal::Error { target, of: ErrorOf::Noisy, .. } => Some(target),
                // The curve is that of the noisy picture.
                Goal::Error { .. } | Goal::Fixed { .. } => None,
            };
            let (exposure, view) = (scene.exposure(), scene.view());
            let finished = Finished { report: &report, target, picture: &pictures.best(), exposure, view };
            page.lock().unwrap_or_else(PoisonError::into_inner).add(&finished)?;
        }
        (self.tell)(&report, &files);
        Ok(report)
    }

    fn build(&self, frame: i32) -> Result<Scene, Error> {
        let mut description = self.document.at(frame).map_err(|problems| scene_error(&problems))?;
        description
            .apply(&self.args.settings.overrides(), &self.limits)
            .map_err(|problems| scene_error(&problems))?;
        let is_denoised = matches!(description.sampling.goal, Goal::Error { of: ErrorOf::Denoised, .. });
        if is_denoised && self.args.work.denoise == DenoiseArg::Off {
            let text = "the denoised picture has to reach the target error (error_of), but nothing is denoised: add --denoise full";
            return Err(Error::Usage(text.to_owned()));
        }
        Scene::build(&description, &self.assets, frame).map_err(|problems| scene_error(&problems))
    }

    fn render(
        &self,
        scene: &Scene,
        frame: i32,
        (finished, total): (u32, u32),
        profile: &Profile,
    ) -> Result<(Film, Vec<RoundFigures>), Error> {
        let start = Shown { frame, frames_finished: finished, frames_total: total, ..Shown::default() };
        let observer = Observer {
            bar: &self.bar,
            clock: Stopwatch::start(),
            scene,
            start,
            profile,
            rounds: Mutex::default(),
            denoise: self.args.work.denoise,
            failed: Mutex::default(),
        };
        let never = AtomicBool::new(false);
        let tile_size = self.args.work.tile_size.unwrap_or(DEFAULT_TILE_SIZE);
        let film = self.pool.install(|| render_frame(scene, tile_size, &never, &observer));
        self.bar.clear();
        if let Some(error) = observer.failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
            return Err(error);
        }
        let film = film.expect("a render ends early only when it is told to stop, and nobody does");
        let seconds = observer.clock.seconds();
        let mut rounds = observer.rounds.into_inner().unwrap_or_else(PoisonError::into_inner);
        let summary = film.summary();
        if rounds.last().is_none_or(|last| last.samples < summary.samples) {
            rounds.push(RoundFigures::of(rounds.len() as u32, seconds, &summary));
        }
        Ok((film, rounds))
    }
}

/// Says how a frame went and which files it became.
pub(super) fn tell(talk: Talk, report: &Report, files: &[PathBuf]) {
    let error = report.rel_mse.map_or_else(|| "unknown".to_owned(), |error| percent(error.sqrt()));
    let denoised = report
        .denoised_rel_mse
        .map_or_else(String::new, |error| format!(", denoised about {}", percent(error.sqrt())));
    talk.say(&format_args!(
        "frame {}: {:.1} samples per pixel, error {error}{denoised}, {:.2} s, {:.2} million samples/s",
        report.frame, report.spp_mean, report.render_seconds, report.msamples_per_second
    ));
    for warning in &report.warnings {
        talk.say(&format_args!("warning: {warning}"));
    }
    for (count, what) in [
        (report.nonfinite_samples, "samples were not finite and were dropped"),
        (report.exhausted_rays, "rays ran out of marching steps"),
    ] {
        if count > 0 {
            talk.say(&format_args!("warning: {count} {what}"));
        }
    }
    let mut line: Value = json!(report);
    line["event"] = "frame".into();
    line["files"] = json!(files);
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    talk.result(&names.join("\n"), &line);
}

/// Shows how a frame is going, and ends it when its time is over.
struct Observer<'a> {
    bar: &'a Bar,
    clock: Stopwatch,
    scene: &'a Scene,
    start: Shown,
    profile: &'a Profile,
    rounds: Mutex<Vec<RoundFigures>>,
    denoise: DenoiseArg,
    /// Why the denoised picture could not be judged.
    failed: Mutex<Option<Error>>,
}

impl FrameObserver for Observer<'_> {
    fn tile_done(&self, progress: &Progress) {
        // How many samples a target error takes is not known before; the running round is.
        let planned = match self.scene.sampling().goal {
            Goal::Fixed { spp } => self.scene.window().area() as u64 * u64::from(spp),
            Goal::Error { .. } => progress.samples_round,
        };
        let left = planned.saturating_sub(progress.samples_done) as f64;
        self.bar.show(&Shown {
            samples_done: progress.samples_done,
            samples_planned: planned,
            error: progress.rel_mse.map(f64::sqrt),
            seconds_left: Some(self.clock.seconds() * left / progress.samples_done.max(1) as f64),
            ..self.start.clone()
        });
    }

    fn stages(&self) -> Box<dyn StageObserver + '_> {
        Box::<Watch<'_>>::new(self.profile.watch())
    }

    fn denoised_error(&self, film: &Film) -> Option<f64> {
        let threads = rayon::current_num_threads();
        match denoised_error(film, self.scene, self.denoise, threads) {
            // With few samples it is a rough guess, and one guess of several that is too low must not end the frame.
            Ok(found) => found.map(|error| error.ci95[1]),
            Err(error) => {
                *self.failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                // Ends the frame: what it cannot be judged by is not waited for.
                Some(0.0)
            }
        }
    }

    fn another_round(&self, summary: &FrameSummary) -> bool {
        let mut rounds = self.rounds.lock().unwrap_or_else(PoisonError::into_inner);
        let round = rounds.len() as u32;
        rounds.push(RoundFigures::of(round, self.clock.seconds(), summary));
        self.scene.sampling().time_limit.is_none_or(|limit| self.clock.seconds() < limit)
    }
}
