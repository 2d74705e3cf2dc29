//! `karst slurm frames`: submits arrays for the frames of a shot that are not complete.

use std::ffi::OsString;

use karst_client::Error;
use serde_json::json;

use super::missing::look;
use super::ranges::{Chunk, chunks, compress};
use super::render::prepare;
use super::shot::Shot;
use super::{preflight, tools};
use crate::args::{FramesArgs, PreflightArgs};
use crate::talk::Talk;

pub(super) fn run(args: &FramesArgs, talk: Talk) -> Result<(), Error> {
    let shot = Shot::open(&args.shot)?;
    let chosen = shot.chosen(args.chosen.frames)?;
    if args.preflight {
        let args = PreflightArgs { shot: args.shot.clone(), chosen: args.chosen.clone(), threads: None };
        return preflight::check(&args, &shot, chosen, talk);
    }
    let missing = look(&shot, chosen, talk);
    if missing.is_empty() {
        return Ok(());
    }
    let limit = tools::array_limit()?;
    prepare(&shot.folder)?;
    let logs = shot.folder.join("logs");
    std::fs::create_dir_all(&logs).map_err(|source| Error::file(&logs, source))?;
    for chunk in chunks(&missing, limit) {
        submit(args, &shot, &chunk, talk)?;
    }
    Ok(())
}

fn submit(args: &FramesArgs, shot: &Shot, chunk: &Chunk, talk: Talk) -> Result<(), Error> {
    let failed = |source| Error::file(&shot.folder, source);
    let folder = std::path::absolute(&shot.folder).map_err(failed)?;
    let mut log = OsString::from("--output=");
    log.push(folder.join("logs").join("%A_%a.log"));
    let mut array = compress(&chunk.indexes);
    if let Some(most) = args.at_once {
        array = format!("{array}%{most}");
    }
    let mut comment = OsString::from("--comment=karst folder=");
    comment.push(&folder);
    let fixed = vec![OsString::from(format!("--array={array}")), comment];
    let mut arguments: Vec<OsString> = vec!["--bin".into(), tools::programs()?.into()];
    if chunk.shift != 0 {
        arguments.extend(["--shift".into(), chunk.shift.to_string().into()]);
    }
    arguments.extend(args.shot.to_line().map_err(failed)?);
    let job = tools::submit(tools::FRAMES, vec![log], &args.sbatch.options, fixed, arguments)?;
    let frames: Vec<i64> = chunk.indexes.iter().map(|index| index + chunk.shift).collect();
    talk.say(&format_args!(
        "submitted job {job}: frames {}, logs in {}",
        compress(&frames),
        folder.join("logs").display()
    ));
    let line =
        json!({"event": "submitted", "job": job, "array": array, "shift": chunk.shift, "frames": frames});
    talk.result(&job, &line);
    Ok(())
}
