//! `karst-oidn`: reads one picture from standard input, denoises it, writes it to standard output, ends.
//!
//! Started by the library `karst_denoise`; [`karst_denoise::wire`] has the format.

mod filter;

use std::io::{self, BufReader, Read};
use std::process::ExitCode;

use karst_denoise::wire::{Header, Mode, WireError, read_plane, write_answer};

use filter::{Device, Images};

fn main() -> ExitCode {
    let result = answer(&mut BufReader::new(io::stdin().lock()));
    let failed = result.is_err();
    let written = write_answer(&mut io::stdout().lock(), result.as_deref().map_err(String::as_str));
    // Who waits for the answer may be gone; then nobody is left to be told.
    ExitCode::from(u8::from(failed || written.is_err()))
}

/// Reads the request and denoises it; the error is a text for the other end.
fn answer(from: &mut impl Read) -> Result<Vec<[f32; 3]>, String> {
    let text = |error: WireError| error.to_string();
    let header = Header::read(from).map_err(text)?;
    let mut plane = || read_plane(from, header.pixels()).map_err(|error| text(error.into()));
    let color = plane()?;
    let features = match header.mode {
        Mode::Color => None,
        Mode::Full => Some((plane()?, plane()?)),
    };

    let device = Device::new(header.threads)?;
    let size = (header.width as usize, header.height as usize);
    let Some((albedo, normal)) = features else {
        return device.run(size, &Images { color: Some(&color), ..Images::default() });
    };
    // Features are denoised first, so that their own noise does not come through in the picture.
    let albedo = device.run(size, &Images { albedo: Some(&albedo), ..Images::default() })?;
    let normal = device.run(size, &Images { normal: Some(&normal), ..Images::default() })?;
    device.run(size, &Images { color: Some(&color), albedo: Some(&albedo), normal: Some(&normal) })
}
