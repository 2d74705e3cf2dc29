//! Owns what happens to a frame after its last round: picture, denoising, files. Blocks; runs beside the rendering
//! of the next frame.

use std::sync::Arc;

use karst_core::encode;
use karst_core::film::CrossError;

use crate::blobs::{Blobs, Kind};
use crate::error::Error;
use crate::farm::denoised::{Replicates, denoised_picture};
use crate::farm::live::LiveFrame;
use crate::model::{Cause, DenoisedError, Failure, Finished, Format, FrameFile};
use crate::spec::Denoise;

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
    let encoded = tokio::task::spawn_blocking(move || encode_all(&frame, denoise)).await??;
    let mut files = Vec::with_capacity(encoded.files.len());
    for (format, bytes) in encoded.files {
        let size = bytes.len() as u64;
        files.push(FrameFile { format, size, digest: blobs.put(Kind::Frame, bytes).await? });
    }
    Ok(Finished { files, denoised: encoded.denoised, failure: encoded.failure })
}

struct Encoded {
    files: Vec<(Format, Vec<u8>)>,
    denoised: Option<DenoisedError>,
    failure: Option<Failure>,
}

fn encode_all(frame: &LiveFrame, denoise: Denoise) -> Result<Encoded, Error> {
    let scene = &frame.scene;
    let (picture, replicates, summary, objects) = {
        let film = &frame.merged().film;
        let replicates = if denoise == Denoise::Off { None } else { Replicates::of(film, scene) };
        let objects = encode::object_statistics(scene.function_names(), film.objects());
        (film.picture(), replicates, film.summary(), objects)
    };
    let (smooth, failure) = match denoised_picture(&picture, denoise) {
        Ok(smooth) => (smooth, None),
        Err(e) => {
            tracing::warn!(job = %frame.job, frame = frame.frame, "not denoised: {e}");
            (None, Some(Failure::new(Cause::Denoiser, format!("not denoised: {e}"))))
        }
    };
    let judged = replicates.filter(|_| smooth.is_some()).map(|it| it.error(&picture, denoise));
    let error = judged.transpose().unwrap_or_else(|e| {
        tracing::warn!(job = %frame.job, frame = frame.frame, "denoised, but with an unknown error: {e}");
        None
    });
    let error = error.flatten().map(CrossError::at_least_zero);
    let statistics =
        encode::statistics(frame.frame, scene.sampling().seed, &summary, error.as_ref(), &objects);
    let (width, height) = (picture.window.width(), picture.window.height());
    let internal = |e: encode::EncodeError| Error::Internal(e.to_string());
    let png = |color| encode::png(color, width, height, scene.exposure(), scene.view()).map_err(internal);
    let exr = encode::exr(&picture, smooth.as_deref(), &statistics).map_err(internal)?;
    let mut files = vec![(Format::Exr, exr), (Format::Png, png(&picture.color)?)];
    if let Some(smooth) = &smooth {
        files.push((Format::PngDenoised, png(smooth)?));
    }
    let denoised = error.map(|error| DenoisedError { rel_mse: error.rel_mse, ci95: error.ci95 });
    Ok(Encoded { files, denoised, failure })
}
