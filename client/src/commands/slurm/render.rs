//! `karst slurm render`: one frame of a shot, rendered as `karst render` does, kept whole or not at all.

use std::collections::BTreeMap;
use std::fs::{File, Permissions};
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use karst_client::{Blob, Error, open_scene};
use karst_core::scene::Limits;
use serde_json::json;
use tempfile::{NamedTempFile, TempDir};

use super::shot::Shot;
use crate::args::{FrameList, RenderArgs, ShotArgs, TaskArgs};
use crate::commands::render::{render_each, tell};
use crate::talk::Talk;

pub(super) fn run(args: &TaskArgs, talk: Talk) -> Result<(), Error> {
    let shot = Shot::open(&args.shot)?;
    let frame = args.frame;
    shot.chosen(Some(FrameList::one(frame)))?;
    let Some(why) = shot.lacks(frame) else {
        let text = format!("frame {frame} is complete: nothing to do");
        talk.result(&text, &json!({"event": "skipped", "frame": frame}));
        return Ok(());
    };
    talk.say(&format_args!("frame {frame} is {why}: rendering"));
    prepare(&shot.folder)?;
    let scratch = scratch()?;
    let render = RenderArgs {
        scene: args.shot.scene.clone(),
        output: shot.outputs(frame).iter().map(|name| scratch.path().join(name)).collect(),
        frame: Some(frame),
        frames: None,
        threads: args.threads,
        report: args.report.iter().cloned().collect(),
        profile: false,
        settings: args.shot.settings.clone(),
        work: args.shot.work.clone(),
    };
    let scene = open_scene(&render.scene, &Limits::default())?;
    let reports = render_each(&render, &scene, &|_, _| {})?;
    let kept = keep(&shot, &args.shot, frame, scratch.path())?;
    for report in &reports {
        tell(talk, report, &kept);
    }
    Ok(())
}

/// Makes the folder, and a file in it: what cannot be kept is not rendered.
///
/// # Errors
/// The folder cannot be made or written to.
pub(super) fn prepare(folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(|source| Error::file(folder, source))?;
    beside(folder).map(drop)
}

/// A folder of this run, in the scratch space of the node where that is set.
fn scratch() -> Result<TempDir, Error> {
    let place = std::env::temp_dir();
    TempDir::with_prefix_in("karst-", &place).map_err(|source| Error::file(place, source))
}

/// A file in the folder that goes away unless it gets a name.
fn beside(folder: &Path) -> Result<NamedTempFile, Error> {
    let made = tempfile::Builder::new()
        .prefix(".karst-")
        .suffix(".part")
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder);
    made.map_err(|source| Error::file(folder, source))
}

/// Moves what was rendered into the folder, the note last.
fn keep(shot: &Shot, args: &ShotArgs, frame: i32, scratch: &Path) -> Result<Vec<PathBuf>, Error> {
    if !Shot::open(args)?.is_same(shot) {
        return Err(Error::Failed(format!(
            "{}: the scene changed while frame {frame} was rendered; nothing is kept: render it again",
            args.scene.display()
        )));
    }
    let (mut files, mut kept) = (BTreeMap::new(), Vec::new());
    for name in shot.names(frame) {
        let from = scratch.join(&name);
        let bytes = std::fs::read(&from).map_err(|source| Error::file(from, source))?;
        let to = shot.folder.join(&name);
        write_whole(&to, &bytes)?;
        files.insert(name.to_string_lossy().into_owned(), Blob::of_bytes(&bytes).digest().to_owned());
        kept.push(to);
    }
    write_whole(&shot.note_path(frame), &shot.note(frame, files))?;
    Ok(kept)
}

/// Writes a file so that nobody ever sees a part of it, under this name.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let failed = |source| Error::file(path, source);
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut part = beside(folder)?;
    part.write_all(bytes).and_then(|()| part.as_file().sync_all()).map_err(failed)?;
    part.persist(path).map_err(|error| failed(error.error))?;
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed)
}
