//! `karst slurm missing`: the frames that are not complete, as a value for `--array=`.

use std::collections::BTreeMap;

use karst_client::Error;
use rayon::prelude::{IntoParallelIterator, ParallelIterator};
use serde_json::json;

use super::ranges::compress;
use super::shot::Shot;
use crate::args::{FrameList, MissingArgs};
use crate::talk::Talk;

pub(super) fn run(args: &MissingArgs, talk: Talk) -> Result<(), Error> {
    let shot = Shot::open(&args.shot)?;
    let chosen = shot.chosen(args.chosen.frames)?;
    let missing = look(&shot, chosen, talk);
    let array = compress(&missing);
    if missing.iter().any(|frame| *frame < 0) {
        talk.say(
            &"note: Slurm has no indexes below 0; `karst slurm frames` shifts them, `--array=` by hand cannot",
        );
    }
    let total = chosen.iter().count();
    let line = json!({"array": array, "missing": missing, "complete": total - missing.len(), "total": total});
    if array.is_empty() {
        talk.event(&line);
    } else {
        talk.result(&array, &line);
    }
    Ok(())
}

/// The frames that are not complete, ascending; says how many and why.
pub(super) fn look(shot: &Shot, chosen: FrameList, talk: Talk) -> Vec<i64> {
    let frames: Vec<i32> = chosen.iter().collect();
    let total = frames.len();
    let lacking: Vec<(i32, &str)> =
        frames.into_par_iter().filter_map(|frame| Some((frame, shot.lacks(frame)?))).collect();
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for (_, why) in &lacking {
        *reasons.entry(why).or_default() += 1;
    }
    let folder = shot.folder.display();
    if lacking.is_empty() {
        talk.say(&format_args!("{folder}: all {total} frames are complete"));
    } else {
        let reasons: Vec<String> = reasons.iter().map(|(why, count)| format!("{count} {why}")).collect();
        let (count, reasons) = (lacking.len(), reasons.join(", "));
        talk.say(&format_args!("{folder}: {count} of {total} frames are not complete: {reasons}"));
    }
    lacking.into_iter().map(|(frame, _)| i64::from(frame)).collect()
}
