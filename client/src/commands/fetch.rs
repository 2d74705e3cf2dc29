//! `karst fetch`: downloads the files of finished frames.

use std::path::{Path, PathBuf};

use karst_client::{Client, Download, Error};
use karst_proto::v1::{Frame, FrameFormat, FrameState, Job};
use serde_json::json;

use crate::args::{FetchArgs, FormatArg, FrameList};
use crate::commands::follow::frame_line;
use crate::naming::{denoised, of_frame, safe_stem};
use crate::talk::Talk;

/// What to download.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    /// All frames unless given.
    pub(super) frames: Option<FrameList>,
    /// All formats when empty.
    pub(super) formats: Vec<FormatArg>,
}

pub(super) async fn run(args: FetchArgs, talk: Talk) -> Result<(), Error> {
    let client = args.server.connect().await?;
    let job = client.job(&args.job).await?;
    let wanted = Wanted { frames: args.frames, formats: args.format };
    let count = download_frames(&client, &job, &wanted, &args.output, talk).await?;
    if count == 0 {
        return Err(Error::Failed(format!("job {} has no finished frame of those asked for", job.id)));
    }
    Ok(())
}

/// Downloads what is finished; returns the number of frames.
pub(super) async fn download_frames(
    client: &Client,
    job: &Job,
    wanted: &Wanted,
    folder: &Path,
    talk: Talk,
) -> Result<usize, Error> {
    let is_wanted = |frame: &Frame| {
        frame.state() == FrameState::Finished && wanted.frames.is_none_or(|list| list.contains(frame.frame))
    };
    let frames: Vec<Frame> = client.frames(&job.id).await?.into_iter().filter(is_wanted).collect();
    for frame in &frames {
        talk.say(&frame_line(frame));
        if let Some(error) = &frame.error {
            talk.say(&format_args!("warning: frame {}: {}", frame.frame, error.message));
        }
        for file in &frame.files {
            let Some(path) = path_of(job, frame.frame, file.format()) else { continue };
            if !wanted.formats.is_empty() && !wanted.formats.iter().any(|f| wire_format(*f) == file.format())
            {
                continue;
            }
            let path = folder.join(path);
            let (job, format) = (job.id.clone(), file.format());
            let download = Download { job, frame: frame.frame, format, path: path.clone() };
            let bytes = client.download(&download).await?;
            talk.result(
                &path.display(),
                &json!({"event": "file", "frame": frame.frame, "path": path, "bytes": bytes}),
            );
        }
    }
    Ok(frames.len())
}

/// Where a file goes inside the folder; `None` for a format that this client does not know.
fn path_of(job: &Job, frame: i32, format: FrameFormat) -> Option<PathBuf> {
    let stem = safe_stem(job.spec.as_ref().map_or("", |spec| spec.display_name.as_str()));
    let named = |ending: &str| of_frame(Path::new(&format!("{stem}.{ending}")), frame, job.frames_total > 1);
    match format {
        FrameFormat::Exr => Some(named("exr")),
        FrameFormat::Png => Some(named("png")),
        FrameFormat::PngDenoised => Some(denoised(&named("png"))),
        FrameFormat::Unspecified => None,
    }
}

fn wire_format(format: FormatArg) -> FrameFormat {
    match format {
        FormatArg::Exr => FrameFormat::Exr,
        FormatArg::Png => FrameFormat::Png,
        FormatArg::PngDenoised => FrameFormat::PngDenoised,
    }
}

#[cfg(test)]
mod tests {
    use super::path_of;
    use karst_proto::v1::{FrameFormat, Job, JobSpec};
    use std::path::PathBuf;

    #[test]
    fn files_are_named_after_the_job() {
        let spec = Some(JobSpec { display_name: "a/b".to_owned(), ..JobSpec::default() });
        let mut job = Job { spec, frames_total: 1, ..Job::default() };
        assert_eq!(path_of(&job, 3, FrameFormat::Exr), Some(PathBuf::from("a_b.exr")));
        job.frames_total = 2;
        assert_eq!(path_of(&job, 3, FrameFormat::PngDenoised), Some(PathBuf::from("a_b.0003-denoised.png")));
        assert_eq!(path_of(&job, 3, FrameFormat::Unspecified), None);
    }
}
