//! `karst compare`: two EXR pictures in figures, and as a picture of their difference.

use std::path::Path;

use karst_client::{Blob, Error};
use karst_core::color::View;
use karst_core::encode::{ExrImage, png, read_exr};
use serde_json::{Value, json};

use crate::args::CompareArgs;
use crate::difference::{Difference, Pixels, difference, relative_difference};
use crate::talk::Talk;

pub(super) fn run(args: &CompareArgs, talk: Talk) -> Result<(), Error> {
    let (image_a, a) = read(&args.a, args.layer.as_deref())?;
    let reference_layer = args.reference_layer.as_ref().or(args.layer.as_ref());
    let (image_b, b) = read(&args.b, reference_layer.map(String::as_str))?;
    if (image_a.width, image_a.height) != (image_b.width, image_b.height) {
        return Err(Error::Usage(format!(
            "cannot compare: {} is {}x{}, {} is {}x{}",
            args.a.display(),
            image_a.width,
            image_a.height,
            args.b.display(),
            image_b.width,
            image_b.height
        )));
    }
    let found = difference(&a, &b);
    let corrected = args.reference_error.map(|error| (found.rel_mse - error * error).max(0.0));
    let figures = json!({
        "identical": found.identical,
        "mse": found.mse,
        "rel_mse": found.rel_mse,
        "rel_mse_corrected": corrected,
        "mean_rel_diff": found.mean_rel_diff,
        "mean_rel_diff_stderr": found.mean_rel_diff_stderr,
        "flip_mean": Value::Null,
        "nonfinite_pixels": found.nonfinite_pixels,
        "width": image_a.width,
        "height": image_a.height,
        "sha256_a": digest(&a),
        "sha256_b": digest(&b),
    });
    if let Some(path) = &args.diff {
        write_diff(path, &relative_difference(&a, &b), image_a.width, image_a.height)?;
    }
    talk.result(&describe(&found, corrected), &figures);
    Ok(())
}

/// The picture and the colours of one layer of it; the beauty has no name of its own in the file.
fn read(path: &Path, layer: Option<&str>) -> Result<(ExrImage, Pixels), Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::file(path, source))?;
    let image = read_exr(&bytes).map_err(|error| Error::Usage(format!("{}: {error}", path.display())))?;
    let prefix = layer.filter(|name| *name != "beauty").map(|name| format!("{name}.")).unwrap_or_default();
    let planes = [["R", "G", "B"], ["X", "Y", "Z"]].iter().find_map(|names| {
        let plane = |name: &str| image.channel(&format!("{prefix}{name}"));
        Some([plane(names[0])?, plane(names[1])?, plane(names[2])?])
    });
    let Some([r, g, b]) = planes else {
        let names: Vec<&str> = image.channels.iter().map(|(name, _)| name.as_str()).collect();
        return Err(Error::Usage(format!(
            "{}: found channels {}, expected {prefix}R, {prefix}G and {prefix}B",
            path.display(),
            names.join(" ")
        )));
    };
    let pixels = r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, *g, *b]).collect();
    Ok((image, pixels))
}

/// SHA-256 of the floats, little-endian, R G B of each pixel row by row.
fn digest(pixels: &[[f32; 3]]) -> String {
    let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    Blob::of_bytes(&bytes).digest().to_owned()
}

fn write_diff(path: &Path, pixels: &[[f32; 3]], width: u32, height: u32) -> Result<(), Error> {
    let color: Vec<_> = pixels.iter().map(|pixel| (*pixel).into()).collect();
    let bytes = png(&color, width, height, 0.0, View::Standard)
        .map_err(|error| Error::Failed(format!("{}: {error}", path.display())))?;
    std::fs::write(path, bytes).map_err(|source| Error::file(path, source))
}

fn describe(found: &Difference, corrected: Option<f64>) -> String {
    let number =
        |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |value| format!("{value:.6e}"));
    let mut lines = vec![
        format!("identical             {}", found.identical),
        format!("mse                   {:.6e}", found.mse),
        format!("rel_mse               {:.6e}", found.rel_mse),
    ];
    if corrected.is_some() {
        lines.push(format!("rel_mse_corrected     {}", number(corrected)));
    }
    lines.push(format!("mean_rel_diff         {}", number(found.mean_rel_diff)));
    lines.push(format!("mean_rel_diff_stderr  {}", number(found.mean_rel_diff_stderr)));
    if found.nonfinite_pixels > 0 {
        lines.push(format!("nonfinite_pixels      {}", found.nonfinite_pixels));
    }
    lines.join("\n")
}
