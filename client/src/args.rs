//! The command line: sub-commands, flags, and the little languages of their values.

mod slurm;
mod values;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use karst_client::{Client, DEFAULT_SERVER, Error};
use karst_core::film::Region;
use karst_core::scene::{ErrorOf, Overrides};
use karst_proto::connect::{Bearer, bearer};
use karst_proto::v1::PreviewLayer;

pub(crate) use slurm::{
    FramesArgs, MissingArgs, PilotsArgs, PreflightArgs, ShotArgs, SlurmCommand, TaskArgs, UpArgs,
};
pub(crate) use values::FrameList;
use values::{address, crop, frames, positive, size, stops, tile_size};

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  failure: a file, the server, the render
  2  usage or bad input: a flag, the scene document

Results go to stdout (with --json one JSON object per line), everything else to stderr.";

/// Renders procedural worlds: on this machine, or through a karst server.
#[derive(Debug, Parser)]
#[command(name = "karst", version, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    /// Print results as one JSON object per line.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene on this machine, without a server.
    Render(RenderArgs),
    /// Check a scene document and its files; print what is wrong, or what it holds.
    Check(CheckArgs),
    /// Make a karst document of a scene of another renderer.
    Convert(ConvertArgs),
    /// Compare two EXR pictures.
    Compare(CompareArgs),
    /// Submit a scene to a server.
    Submit(SubmitArgs),
    /// Watch a job until it is finished.
    Watch(WatchArgs),
    /// Show a frame in the tev image viewer while it improves.
    View(ViewArgs),
    /// Print the address of the server's live page, with the token that opens it.
    Page(ServerArgs),
    /// Download the finished frames of a job.
    Fetch(FetchArgs),
    /// List jobs, the newest first.
    Jobs(JobsArgs),
    /// Stop a job; what is finished stays.
    Cancel(CancelArgs),
    /// Render on a Slurm cluster: arrays of frames, or workers of a server.
    #[command(subcommand)]
    Slurm(SlurmCommand),
}

/// Which server.
#[derive(Clone, Debug, Args)]
pub(crate) struct ServerArgs {
    /// Address of the server.
    #[arg(long, env = "KARST_SERVER", value_name = "URL", default_value = DEFAULT_SERVER)]
    pub(crate) server: String,
    /// File with the token for it; on the machine and account of the server it is found by itself.
    #[arg(long, env = "KARST_TOKEN_FILE", value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
    /// File with the certificate that an https server must show, or of whoever has signed it; without one it must
    /// be one that this machine trusts.
    #[arg(long, env = "KARST_CA_FILE", value_name = "FILE")]
    pub(crate) ca_file: Option<PathBuf>,
}

impl ServerArgs {
    /// A connection with the token that belongs to it.
    ///
    /// # Errors
    /// The token file cannot be read, or nobody answers.
    pub(crate) async fn connect(&self) -> Result<Client, Error> {
        Client::connect(&self.server, self.ca_file.as_deref(), self.bearer()?).await
    }

    /// The token that belongs to it.
    ///
    /// # Errors
    /// The token file cannot be read.
    pub(crate) fn bearer(&self) -> Result<Bearer, Error> {
        let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/state"));
        let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(home);
        let bearer = bearer(&self.server, self.token_file.as_deref(), state.as_deref());
        bearer.map_err(|e| Error::Usage(e.to_string()))
    }
}

/// What changes the scene's own settings.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Settings (instead of those in the scene)")]
pub(crate) struct SettingsArgs {
    /// Samples per pixel.
    #[arg(long, value_name = "N", conflicts_with_all = ["target_error", "min_spp", "max_spp"],
          value_parser = clap::value_parser!(u32).range(1..=1 << 31))]
    pub(crate) spp: Option<u32>,
    /// Sample adaptively until the estimated relative error of the frame (root of relMSE) is at most this.
    #[arg(long, value_name = "E", value_parser = positive)]
    pub(crate) target_error: Option<f64>,
    /// With a target error: which picture has to reach it; `denoised` needs --denoise.
    #[arg(long, value_name = "WHICH")]
    pub(crate) error_of: Option<ErrorOfArg>,
    /// With a target error: no pixel gets fewer samples.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 31))]
    pub(crate) min_spp: Option<u32>,
    /// With a target error: no pixel gets more samples.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 31))]
    pub(crate) max_spp: Option<u32>,
    /// Begin no further round after this many seconds of rendering per frame.
    #[arg(long, value_name = "S", value_parser = positive)]
    pub(crate) time_limit: Option<f64>,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u32>,
    /// Size of the frame in pixels.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Render only this rectangle of the frame: left, top, width, height in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = crop)]
    pub(crate) crop: Option<Region>,
}

impl SettingsArgs {
    /// The same as the core wants it.
    pub(crate) fn overrides(&self) -> Overrides {
        Overrides {
            spp: self.spp,
            target_error: self.target_error,
            error_of: self.error_of.map(Into::into),
            min_spp: self.min_spp,
            max_spp: self.max_spp,
            time_limit: self.time_limit,
            seed: self.seed,
            size: self.size,
            crop: self.crop,
        }
    }
}

/// What is done besides the samples.
#[derive(Clone, Debug, Args)]
pub(crate) struct WorkArgs {
    /// Edge of a tile in pixels, a multiple of 16 from 16 to 256; never changes a pixel. 32 unless given, with a
    /// server its own choice.
    #[arg(long, value_name = "N", value_parser = tile_size)]
    pub(crate) tile_size: Option<u32>,
    /// Denoise with Open Image Denoise: from the colours alone, or with albedo and normals.
    #[arg(long, value_name = "MODE", value_enum, default_value = "off")]
    pub(crate) denoise: DenoiseArg,
}

/// `--denoise`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DenoiseArg {
    /// Keep the noisy picture only.
    Off,
    /// From the colours alone.
    Color,
    /// With albedo and normals.
    Full,
}

/// Which picture a target error is meant for.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ErrorOfArg {
    /// The picture as it is rendered.
    Noisy,
    /// The denoised picture, judged by the upper end of the interval that its denoised replicates tell after each round.
    Denoised,
}

impl From<ErrorOfArg> for ErrorOf {
    fn from(of: ErrorOfArg) -> Self {
        match of {
            ErrorOfArg::Noisy => Self::Noisy,
            ErrorOfArg::Denoised => Self::Denoised,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// Scene: a karst document, or what `karst convert` reads.
    pub(crate) scene: PathBuf,
    /// Where to write the picture: OUT.exr or OUT.png; give it twice for both. With --denoise the EXR gets a
    /// layer `Denoised`, and beside OUT.png comes OUT-denoised.png. With --frames the frame number goes before
    /// the ending: OUT.0001.exr.
    #[arg(short, long = "output", value_name = "OUT", required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Frame of the animation; the first one unless given.
    #[arg(long, value_name = "F", allow_hyphen_values = true, conflicts_with = "frames")]
    pub(crate) frame: Option<i32>,
    /// Frames of the animation, such as 1-250 or 1-250:2 for every second one.
    #[arg(long, value_name = "A-B:STEP", allow_hyphen_values = true, value_parser = frames)]
    pub(crate) frames: Option<FrameList>,
    /// Threads that render; as many as the machine has unless given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
    /// Write figures of the run: times, samples, rays, error (with --denoise of the denoised picture too), memory; as
    /// R.json, or as a page with pictures, maps and the error over time as R.html; give it twice for both.
    #[arg(long, value_name = "R")]
    pub(crate) report: Vec<PathBuf>,
    /// Print how long each stage of rendering took.
    #[arg(long)]
    pub(crate) profile: bool,
    #[command(flatten)]
    pub(crate) settings: SettingsArgs,
    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Scene: a karst document, or what `karst convert` reads.
    pub(crate) scene: PathBuf,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Reads Mitsuba scenes (.xml, versions 3 and 0.6) and glTF 2.0 (.gltf, .glb).

What the document cannot say is listed on stderr with file and line: `not translated` for what the picture lacks,
`differs` for what looks somewhat different.

Files that the document names stay where they are if they lie in its folder or below; others are copied to meshes/ and
textures/ there, and so are meshes that are made for shapes such as cubes. A file that is there with other contents is
not overwritten: the command ends before it writes anything, unless --force is given. The document is written last, and
nobody sees a part of a file under its name.")]
pub(crate) struct ConvertArgs {
    /// Scene of another renderer.
    pub(crate) input: PathBuf,
    /// Where to write the document; its folder is made.
    #[arg(short, long = "output", value_name = "SCENE.json")]
    pub(crate) output: PathBuf,
    /// Fail, and write nothing, if anything is not translated.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Overwrite files that are there with other contents.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Prints, with --json under these names:
  identical             whether all bits of R, G and B are the same
  mse                   mean((a-b)²)
  rel_mse               mean((a-b)²/(b²+0.01))
  rel_mse_corrected     rel_mse without the part of the reference, with --reference-error
  rel_mse_expected      what noise alone would make of it: that of A, from --repeat or as A's own estimate from the file,
                        and that of the reference, from --reference-error or the file; null where one of them is unknown
  rel_mse_ratio         rel_mse / rel_mse_expected; well above 1 where the pictures differ in more than noise
  mean_rel_diff         mean(a)/mean(b) - 1
  mean_rel_diff_stderr  its standard error, from the spread of the pixels' differences: the noise of both pictures is in
                        it, so it needs no --reference-error
  mean_rel_diff_sigmas  mean_rel_diff / mean_rel_diff_stderr
  flip_mean             FLIP (Andersson et al. 2020) of the standard view, 0 to 1: how different the pictures look
  worst_tiles           the five tiles of 16x16 pixels with the largest rel_mse, and where they are from the upper left
  nonfinite_pixels      pixels left out of the sums: infinite or not a number in one of the pictures
  width, height, and sha256_a and sha256_b of the R, G, B floats
What is not known is null. Exit code 0 when the pictures could be compared, equal or not.")]
pub(crate) struct CompareArgs {
    /// The picture in question.
    pub(crate) a: PathBuf,
    /// The reference.
    pub(crate) b: PathBuf,
    /// Error of the reference itself, the root of its relMSE: its square is taken off the relMSE.
    #[arg(long, value_name = "E", value_parser = positive)]
    pub(crate) reference_error: Option<f64>,
    /// A rendered once more with another seed: what both differ by is the noise of A, weighed like the relMSE. The
    /// estimate in the file is relative to what is around each pixel of A.
    #[arg(long, value_name = "A2.exr")]
    pub(crate) repeat: Option<PathBuf>,
    /// Layer to compare, as in `Denoised`: the beauty unless given.
    #[arg(long, value_name = "NAME")]
    pub(crate) layer: Option<String>,
    /// Layer of the reference, where it is another one: `beauty` or a name.
    #[arg(long, value_name = "NAME")]
    pub(crate) reference_layer: Option<String>,
    /// Judge both pictures 2^STOPS times as bright, as the film's `exposure` does.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true, value_parser = stops)]
    pub(crate) exposure: f32,
    /// Write a picture of the relative difference: red where A is brighter, blue where it is darker, black where both
    /// are the same, full colour from 100 % on.
    #[arg(long, value_name = "D.png")]
    pub(crate) diff: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct SubmitArgs {
    /// Scene: a karst document, or what `karst convert` reads.
    pub(crate) scene: PathBuf,
    /// Wait until the job is finished, with a progress bar.
    #[arg(long)]
    pub(crate) wait: bool,
    /// Wait, and download the finished frames into this folder.
    #[arg(short, long = "output", value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// While waiting receive the tiles as they improve, and say when the first one came.
    #[arg(long)]
    pub(crate) tiles: bool,
    /// Only check: nothing is queued.
    #[arg(long, conflicts_with_all = ["wait", "output", "tiles"])]
    pub(crate) validate_only: bool,
    /// Name of the job and of the downloaded files; the scene's file name unless given.
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Makes repeating this command safe: the same id and scene give the same job.
    #[arg(long, value_name = "ID")]
    pub(crate) request_id: Option<String>,
    /// Frame of the animation.
    #[arg(long, value_name = "F", allow_hyphen_values = true, conflicts_with = "frames")]
    pub(crate) frame: Option<i32>,
    /// Frames of the animation, such as 1-250 or 1-250:2; all unless given.
    #[arg(long, value_name = "A-B:STEP", allow_hyphen_values = true, value_parser = frames)]
    pub(crate) frames: Option<FrameList>,
    #[command(flatten)]
    pub(crate) server: ServerArgs,
    #[command(flatten)]
    pub(crate) settings: SettingsArgs,
    #[command(flatten)]
    pub(crate) work: WorkArgs,
}

#[derive(Debug, Args)]
pub(crate) struct WatchArgs {
    /// The job's id.
    pub(crate) job: String,
    /// Go on after the event that carried this token (`resume_token` in the output of --json).
    #[arg(long, value_name = "TOKEN")]
    pub(crate) resume: Option<String>,
    #[command(flatten)]
    pub(crate) server: ServerArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The picture is called `NAME frame F` in tev and has the size of the full frame, black where nothing is rendered.
Its channels have the names that they have in the EXR; when the frame is finished, they have its exact values, and
the command ends. It also ends when tev does.")]
pub(crate) struct ViewArgs {
    /// The job's id.
    pub(crate) job: String,
    /// Where tev listens: 127.0.0.1:14158 unless it was started with --hostname.
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    pub(crate) tev: String,
    /// Frame of the job; unless given the one that is being rendered, else the next one, else the first one.
    #[arg(long, value_name = "F", allow_hyphen_values = true)]
    pub(crate) frame: Option<i32>,
    /// Go on with the frames after it, each as a picture of its own.
    #[arg(long)]
    pub(crate) follow: bool,
    /// Layer to show; may be given more than once. Color, albedo and normal improve tile by tile, the others come
    /// with the finished frame.
    #[arg(long, value_name = "NAME", value_enum, ignore_case = true, default_value = "color")]
    pub(crate) layer: Vec<LayerArg>,
    #[command(flatten)]
    pub(crate) server: ServerArgs,
}

/// `karst view --layer`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum LayerArg {
    /// The noisy picture.
    Color,
    /// The colour of the first surface.
    Albedo,
    /// The normal of the first surface.
    Normal,
    /// The distance to the first surface.
    Depth,
    /// Samples per pixel.
    Samples,
    /// The estimated error.
    Error,
    /// Evaluations of distance functions per sample, of a scene that has them.
    Evaluations,
    /// The denoised picture, of a job that denoises.
    Denoised,
}

impl LayerArg {
    /// Its channels in the EXR of a frame.
    pub(crate) fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Color => &["R", "G", "B"],
            Self::Albedo => &["Albedo.R", "Albedo.G", "Albedo.B"],
            Self::Normal => &["Normal.X", "Normal.Y", "Normal.Z"],
            Self::Depth => &["Depth.Z"],
            Self::Samples => &["Samples.X"],
            Self::Error => &["Error.X"],
            Self::Evaluations => &["Evaluations.X"],
            Self::Denoised => &["Denoised.R", "Denoised.G", "Denoised.B"],
        }
    }

    /// The same as a preview, if there is one.
    pub(crate) fn preview(self) -> Option<PreviewLayer> {
        match self {
            Self::Color => Some(PreviewLayer::Color),
            Self::Albedo => Some(PreviewLayer::Albedo),
            Self::Normal => Some(PreviewLayer::Normal),
            Self::Depth | Self::Samples | Self::Error | Self::Evaluations | Self::Denoised => None,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct FetchArgs {
    /// The job's id.
    pub(crate) job: String,
    /// Folder for the files.
    #[arg(short, long = "output", value_name = "DIR", default_value = ".")]
    pub(crate) output: PathBuf,
    /// Only these frames.
    #[arg(long, value_name = "A-B:STEP", allow_hyphen_values = true, value_parser = frames)]
    pub(crate) frames: Option<FrameList>,
    /// Only these files; all that a frame has unless given.
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) format: Vec<FormatArg>,
    #[command(flatten)]
    pub(crate) server: ServerArgs,
}

/// `--format`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArg {
    /// All layers as floats.
    Exr,
    /// The noisy picture in 8 bits.
    Png,
    /// The denoised picture in 8 bits.
    PngDenoised,
}

#[derive(Debug, Args)]
pub(crate) struct JobsArgs {
    /// At most this many.
    #[arg(long, value_name = "N", default_value_t = 50)]
    pub(crate) limit: usize,
    /// Only jobs in this state; may be given more than once.
    #[arg(long, value_name = "STATE", value_enum)]
    pub(crate) state: Vec<StateArg>,
    #[command(flatten)]
    pub(crate) server: ServerArgs,
}

/// `--state`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StateArg {
    /// Waiting for a worker.
    Queued,
    /// Being rendered.
    Running,
    /// All frames are finished.
    Succeeded,
    /// Stopped by an error.
    Failed,
    /// Stopped by `karst cancel`.
    Cancelled,
}

#[derive(Debug, Args)]
pub(crate) struct CancelArgs {
    /// The job's id.
    pub(crate) job: String,
    #[command(flatten)]
    pub(crate) server: ServerArgs,
}

#[cfg(test)]
mod tests {
    use super::Cli;
    use clap::{CommandFactory, Parser};

    fn refused(line: &[&str]) -> String {
        Cli::try_parse_from([&["karst"], line].concat()).expect_err("must be refused").to_string()
    }

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn fixed_and_adaptive_sampling_exclude_each_other() {
        for adaptive in [["--target-error", "0.1"], ["--min-spp", "8"], ["--max-spp", "8"]] {
            let text = refused(&["render", "s.json", "-o", "a.exr", "--spp", "4", adaptive[0], adaptive[1]]);
            assert!(text.contains("cannot be used with"), "{text}");
        }
    }

    #[test]
    fn senseless_values_are_refused_with_what_is_allowed() {
        for (flag, value, allowed) in [
            ("--spp", "0", "1..="),
            ("--target-error", "nan", "above 0"),
            ("--target-error", "0", "above 0"),
            ("--time-limit", "inf", "above 0"),
            ("--size", "0x10", "WIDTHxHEIGHT"),
            ("--crop", "0,0,0,5", "X,Y,WIDTH,HEIGHT"),
            ("--tile-size", "20", "multiple of 16"),
            ("--threads", "0", "1..="),
            ("--frames", "9-1", "first to last"),
        ] {
            let text = refused(&["render", "s.json", "-o", "a.exr", flag, value]);
            assert!(text.contains(allowed), "{flag} {value}: {text}");
        }
    }
}
