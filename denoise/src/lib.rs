//! Denoising with Open Image Denoise, in a program of its own.
//!
//! The OIDN libraries are linked by `karst-oidn` only. Were they linked here, a machine without them could not start
//! `karst` at all: the loader fails before any message of ours. So [`denoise`] starts `karst-oidn`, found beside the
//! running program, sends it the picture through a pipe, and turns whatever goes wrong into a [`DenoiseError`].
//!
//! ```no_run
//! use karst_denoise::{Input, Mode, denoise};
//!
//! let color = vec![[0.5; 3]; 64 * 32];
//! let input = Input { width: 64, height: 32, color: &color, albedo: &[], normal: &[] };
//! let smooth = denoise(&input, Mode::Color)?;
//! assert_eq!(smooth.len(), 64 * 32);
//! # Ok::<(), karst_denoise::DenoiseError>(())
//! ```

mod program;
pub mod wire;

use std::path::{Path, PathBuf};
use std::process::ExitStatus;

pub use wire::Mode;

/// A picture to denoise: linear light and its features, row-major, one entry per pixel of whatever has three numbers.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a, T = [f32; 3]> {
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// Noisy radiance, any positive range.
    pub color: &'a [T],
    /// Noisy albedo, 0 to 1; not looked at in [`Mode::Color`].
    pub albedo: &'a [T],
    /// Noisy normals, -1 to 1; not looked at in [`Mode::Color`].
    pub normal: &'a [T],
}

/// What has three numbers.
pub trait Pixel: Copy + Sync + Into<[f32; 3]> + From<[f32; 3]> {}

impl<T: Copy + Sync + Into<[f32; 3]> + From<[f32; 3]>> Pixel for T {}

/// Why a picture was not denoised.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DenoiseError {
    /// This build has no denoiser.
    #[error(
        "denoising is not part of this build\nhint: build with the feature `oidn`, which is on by default"
    )]
    NotBuilt,
    /// `karst-oidn` is not where it should be.
    #[error(
        "karst-oidn: not found at {path}\nhint: it must lie beside the running program; \
         `cargo build --release` builds it"
    )]
    ProgramMissing {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The loader did not find a library that `karst-oidn` needs.
    #[error("karst-oidn: {message}\nhint: `./run setup` fetches the OIDN libraries")]
    LibraryMissing {
        /// What the loader said.
        message: String,
    },
    /// `karst-oidn` is from another build.
    #[error("karst-oidn: speaks version {found}, expected {expected}\nhint: build all programs together")]
    Version {
        /// Version of the program.
        found: u32,
        /// Version of this library.
        expected: u32,
    },
    /// OIDN refused the picture or ran out of something.
    #[error("karst-oidn: {0}")]
    Failed(String),
    /// `karst-oidn` ended without an answer.
    #[error("karst-oidn: ended without an answer ({status}){}", said(.stderr))]
    Crashed {
        /// How it ended.
        status: ExitStatus,
        /// The end of what it wrote to its standard error.
        stderr: String,
    },
    /// `karst-oidn` could not be started or talked to.
    #[error("karst-oidn: {0}")]
    Io(#[from] std::io::Error),
    /// The answer makes no sense.
    #[error("karst-oidn: {0}")]
    Answer(wire::WireError),
    /// The picture is empty, too large, or a plane has the wrong size.
    #[error("{0}")]
    Input(wire::WireError),
}

fn said(stderr: &str) -> String {
    if stderr.is_empty() { String::new() } else { format!(": {stderr}") }
}

/// Denoises with the `karst-oidn` that lies beside the running program. Blocks until the picture is there.
///
/// # Errors
/// See [`DenoiseError`]; the picture is checked before any program is started.
pub fn denoise<T: Pixel>(input: &Input<'_, T>, mode: Mode) -> Result<Vec<T>, DenoiseError> {
    Denoiser::find()?.denoise(input, mode)
}

/// A `karst-oidn` program and how to run it.
#[derive(Debug, Clone)]
pub struct Denoiser {
    program: PathBuf,
    threads: u32,
}

impl Denoiser {
    /// The program beside the running one (for test programs in `deps`: one folder up).
    ///
    /// # Errors
    /// [`DenoiseError::NotBuilt`] without the feature `oidn`, [`DenoiseError::ProgramMissing`] when it is not there.
    pub fn find() -> Result<Self, DenoiseError> {
        if !cfg!(feature = "oidn") {
            return Err(DenoiseError::NotBuilt);
        }
        let running = std::env::current_exe()?;
        let folder = running.parent().unwrap_or(Path::new("."));
        let folder = match folder.file_name() {
            Some(name) if name == "deps" => folder.parent().unwrap_or(folder),
            _ => folder,
        };
        let denoiser = Self::at(folder.join("karst-oidn"));
        if denoiser.program.is_file() {
            Ok(denoiser)
        } else {
            Err(DenoiseError::ProgramMissing { path: denoiser.program })
        }
    }

    /// The program at `path`, which is looked for only when it is used.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { program: path.into(), threads: 0 }
    }

    /// Uses at most this many threads; 0, the default, means one for each processor.
    #[must_use]
    pub fn with_threads(self, threads: u32) -> Self {
        Self { threads, ..self }
    }

    /// Denoises a picture. Blocks until it is there.
    ///
    /// # Errors
    /// See [`DenoiseError`].
    pub fn denoise<T: Pixel>(&self, input: &Input<'_, T>, mode: Mode) -> Result<Vec<T>, DenoiseError> {
        let header = wire::Header { mode, threads: self.threads, width: input.width, height: input.height };
        header.check().map_err(DenoiseError::Input)?;
        let planes = match mode {
            Mode::Color => [("color", input.color)].to_vec(),
            Mode::Full => {
                [("color", input.color), ("albedo", input.albedo), ("normal", input.normal)].to_vec()
            }
        };
        for (name, plane) in &planes {
            wire::check_plane(name, plane.len(), &header).map_err(DenoiseError::Input)?;
        }
        Ok(program::run(&self.program, &header, &planes)?.into_iter().map(T::from).collect())
    }
}
