//! `karst compare`: two EXR pictures in figures, and as a picture of their difference.

use std::path::Path;

use karst_client::{Blob, Error};
use karst_core::encode::{ExrImage, png_rgb8, read_exr};
use karst_core::math::powf;
use serde_json::{Value, json};

use crate::args::CompareArgs;
use crate::difference::{Difference, Pixels, Tile, difference, flip_mean, noise, picture, worst_tiles};
use crate::talk::Talk;

pub(super) fn run(args: &CompareArgs, talk: Talk) -> Result<(), Error> {
    let (image_a, a) = read(&args.a, args.layer.as_deref())?;
    let reference_layer = args.reference_layer.as_ref().or(args.layer.as_ref());
    let (image_b, b) = read(&args.b, reference_layer.map(String::as_str))?;
    let (width, height) = (image_a.width, image_a.height);
    same_size(&args.a, &image_a, &args.b, &image_b)?;
    let (digest_a, digest_b) = (digest(&a), digest(&b));
    let (a, b) = (brighten(a, args.exposure), brighten(b, args.exposure));
    let found = difference(&a, &b);
    let own = match &args.repeat {
        Some(path) => {
            let (image, repeat) = read(path, args.layer.as_deref())?;
            same_size(&args.a, &image_a, path, &image)?;
            Some(noise(&a, &brighten(repeat, args.exposure), &b))
        }
        None => own_rel_mse(&image_a, args.layer.as_deref()),
    };
    let reference = args.reference_error.map(|error| error * error);
    let figures = Figures {
        corrected: reference.map(|reference| (found.rel_mse - reference).max(0.0)),
        expected: expected(
            own,
            reference.or_else(|| own_rel_mse(&image_b, reference_layer.map(String::as_str))),
        ),
        flip_mean: flip_mean(&a, &b, width, height),
        worst: worst_tiles(&a, &b, width as usize),
        found,
    };
    if let Some(path) = &args.diff {
        let bytes = png_rgb8(&picture(&a, &b), width, height)
            .map_err(|error| Error::Failed(format!("{}: {error}", path.display())))?;
        std::fs::write(path, bytes).map_err(|source| Error::file(path, source))?;
    }
    let mut object = figures.json();
    object["width"] = width.into();
    object["height"] = height.into();
    object["sha256_a"] = digest_a.into();
    object["sha256_b"] = digest_b.into();
    talk.result(&figures.table(), &object);
    Ok(())
}

/// # Errors
/// Pictures of different sizes cannot be compared.
fn same_size(path_a: &Path, a: &ExrImage, path_b: &Path, b: &ExrImage) -> Result<(), Error> {
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    let (path_a, path_b) = (path_a.display(), path_b.display());
    Err(Error::Usage(format!(
        "cannot compare: {path_a} is {}x{}, {path_b} is {}x{}",
        a.width, a.height, b.width, b.height
    )))
}

/// All that is known about two pictures.
struct Figures {
    found: Difference,
    /// relMSE without the part of the reference.
    corrected: Option<f64>,
    /// relMSE that the noise of both pictures alone makes.
    expected: Option<f64>,
    flip_mean: Option<f64>,
    worst: Vec<Tile>,
}

impl Figures {
    /// How much more than noise there is; unknown without noise.
    fn ratio(&self) -> Option<f64> {
        self.expected.filter(|expected| *expected > 0.0).map(|expected| self.found.rel_mse / expected)
    }

    /// The difference of the means in units of its standard error.
    fn sigmas(&self) -> Option<f64> {
        let stderr = self.found.mean_rel_diff_stderr.filter(|stderr| *stderr > 0.0)?;
        Some(self.found.mean_rel_diff? / stderr)
    }

    fn json(&self) -> Value {
        let tile = |tile: &Tile| {
            json!({
                "x": tile.x,
                "y": tile.y,
                "width": tile.width,
                "height": tile.height,
                "rel_mse": tile.rel_mse,
            })
        };
        json!({
            "identical": self.found.identical,
            "mse": self.found.mse,
            "rel_mse": self.found.rel_mse,
            "rel_mse_corrected": self.corrected,
            "rel_mse_expected": self.expected,
            "rel_mse_ratio": self.ratio(),
            "mean_rel_diff": self.found.mean_rel_diff,
            "mean_rel_diff_stderr": self.found.mean_rel_diff_stderr,
            "mean_rel_diff_sigmas": self.sigmas(),
            "flip_mean": self.flip_mean,
            "worst_tiles": self.worst.iter().map(tile).collect::<Vec<_>>(),
            "nonfinite_pixels": self.found.nonfinite_pixels,
        })
    }

    fn table(&self) -> String {
        let number = |name: &str, value: Option<f64>| {
            let value = value.map_or_else(|| "unknown".to_owned(), |value| format!("{value:.6e}"));
            format!("{name:<22}{value}")
        };
        let mut lines = vec![
            format!("{:<22}{}", "identical", self.found.identical),
            number("mse", Some(self.found.mse)),
            number("rel_mse", Some(self.found.rel_mse)),
        ];
        if self.corrected.is_some() {
            lines.push(number("rel_mse_corrected", self.corrected));
        }
        if self.expected.is_some() {
            lines.push(number("rel_mse_expected", self.expected));
            lines.push(number("rel_mse_ratio", self.ratio()));
        }
        lines.push(number("mean_rel_diff", self.found.mean_rel_diff));
        lines.push(number("mean_rel_diff_stderr", self.found.mean_rel_diff_stderr));
        lines.push(number("mean_rel_diff_sigmas", self.sigmas()));
        lines.push(number("flip_mean", self.flip_mean));
        for Tile { x, y, width, height, rel_mse } in &self.worst {
            lines.push(format!("{:<22}{rel_mse:.6e}  {width}x{height} at {x},{y}", "worst tile"));
        }
        if self.found.nonfinite_pixels > 0 {
            lines.push(format!("{:<22}{}", "nonfinite_pixels", self.found.nonfinite_pixels));
        }
        lines.join("\n")
    }
}

/// The sum of what both pictures are off by themselves, if both are known.
fn expected(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    Some(a? + b?)
}

/// relMSE that karst estimated when it made the picture; known of the beauty only.
fn own_rel_mse(image: &ExrImage, layer: Option<&str>) -> Option<f64> {
    let beauty = layer.is_none_or(|name| name == "beauty");
    image.statistics.as_ref().filter(|_| beauty)?.get("rel_mse")?.as_f64()
}

/// The picture 2^`stops` times as bright.
fn brighten(mut pixels: Pixels, stops: f32) -> Pixels {
    let gain = powf(2.0, stops);
    if gain != 1.0 {
        pixels.as_flattened_mut().iter_mut().for_each(|value| *value *= gain);
    }
    pixels
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
