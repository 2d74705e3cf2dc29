//! Tests of images: what files hold, and files that do not hold what they say.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrFile, Layer,
    LayerAttributes, LineOrder, WritableImage as _,
};
use glam::Vec3;
use half::f16;
use image::codecs::hdr::HdrEncoder;
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, Rgba};

use super::{Data, Image, ImageError};
use crate::texture::ColorSpace::{Linear, Srgb};

const LEFT: u64 = 1 << 20;

fn encode(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
    encode(image, ImageFormat::Png)
}

/// One part of an EXR file of named channels.
fn layer(
    size: (usize, usize),
    channels: &[(&str, FlatSamples)],
    encoding: Encoding,
) -> Layer<AnyChannels<FlatSamples>> {
    let list = channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone())).collect();
    Layer::new(size, LayerAttributes::named("part"), encoding, AnyChannels::sort(list))
}

fn exr(size: (usize, usize), channels: &[(&str, FlatSamples)], encoding: Encoding) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    ExrFile::from_layer(layer(size, channels, encoding)).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn floats(values: &[f32]) -> FlatSamples {
    FlatSamples::F32(values.to_vec())
}

fn halves(values: &[f32]) -> FlatSamples {
    FlatSamples::F16(values.iter().map(|&value| f16::from_f32(value)).collect())
}

fn plain(compression: Compression) -> Encoding {
    Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing }
}

/// 3 by 2 texels; the values of a channel are those of `values` from `first` on.
fn colors(kind: fn(&[f32]) -> FlatSamples) -> Vec<u8> {
    let channels: Vec<_> = ["R", "G", "B"].into_iter().zip(VALUES.chunks(6).map(kind)).collect();
    exr((3, 2), &channels, plain(Compression::ZIP1))
}

/// Exact in halves too; more than 1, and less than 0.
const VALUES: [f32; 18] = [
    0.0, 1.0, 1.5, 1000.0, 65504.0, -2.0, 0.25, 0.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0,
    1.0e-3_f32,
];

#[test]
fn channels_and_depths_are_those_of_the_file() {
    let (rgb, rgba) = (vec![255, 0, 51, 102, 0, 255], vec![255, 0, 51, 102, 0, 255, 255, 204]);
    let wide = |values: &[u16]| values.iter().map(|value| value * 257).collect::<Vec<u16>>();
    let deep_rgb = wide(&[255, 0, 51, 102, 0, 255]);
    let deep_rgba = wide(&[255, 0, 51, 102, 0, 255, 255, 204]);
    let files: [(Vec<u8>, u8); 8] = [
        (png(ImageBuffer::<Luma<u8>, _>::from_vec(2, 1, vec![255, 0]).unwrap()), 1),
        (png(ImageBuffer::<LumaA<u8>, _>::from_vec(2, 1, vec![255, 102, 0, 204]).unwrap()), 2),
        (png(ImageBuffer::<Rgb<u8>, _>::from_vec(2, 1, rgb).unwrap()), 3),
        (png(ImageBuffer::<Rgba<u8>, _>::from_vec(2, 1, rgba).unwrap()), 4),
        (png(ImageBuffer::<Luma<u16>, _>::from_vec(2, 1, vec![65535, 0]).unwrap()), 1),
        (png(ImageBuffer::<LumaA<u16>, _>::from_vec(2, 1, wide(&[255, 102, 0, 204])).unwrap()), 2),
        (png(ImageBuffer::<Rgb<u16>, _>::from_vec(2, 1, deep_rgb).unwrap()), 3),
        (png(ImageBuffer::<Rgba<u16>, _>::from_vec(2, 1, deep_rgba).unwrap()), 4),
    ];
    for (number, (bytes, channels)) in files.into_iter().enumerate() {
        let image = Image::read(&bytes, 2).unwrap();
        assert_eq!((image.width(), image.height(), image.channels), (2, 1, channels), "file {number}");
        assert!(!image.is_float());
        assert_eq!(matches!(image.data, Data::Words(_)), number >= 4);
        let expected = if channels < 3 { Vec3::ONE } else { Vec3::new(1.0, 0.0, 0.2) };
        assert_eq!(image.texel(0, 0, Linear), expected, "file {number}");
        let alpha = if channels % 2 == 0 { [0.4, 0.8] } else { [1.0; 2] };
        assert_eq!([image.alpha(0, 0), image.alpha(1, 0)], alpha, "file {number}");
    }
}

#[test]
fn jpeg_files_are_read() {
    let flat = ImageBuffer::<Rgb<u8>, _>::from_pixel(16, 8, Rgb([200, 100, 50]));
    let image = Image::read(&encode(flat, ImageFormat::Jpeg), LEFT).unwrap();
    assert_eq!((image.width(), image.height(), image.channels), (16, 8, 3));
    let off = image.texel(9, 5, Linear) - Vec3::new(200.0, 100.0, 50.0) / 255.0;
    assert!(off.abs().max_element() < 3.0 / 255.0, "{off}");
    let grey = ImageBuffer::<Luma<u8>, _>::from_pixel(8, 8, Luma([100]));
    assert_eq!(Image::read(&encode(grey, ImageFormat::Jpeg), LEFT).unwrap().channels, 1);
}

#[test]
fn baseline_jpeg_files_with_a_scan_for_each_colour_are_refused() {
    let flat = ImageBuffer::<Rgb<u8>, _>::from_pixel(16, 8, Rgb([200, 100, 50]));
    let mut bytes = encode(flat, ImageFormat::Jpeg);
    let place = |bytes: &[u8], marker: u8| bytes.windows(2).position(|pair| pair == [0xff, marker]).unwrap();
    let scan = place(&bytes, 0xda);
    assert_eq!(bytes[scan + 4], 3, "all colours in one scan");
    bytes[scan + 4] = 1;
    let error = Image::read(&bytes, LEFT).unwrap_err();
    assert!(matches!(error, ImageError::SeparateScans), "{error}");
    // Scans of progressive files have one colour as a rule.
    let frame = place(&bytes, 0xc0);
    bytes[frame + 1] = 0xc2;
    assert!(!matches!(Image::read(&bytes, LEFT), Err(ImageError::SeparateScans)));
}

#[test]
fn the_srgb_curve_is_the_standards() {
    let near =
        |found: Vec3, expected: f32| assert!((found - expected).abs().max_element() < 1.0e-6, "{found}");
    let grey =
        Image::read(&png(ImageBuffer::<Luma<u8>, _>::from_vec(2, 1, vec![188, 10]).unwrap()), 2).unwrap();
    // ((188/255 + 0.055) / 1.055)^2.4, and 10/255/12.92 on the straight part.
    near(grey.texel(0, 0, Srgb), 0.502_886_5);
    near(grey.texel(1, 0, Srgb), 0.003_035_27);
    near(grey.texel(0, 0, Linear), 188.0 / 255.0);
    let deep = png(ImageBuffer::<Luma<u16>, _>::from_vec(2, 1, vec![188 * 257, 1000]).unwrap());
    let deep = Image::read(&deep, 2).unwrap();
    near(deep.texel(0, 0, Srgb), 0.502_886_5);
    near(deep.texel(1, 0, Linear), 1000.0 / 65535.0);
    near(deep.texel(1, 0, Srgb), 1000.0 / 65535.0 / 12.92);
    // On floating-point values the curve goes on.
    let float =
        Image::read(&exr((2, 1), &[("Y", floats(&[2.0, -0.5]))], plain(Compression::RLE)), 2).unwrap();
    assert!((float.texel(0, 0, Srgb).x - 4.953_847).abs() < 1.0e-5, "{}", float.texel(0, 0, Srgb));
    near(float.texel(1, 0, Srgb), -0.5 / 12.92);
}

#[test]
fn exr_values_come_back_exactly_and_halves_stay_halves() {
    for (kind, half) in [(floats as fn(&[f32]) -> FlatSamples, false), (halves, true)] {
        let image = Image::read(&colors(kind), 6).unwrap();
        assert_eq!((image.width(), image.height(), image.channels, image.is_float()), (3, 2, 3, true));
        assert_eq!(matches!(image.data, Data::Halves(_)), half);
        for index in 0..6 {
            let (x, y) = (index % 3, index / 3);
            let expected = [0, 6, 12].map(|channel| VALUES[channel + index]);
            let expected = if half { expected.map(|value| f16::from_f32(value).to_f32()) } else { expected };
            assert_eq!(image.texel(x as u32, y as u32, Linear).to_array(), expected, "({x}, {y})");
        }
        assert_eq!(image.alpha(2, 1), 1.0);
    }
}

#[test]
fn exr_channels_are_found_by_name_and_the_others_left_alone() {
    let read = |channels: &[(&str, FlatSamples)]| {
        Image::read(&exr((2, 1), channels, plain(Compression::Uncompressed)), 2)
    };
    let [a, b, c, d] = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [0.25, 0.5]];
    let noise = ("Albedo.R", floats(&[f32::NAN, f32::NAN]));
    let image =
        read(&[("A", halves(&d)), ("B", floats(&c)), ("G", halves(&b)), noise, ("R", halves(&a))]).unwrap();
    assert_eq!(image.texel(1, 0, Linear), Vec3::new(2.0, 4.0, 6.0));
    assert_eq!((image.alpha(0, 0), image.alpha(1, 0), image.channels), (0.25, 0.5, 4));
    let image = read(&[("A", halves(&d)), ("Y", halves(&b))]).unwrap();
    assert_eq!((image.texel(1, 0, Linear), image.alpha(1, 0)), (Vec3::splat(4.0), 0.5));
    let image = read(&[("height", floats(&c))]).unwrap();
    assert_eq!((image.texel(0, 0, Linear), image.alpha(0, 0)), (Vec3::splat(5.0), 1.0));
    let image = read(&[("Y", FlatSamples::U32(vec![7, 8]))]).unwrap();
    assert_eq!(image.texel(1, 0, Linear), Vec3::splat(8.0));
    for names in [vec!["R", "G"], vec!["A"], vec!["X.R", "X.G", "X.B"]] {
        let channels: Vec<_> = names.iter().map(|name| (*name, floats(&a))).collect();
        let error = read(&channels).unwrap_err();
        assert!(matches!(error, ImageError::Channels { .. }), "{names:?}: {error}");
        assert!(error.to_string().contains(names[0]), "{error}");
    }
}

#[test]
fn the_first_part_of_an_exr_file_with_colours_is_taken() {
    let depth = [("u", floats(&[9.0; 4])), ("v", floats(&[9.0; 4]))];
    let white = ["R", "G", "B"].map(|name| (name, floats(&[1.0; 2])));
    let mut parts = [
        layer((2, 2), &depth, plain(Compression::ZIP1)),
        layer((2, 1), &[("Y", halves(&[0.5, 0.75]))], plain(Compression::ZIP1)),
        layer((2, 1), &white, plain(Compression::ZIP1)),
    ];
    for (part, name) in parts.iter_mut().zip(["depth", "grey", "white"]) {
        part.attributes.layer_name = Some(name.into());
    }
    let mut bytes = Cursor::new(Vec::new());
    let attributes = exr::prelude::ImageAttributes::with_size((2, 2));
    ExrFile::from_layers(attributes, parts.to_vec()).write().to_buffered(&mut bytes).unwrap();
    let image = Image::read(&bytes.into_inner(), LEFT).unwrap();
    assert_eq!((image.width(), image.height(), image.channels), (2, 1, 1));
    assert_eq!(image.texel(1, 0, Linear), Vec3::splat(0.75));
}

#[test]
fn exr_compressions_and_tiles_are_read() {
    let values: Vec<f32> = (0..70 * 40).map(|index| (index % 70 + index / 70) as f32 / 128.0).collect();
    let channels = [("R", halves(&values)), ("G", halves(&values)), ("B", halves(&values))];
    for compression in COMPRESSIONS {
        let tiles = Blocks::Tiles(exr::math::Vec2(32, 16));
        for blocks in [Blocks::ScanLines, tiles] {
            let order = LineOrder::Increasing;
            let bytes = exr((70, 40), &channels, Encoding { compression, blocks, line_order: order });
            let image = Image::read(&bytes, LEFT).unwrap();
            let off = (0..values.len())
                .map(|index| image.texel(index as u32 % 70, index as u32 / 70, Linear).x - values[index])
                .fold(0.0_f32, |most, off| most.max(off.abs()));
            let allowed = if compression == Compression::B44 { 0.02 } else { 0.0 };
            assert!(off <= allowed, "{compression:?}: off by {off}");
        }
    }
}

#[test]
fn a_compression_whose_values_depend_on_the_machine_is_refused() {
    for compression in [Compression::DWAA(None), Compression::DWAB(Some(45.0))] {
        let error =
            Image::read(&exr((2, 1), &[("Y", halves(&[0.5, 1.0]))], plain(compression)), LEFT).unwrap_err();
        assert!(error.to_string().contains("has dwa"), "{error}");
    }
}

const COMPRESSIONS: [Compression; 7] = [
    Compression::Uncompressed,
    Compression::RLE,
    Compression::ZIP1,
    Compression::ZIP16,
    Compression::PIZ,
    Compression::PXR24,
    Compression::B44,
];

#[test]
fn exr_texels_that_are_not_finite_are_named_and_refused() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for kind in [floats as fn(&[f32]) -> FlatSamples, halves] {
            let (good, mut green) = (kind(&[1.0; 6]), [1.0; 6]);
            green[5] = bad;
            let channels = [("R", good.clone()), ("G", kind(&green)), ("B", good)];
            let error = Image::read(&exr((2, 3), &channels, plain(Compression::ZIP1)), LEFT).unwrap_err();
            let text = error.to_string();
            assert!(
                text.contains("texel (1, 2)") && text.contains(&format!("{bad} in channel G")),
                "{bad}: {text}"
            );
        }
    }
}

#[test]
fn the_largest_floats_stay_finite_through_the_srgb_curve() {
    let channels = [("Y", floats(&[f32::MAX, 1e30]))];
    let exr = Image::read(&exr((2, 1), &channels, plain(Compression::ZIP1)), LEFT).unwrap();
    let hdr = Image::read(&hdr("#?RADIANCE", "-Y 1 +X 2", &[[255; 4]; 2]), LEFT).unwrap();
    for x in [0, 1] {
        assert_eq!(exr.texel(x, 0, Srgb), Vec3::MAX);
        assert_eq!(hdr.texel(x, 0, Srgb), Vec3::MAX);
    }
}

/// Bytes of a Radiance file; a pixel is (r, g, b, exponent), of value r / 256 · 2^(exponent − 128).
fn hdr(head: &str, size: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = format!("{head}\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
    bytes.extend(pixels.as_flattened());
    bytes
}

#[test]
fn radiance_values_are_those_of_the_format() {
    let pixels = [[128, 64, 32, 129], [255, 0, 1, 140], [10, 20, 30, 0], [128, 128, 128, 120]];
    for head in ["#?RADIANCE", "#?RGBE", "#?RADIANCE\n# a comment\nEXPOSURE=2.0"] {
        let image = Image::read(&hdr(head, "-Y 2 +X 2", &pixels), 4).unwrap();
        assert!(image.is_float());
        assert_eq!(image.texel(0, 0, Linear), Vec3::new(1.0, 0.5, 0.25));
        assert_eq!(image.texel(1, 0, Linear), Vec3::new(255.0, 0.0, 1.0) * 16.0);
        assert_eq!(image.texel(0, 1, Linear), Vec3::ZERO);
        assert_eq!(image.texel(1, 1, Linear), Vec3::splat(1.0 / 512.0));
        assert_eq!(image.alpha(1, 1), 1.0);
    }
}

#[test]
fn radiance_files_come_back_within_their_precision() {
    let pixels: Vec<Rgb<f32>> =
        (0..200 * 3).map(|index| Rgb([index as f32 * 0.37, 12.0, (index % 17) as f32 * 0.01])).collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes).encode(&pixels, 200, 3).unwrap();
    let image = Image::read(&bytes, LEFT).unwrap();
    assert_eq!((image.width(), image.height()), (200, 3));
    for (index, pixel) in pixels.iter().enumerate() {
        let (x, y) = (index as u32 % 200, index as u32 / 200);
        let off = (image.texel(x, y, Linear) - Vec3::from(pixel.0)).abs().max_element();
        let most = pixel.0.into_iter().fold(0.0, f32::max);
        assert!(off <= most / 128.0, "({x}, {y}): off by {off}");
    }
}

/// Replaces both windows of an EXR header.
fn resize(bytes: &mut [u8], width: i32, height: i32) {
    for name in [b"dataWindow\0box2i\0".as_slice(), b"displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|window| window == name).unwrap() + name.len() + 4;
        bytes[at + 8..at + 12].copy_from_slice(&(width - 1).to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&(height - 1).to_le_bytes());
    }
}

#[test]
fn files_over_the_limit_are_refused_before_memory_is_taken() {
    let corner = ImageBuffer::<Rgb<u8>, _>::from_pixel(3, 2, Rgb([1, 2, 3]));
    let files = [
        png(corner.clone()),
        encode(corner, ImageFormat::Jpeg),
        colors(floats),
        hdr("#?RADIANCE", "-Y 2 +X 3", &[[1; 4]; 6]),
    ];
    for bytes in &files {
        assert!(matches!(
            Image::read(bytes, 5).unwrap_err(),
            ImageError::TooLarge { width: 3, height: 2, left: 5 }
        ));
    }
    // A PNG header that announces 2^31 - 1 by 2^31 - 1 texels; its checksum is right.
    let mut huge = files[0].clone();
    huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let crc = crc(&huge[12..29]);
    huge[29..33].copy_from_slice(&crc.to_be_bytes());
    let error = Image::read(&huge, 1 << 29).unwrap_err().to_string();
    assert!(error.contains("2147483647 x 2147483647") || error.contains("not a PNG"), "{error}");
    let mut exr = files[2].clone();
    resize(&mut exr, i32::MAX, i32::MAX);
    assert!(Image::read(&exr, 1 << 29).is_err());
    resize(&mut exr, 1 << 20, 1 << 20);
    assert!(matches!(Image::read(&exr, 1 << 29), Err(ImageError::TooLarge { .. })));
    resize(&mut exr, 1 << 14, 1 << 14);
    assert!(matches!(Image::read(&exr, 1 << 29), Err(ImageError::Truncated { .. })));
    for size in ["-Y 4294967295 +X 4294967295", "-Y 65536 +X 65536", "-Y 1 +X 4294967295"] {
        assert!(Image::read(&hdr("#?RADIANCE", size, &[]), 1 << 29).is_err(), "{size}");
    }
}

#[test]
fn images_without_texels_and_foreign_files_are_refused() {
    for size in ["-Y 0 +X 3", "-Y 3 +X 0"] {
        let error = Image::read(&hdr("#?RADIANCE", size, &[]), LEFT).unwrap_err();
        assert!(matches!(error, ImageError::Empty { .. }), "{size}: {error}");
    }
    for size in ["+Y 2 +X 2", "-Y 2", "-Y 2 +X 2 3", "-Y two +X 2", "-Y -2 +X 2"] {
        assert!(Image::read(&hdr("#?RADIANCE", size, &[[1; 4]; 4]), LEFT).is_err(), "{size}");
    }
    let xyz = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n1234";
    let gif = b"GIF89a\x01\x00\x01\x00\x00\x00\x00";
    for bytes in [b"".as_slice(), b"#?", b"#?\n", b"v/1\x01", b"hello", xyz, gif] {
        assert!(Image::read(bytes, LEFT).is_err());
    }
}

#[test]
fn damaged_files_give_errors_or_images_but_never_a_panic() {
    let values: Vec<f32> = (0..21 * 9).map(|index| index as f32).collect();
    let corner = ImageBuffer::<Rgba<u8>, _>::from_fn(9, 5, |x, y| Rgba([x as u8 * 20, y as u8 * 40, 7, 200]));
    let mut rle = Vec::new();
    HdrEncoder::new(&mut rle).encode(&[Rgb([1.0, 2.0, 3.0]); 40], 20, 2).unwrap();
    let mut files = vec![
        png(corner.clone()),
        encode(DynamicImage::from(corner).into_rgb8(), ImageFormat::Jpeg),
        hdr("#?RADIANCE", "-Y 2 +X 3", &[[9, 8, 7, 130]; 6]),
        rle,
    ];
    for compression in COMPRESSIONS {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(exr::math::Vec2(8, 8))] {
            let channels = [("R", halves(&values)), ("G", halves(&values)), ("B", floats(&values))];
            files.push(exr(
                (21, 9),
                &channels,
                Encoding { compression, blocks, line_order: LineOrder::Increasing },
            ));
        }
    }
    for (number, bytes) in files.iter().enumerate() {
        assert!(Image::read(bytes, LEFT).is_ok(), "file {number}");
        for length in 0..bytes.len() {
            let read = Image::read(&bytes[..length], LEFT);
            // The last bytes of a PNG say only that it ends; what is missing of a JPEG is grey.
            let harmless = (number == 0 && length + 20 > bytes.len()) || number == 1;
            assert!(read.is_err() || harmless, "file {number} cut to {length}");
        }
        for at in 0..bytes.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] ^= flip;
                let _ = Image::read(&damaged, LEFT);
            }
        }
    }
}

#[test]
fn hostile_runs_in_radiance_files_are_harmless() {
    // Nine empty runs, each of which makes the next 256 times as long; then one that would be endless.
    let mut pixels = vec![[5, 6, 7, 130]];
    pixels.extend([[1, 1, 1, 0]; 9]);
    pixels.push([1, 1, 1, 255]);
    let _ = Image::read(&hdr("#?RADIANCE", "-Y 1 +X 100", &pixels), LEFT);
    let endless = [[5, 6, 7, 130], [1, 1, 1, 255], [1, 1, 1, 255]];
    assert!(Image::read(&hdr("#?RADIANCE", "-Y 1 +X 1000", &endless), LEFT).is_err());
    assert!(Image::read(&hdr("#?RADIANCE", "-Y 1 +X 100", &[[1, 1, 1, 9]]), LEFT).is_err());
    assert!(Image::read(&hdr("#?RADIANCE", "-Y 1 +X 8", &[[2, 2, 0, 8], [255, 1, 255, 1]]), LEFT).is_err());
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(
            crc ^ u32::from(byte),
            |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 },
        )
    })
}
