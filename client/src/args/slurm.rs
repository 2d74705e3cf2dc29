//! The command line of `karst slurm`, and the flags that it hands on to the scripts in `slurm/`.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use karst_client::DEFAULT_SERVER;

use super::values::{FrameList, frames};
use super::{DenoiseArg, ServerArgs, SettingsArgs, WorkArgs};

/// Renders on a Slurm cluster: a film as an array of frames, or workers of a server as an array of pilots.
#[derive(Debug, Subcommand)]
pub(crate) enum SlurmCommand {
    /// Submit an array job that renders the frames that are not complete, one frame a task, without a server.
    Frames(FramesArgs),
    /// Print the frames that are not complete as a value for `sbatch --array=`.
    Missing(MissingArgs),
    /// Render one frame small and with one sample per pixel; check files, permissions and denoiser; estimate the time.
    Preflight(PreflightArgs),
    /// Render one frame as a task of an array does: not at all when it is complete, else whole or not at all.
    Render(TaskArgs),
    /// Submit workers for a server: pilot jobs that render its tiles until they are told to stop.
    Up(UpArgs),
    /// Show the workers of a server that wait and run on the cluster.
    Status(PilotsArgs),
    /// Stop the workers of a server: those that run hand back what they hold, those that wait are cancelled.
    Down(PilotsArgs),
}

/// A scene, the folder of its frames, and how they are rendered.
#[derive(Clone, Debug, Args)]
pub(crate) struct ShotArgs {
    /// Scene: a karst document, or what `karst convert` reads.
    pub(crate) scene: PathBuf,
    /// Folder for the frames: DIR/NAME.0001.exr with the name of the scene, beside each a note of what it was made
    /// from.
    #[arg(short, long = "output", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Write a PNG beside every EXR.
    #[arg(long)]
    pub(crate) png: bool,
    #[command(flatten)]
    pub(crate) settings: SettingsArgs,
    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

impl ShotArgs {
    /// The same as flags, with absolute paths, for a task that runs elsewhere.
    ///
    /// # Errors
    /// The current folder is gone.
    pub(crate) fn to_line(&self) -> std::io::Result<Vec<OsString>> {
        let Self { scene, output, png, settings, work } = self;
        let mut line = vec![
            std::path::absolute(scene)?.into(),
            "--output".into(),
            std::path::absolute(output)?.into_os_string(),
        ];
        let SettingsArgs { spp, target_error, error_of, min_spp, max_spp, time_limit, seed, size, crop } =
            settings;
        let WorkArgs { tile_size, denoise } = work;
        let mut flag = |name: &str, value: Option<String>| {
            line.extend(value.map(|value| OsString::from(format!("--{name}={value}"))));
        };
        let text = |number: &Option<u32>| number.map(|number| number.to_string());
        let real = |number: &Option<f64>| number.map(|number| number.to_string());
        flag("spp", text(spp));
        flag("target-error", real(target_error));
        let error_of = error_of.and_then(|of| of.to_possible_value());
        flag("error-of", error_of.map(|value| value.get_name().to_owned()));
        flag("min-spp", text(min_spp));
        flag("max-spp", text(max_spp));
        flag("time-limit", real(time_limit));
        flag("seed", text(seed));
        flag("size", size.map(|(width, height)| format!("{width}x{height}")));
        flag("crop", crop.map(|c| format!("{},{},{},{}", c.x0, c.y0, c.width(), c.height())));
        flag("tile-size", text(tile_size));
        if *denoise != DenoiseArg::Off {
            flag("denoise", denoise.to_possible_value().map(|value| value.get_name().to_owned()));
        }
        if *png {
            line.push("--png".into());
        }
        Ok(line)
    }
}

/// Frames of a shot.
#[derive(Clone, Debug, Args)]
pub(crate) struct ChosenFrames {
    /// Frames of the animation, such as 1-250 or 1-250:2; all unless given.
    #[arg(long, value_name = "A-B:STEP", allow_hyphen_values = true, value_parser = frames)]
    pub(crate) frames: Option<FrameList>,
}

/// Options that `sbatch` gets.
#[derive(Clone, Debug, Args)]
pub(crate) struct SbatchArgs {
    /// Options for sbatch, such as --partition=long --account=films --cpus-per-task=32 --time=4:00:00.
    #[arg(last = true, value_name = "SBATCH OPTIONS")]
    pub(crate) options: Vec<OsString>,
}

#[derive(Debug, Args)]
pub(crate) struct FramesArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,
    #[command(flatten)]
    pub(crate) chosen: ChosenFrames,
    /// So many tasks of an array at once, and no more.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) at_once: Option<u32>,
    /// Only do what `karst slurm preflight` does; nothing is submitted.
    #[arg(long)]
    pub(crate) preflight: bool,
    #[command(flatten)]
    pub(crate) sbatch: SbatchArgs,
}

#[derive(Debug, Args)]
pub(crate) struct MissingArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,
    #[command(flatten)]
    pub(crate) chosen: ChosenFrames,
}

#[derive(Debug, Args)]
pub(crate) struct PreflightArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,
    #[command(flatten)]
    pub(crate) chosen: ChosenFrames,
    /// Threads that render; as many as the machine has unless given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
}

#[derive(Debug, Args)]
pub(crate) struct TaskArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,
    /// Frame of the animation.
    #[arg(long, value_name = "F", allow_hyphen_values = true)]
    pub(crate) frame: i32,
    /// Threads that render; as many as the machine has unless given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
    /// Write figures of the run as JSON: times, samples, rays, error, memory.
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct UpArgs {
    #[command(flatten)]
    pub(crate) server: ServerArgs,
    /// So many workers: tasks of the array.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) workers: u32,
    #[command(flatten)]
    pub(crate) sbatch: SbatchArgs,
}

#[derive(Debug, Args)]
pub(crate) struct PilotsArgs {
    /// Address of the server, as `karst slurm up` was given it.
    #[arg(long, env = "KARST_SERVER", value_name = "URL", default_value = DEFAULT_SERVER)]
    pub(crate) server: String,
}

#[cfg(test)]
mod tests {
    use super::{ShotArgs, SlurmCommand};
    use crate::args::{Cli, Command};
    use clap::Parser;
    use std::ffi::OsString;

    fn shot(line: &[OsString]) -> ShotArgs {
        let command = ["karst", "slurm", "missing"].map(OsString::from);
        let command = Cli::try_parse_from([&command, line].concat()).unwrap().command;
        let Command::Slurm(SlurmCommand::Missing(args)) = command else { panic!("expected `slurm missing`") };
        args.shot
    }

    #[test]
    fn a_task_elsewhere_gets_the_same_settings() {
        let fixed = "/s/a b.json -o /out --spp 7 --time-limit 0.1 --seed 9 --size 64x32 --crop 1,2,3,4 \
                     --tile-size 16 --denoise full --png";
        let adaptive = "/s/c.json -o /out --target-error 0.015 --min-spp 8 --max-spp 99";
        for text in [fixed, adaptive] {
            let words = text.replace("a b", "a_b");
            let line: Vec<OsString> =
                words.split_whitespace().map(|word| word.replace('_', " ").into()).collect();
            let first = shot(&line);
            let second = shot(&first.to_line().unwrap());
            assert_eq!(format!("{first:?}"), format!("{second:?}"));
            assert_ne!(format!("{first:?}"), format!("{:?}", shot(&line[..3])));
        }
    }

    #[test]
    fn what_follows_two_dashes_is_for_sbatch() {
        let line = ["karst", "slurm", "up", "--workers", "3", "--", "-p", "long", "--time=1:00"];
        let Command::Slurm(SlurmCommand::Up(args)) = Cli::try_parse_from(line).unwrap().command else {
            panic!("expected `slurm up`");
        };
        assert_eq!(args.sbatch.options, ["-p", "long", "--time=1:00"]);
    }
}
