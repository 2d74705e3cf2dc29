//! Owns what happens to a frame after its last round: picture, denoising, files. Blocks; runs beside the rendering
//! of the next frame.

use std::sync::Arc;

use karst_core::encode;
use karst_core::film::Picture;
use karst_denoise::{Denoiser, Input, Mode};

use crate::blobs::{Blobs, Kind};
use crate::error::Error;
use crate::farm::live::LiveFrame;
use crate::model::{Cause, Failure, Format, FrameFile};
use crate::spec::Denoise;

/// A frame's files, and why the denoised ones are missing if they are.
pub(crate) type Finished = (Vec<FrameFile>, Option<Failure>);

/// Makes and stores the files of a frame.
///
/// A denoiser that fails leaves the noisy files and says why: hours of rendering are not thrown away for it.
///
/// # Errors
/// An encoder or the disk fails.
pub(crate) async fn finish(
    frame: Arc<LiveFrame>,
    denoise: Denoise,
    blobs: &Blobs,
) -> Result<Finished, Error> {
    let (encoded, failure) = tokio::task::spawn_blocking(move || encode_all(&frame, denoise)).await??;
    let mut files = Vec::with_capacity(encoded.len());
    for (format, bytes) in encoded {
        let size = bytes.len() as u64;
        files.push(FrameFile { format, size, digest: blobs.put(Kind::Frame, bytes).await? });
    }
    Ok((files, failure))
}

type Encoded = (Vec<(Format, Vec<u8>)>, Option<Failure>);

fn encode_all(frame: &LiveFrame, denoise: Denoise) -> Result<Encoded, Error> {
    let (picture, statistics) = {
        let merged = frame.merged();
        let objects = encode::object_statistics(frame.scene.function_names(), merged.film.objects());
        let seed = frame.scene.sampling().seed;
        (merged.film.picture(), encode::statistics(frame.frame, seed, &merged.film.summary(), &objects))
    };
    let (smooth, failure) = match denoise_picture(&picture, denoise) {
        Ok(smooth) => (smooth, None),
        Err(e) => {
            tracing::warn!(job = %frame.job, frame = frame.frame, "not denoised: {e}");
            (None, Some(Failure::new(Cause::Denoiser, format!("not denoised: {e}"))))
        }
    };
    let (width, height) = (picture.window.width(), picture.window.height());
    let scene = &frame.scene;
    let internal = |e: encode::EncodeError| Error::Internal(e.to_string());
    let png = |color| encode::png(color, width, height, scene.exposure(), scene.view()).map_err(internal);
    let exr = encode::exr(&picture, smooth.as_deref(), &statistics).map_err(internal)?;
    let mut files = vec![(Format::Exr, exr), (Format::Png, png(&picture.color)?)];
    if let Some(smooth) = &smooth {
        files.push((Format::PngDenoised, png(smooth)?));
    }
    Ok((files, failure))
}

fn denoise_picture(
    picture: &Picture,
    denoise: Denoise,
) -> Result<Option<Vec<glam::Vec3>>, karst_denoise::DenoiseError> {
    let mode = match denoise {
        Denoise::Off => return Ok(None),
        Denoise::Color => Mode::Color,
        Denoise::Full => Mode::Full,
    };
    let plane = |layer: &[glam::Vec3]| layer.iter().map(glam::Vec3::to_array).collect::<Vec<_>>();
    let (color, albedo, normal) = (plane(&picture.color), plane(&picture.albedo), plane(&picture.normal));
    let input = Input {
        width: picture.window.width(),
        height: picture.window.height(),
        color: &color,
        albedo: &albedo,
        normal: &normal,
    };
    let smooth = Denoiser::find()?.denoise(&input, mode)?;
    Ok(Some(smooth.into_iter().map(glam::Vec3::from_array).collect()))
}
