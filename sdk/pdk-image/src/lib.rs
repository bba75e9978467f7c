//! Image files as frames. Reading is strict: a file is read whole and undamaged, or it is an error, because a model
//! would be judged on what a lenient decoder makes up.

mod jpeg;
mod png;
pub mod samples;
mod scan;
mod size;

use std::io::{Cursor, Read};
use std::path::Path;

use image::codecs::bmp::BmpDecoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, Limits, RgbImage};
use pdk_sdk::error::Place;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

use png::DAMAGED;
pub use png::{check_animation, without_texts};
pub use size::{LARGEST_FILE, LONGEST, check_size, most_pixels};

/// The quality of a JPEG that is written, of 100: high, so that what a perturbation does is not mixed with what JPEG does.
const JPEG_QUALITY: u8 = 95;

/// Reads a JPEG, PNG, BMP or WebP file as RGB; what it contains decides, not its name. A picture that its camera held otherwise
/// (the orientation of the file's EXIF data) is turned upright.
///
/// # Errors
/// If the file cannot be read, is not such an image, has more than [`most_pixels`], is an animation, has pixels that are not
/// opaque, or is damaged or cut off: there is no partial image.
pub fn read(path: &Path) -> Result<FrameBuf> {
    read_as(path, opaque)
}

/// Reads an image to its end from a stream, such as standard input, as [`read`] does from a file.
///
/// # Errors
/// As [`read`].
pub fn read_from(stream: impl Read) -> Result<FrameBuf> {
    let mut bytes = Vec::new();
    stream.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 {
        0 => Err(Error::new("it is empty; send an image in JPEG, PNG, BMP or WebP")),
        1..=LARGEST_FILE => opaque(decode(&bytes)?),
        _ => Err(Error::new(format!(
            "it has more than {LARGEST_FILE} bytes, which no image has that can be read"
        ))),
    }
}

/// The frame of a picture through which nothing else is to be seen.
fn opaque(image: DynamicImage) -> Result<FrameBuf> {
    check_opaque(&image)?;
    frame(image.into_rgb8())
}

/// Refuses a picture through which something else is to be seen: what a frame would show there is nowhere written.
fn check_opaque(image: &DynamicImage) -> Result<()> {
    let transparent = match image {
        DynamicImage::ImageLumaA8(pixels) => pixels.pixels().filter(|pixel| pixel.0[1] < u8::MAX).count(),
        DynamicImage::ImageRgba8(pixels) => pixels.pixels().filter(|pixel| pixel.0[3] < u8::MAX).count(),
        DynamicImage::ImageLumaA16(pixels) => pixels.pixels().filter(|pixel| pixel.0[1] < u16::MAX).count(),
        DynamicImage::ImageRgba16(pixels) => pixels.pixels().filter(|pixel| pixel.0[3] < u16::MAX).count(),
        DynamicImage::ImageRgba32F(pixels) => pixels.pixels().filter(|pixel| pixel.0[3] < 1.0).count(),
        _ => 0,
    };
    match transparent {
        0 => Ok(()),
        count => Err(Error::new(format!(
            "{count} of its pixels are not opaque, and frames have no transparency; lay it over a background and save it without an \
             alpha channel"
        ))),
    }
}

/// Reads an image as [`read`] does, and its alpha channel with it: a byte a pixel row by row, 255 where it is opaque.
///
/// # Errors
/// As [`read`].
pub fn read_with_alpha(path: &Path) -> Result<(FrameBuf, Vec<u8>)> {
    read_as(path, |image| {
        let alpha = image.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect();
        Ok((frame(image.into_rgb8())?, alpha))
    })
}

/// Whether a file that begins so is of a format that [`read`] reads. Twelve bytes tell.
pub fn is_image(head: &[u8]) -> bool {
    image::guess_format(head).is_ok_and(|format| is_still(&format))
}

/// Decodes an image file as [`read`] does.
///
/// # Errors
/// As [`read`].
pub fn decode(bytes: &[u8]) -> Result<DynamicImage> {
    let format = format_of(bytes)?;
    let (mut image, orientation) = match format {
        ImageFormat::Jpeg => jpeg::decode(bytes)?,
        ImageFormat::Png => png::decode(bytes)?,
        _ => other(bytes, format)?,
    };
    image.apply_orientation(orientation);
    Ok(image)
}

/// Decodes an image file as [`decode`] does, and drops an alpha channel, as that of a simulator's camera, into a frame of its size. Returns the width and
/// height of the picture in pixels; where the frame has another size, it holds nothing of use.
///
/// # Errors
/// As [`read`]. The frame may hold a part of the picture then.
pub fn decode_into(bytes: &[u8], mut into: FrameMut<'_>) -> Result<(usize, usize)> {
    // Most pictures need no memory but the frame's own.
    let done = match format_of(bytes)? {
        ImageFormat::Jpeg => jpeg::decode_into(bytes, &mut into)?,
        ImageFormat::Png => png::decode_into(bytes, &mut into)?,
        _ => false,
    };
    if done {
        return Ok((into.width(), into.height()));
    }
    let picture = decode(bytes)?.into_rgb8();
    let size = (picture.width() as usize, picture.height() as usize);
    if size == (into.width(), into.height()) {
        into.copy_from(Frame::new(picture.as_raw(), size.0, size.1).map_err(Error::new)?);
    }
    Ok(size)
}

fn format_of(bytes: &[u8]) -> Result<ImageFormat> {
    let format = image::guess_format(bytes).ok().filter(is_still);
    format.ok_or_else(|| Error::new("it is not a JPEG, PNG, BMP or WebP file"))
}

fn read_as<T>(path: &Path, convert: impl FnOnce(DynamicImage) -> Result<T>) -> Result<T> {
    let bytes = match path.try_exists() {
        Ok(false) => Err(Error::new("it does not exist; check the path")),
        _ => file::read(path, LARGEST_FILE),
    };
    let image = bytes.and_then(|bytes| decode(&bytes)).and_then(convert);
    image.map_err(|error| error.at(format_args!("image `{}`", path.display())))
}

fn frame(image: RgbImage) -> Result<FrameBuf> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    FrameBuf::from_vec(image.into_raw(), width, height).map_err(Error::new)
}

/// Decodes BMP and WebP.
fn other(bytes: &[u8], format: ImageFormat) -> Result<(DynamicImage, Orientation)> {
    // By their names, because a decoder for any format brings all of them into every library that reads pictures.
    if format == ImageFormat::Bmp {
        return finish(BmpDecoder::new(Cursor::new(bytes)).place(DAMAGED)?);
    }
    let decoder = WebPDecoder::new(Cursor::new(bytes)).place(DAMAGED)?;
    if decoder.has_animation() {
        return Err(Error::new(
            "it is an animation where one picture is expected; save the one that is meant as a file of its own",
        ));
    }
    finish(decoder)
}

fn finish(mut decoder: impl ImageDecoder) -> Result<(DynamicImage, Orientation)> {
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    let mut limits = Limits::default();
    // What the picture takes, and as much beside it.
    limits.max_alloc = Some(decoder.total_bytes().saturating_mul(2).max(1 << 20));
    decoder.set_limits(limits).place(DAMAGED)?;
    let orientation = decoder.orientation().place(DAMAGED)?;
    Ok((DynamicImage::from_decoder(decoder).place(DAMAGED)?, orientation))
}

/// The formats that are read and written: those of single pictures.
fn is_still(format: &ImageFormat) -> bool {
    matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Bmp | ImageFormat::WebP)
}

/// Writes a frame as PNG, JPEG (of quality 95), BMP or WebP; the ending of the name says which. Folders on the way are made.
///
/// # Errors
/// If the ending is another one, or the file cannot be written.
pub fn write(path: &Path, frame: Frame<'_>) -> Result<()> {
    let place = format!("cannot write the image {}", path.display());
    let encoded = encode(path, frame, JPEG_QUALITY).place(&place)?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).place(&place)?;
    }
    file::write(path, &encoded).place(&place)
}

/// The bytes of a frame as a file of this name: PNG, JPEG of this quality from 1 to 100, BMP or WebP, by its ending.
///
/// # Errors
/// If the ending is another one, or the frame is too large for the format.
pub fn encode(name: &Path, frame: Frame<'_>, quality: u8) -> Result<Vec<u8>> {
    const FAILED: &str = "it cannot be encoded";
    let format = ImageFormat::from_path(name)
        .ok()
        .filter(is_still)
        .ok_or_else(|| Error::new("its name has to end in .png, .jpg, .bmp or .webp"))?;
    let (width, height) = (frame.width() as u32, frame.height() as u32);
    let image = RgbImage::from_raw(width, height, frame.to_buf().into_vec())
        .ok_or_else(|| Error::new("it is too large"))?;
    let mut encoded = Cursor::new(Vec::new());
    match format {
        ImageFormat::Jpeg => {
            JpegEncoder::new_with_quality(&mut encoded, quality).encode_image(&image).place(FAILED)?;
        }
        _ => image.write_to(&mut encoded, format).place(FAILED)?,
    }
    Ok(encoded.into_inner())
}

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ExtendedColorType, ImageEncoder};
    use zune_jpeg::JpegDecoder;
    use zune_jpeg::zune_core::bytestream::ZCursor;
    use zune_jpeg::zune_core::colorspace::ColorSpace;
    use zune_jpeg::zune_core::options::DecoderOptions;

    fn decode(bytes: &[u8]) -> Result<FrameBuf> {
        super::decode(bytes).and_then(|image| frame(image.into_rgb8()))
    }

    /// A picture with some structure.
    fn picture(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |x, y| {
            image::Rgb([(x * 4) as u8, (y * 5) as u8, ((x * 7 + y * 3) % 251) as u8])
        })
    }

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::from(picture(64, 48)).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn whole_images_are_read_as_they_are() {
        for format in [ImageFormat::Png, ImageFormat::Bmp] {
            let frame = decode(&encoded(format)).unwrap();
            assert_eq!((frame.width(), frame.height()), (64, 48));
            assert_eq!(frame.data(), picture(64, 48).as_raw().as_slice());
        }
        let grey = DynamicImage::from(picture(9, 7)).into_luma8();
        let mut bytes = Vec::new();
        JpegEncoder::new(&mut bytes).write_image(&grey, 9, 7, ExtendedColorType::L8).unwrap();
        let frame = decode(&bytes).unwrap();
        assert!(frame.data().chunks(3).all(|p| p[0] == p[1] && p[1] == p[2]));
    }

    #[test]
    fn what_is_decoded_into_a_frame_is_what_is_decoded_by_itself() {
        let mut files: Vec<Vec<u8>> = foreign().map(<[u8]>::to_vec).into();
        files.extend([ImageFormat::Jpeg, ImageFormat::Png, ImageFormat::Bmp].map(encoded));
        // With alpha, and grey.
        let image = DynamicImage::from(picture(64, 48));
        for other in [DynamicImage::from(image.to_rgba8()), DynamicImage::from(image.to_luma8())] {
            let mut bytes = Cursor::new(Vec::new());
            other.write_to(&mut bytes, ImageFormat::Png).unwrap();
            files.push(bytes.into_inner());
        }
        for (number, bytes) in files.iter().enumerate() {
            let expected = decode(bytes).unwrap();
            let mut frame = FrameBuf::new(expected.width(), expected.height());
            assert_eq!(
                decode_into(bytes, frame.as_mut()),
                Ok((expected.width(), expected.height())),
                "{number}"
            );
            assert_eq!(frame.data(), expected.data(), "{number}");
            // In rows that lie apart, and in a frame of another size.
            let stride = 3 * expected.width() + 5;
            let mut apart = vec![9; stride * expected.height()];
            let view =
                FrameMut::with_stride(&mut apart, expected.width(), expected.height(), stride).unwrap();
            decode_into(bytes, view).unwrap();
            assert!(
                apart
                    .chunks(stride)
                    .zip(expected.data().chunks(stride - 5))
                    .all(|(a, b)| a[..stride - 5] == *b)
            );
            let mut other = FrameBuf::new(expected.width() + 1, expected.height());
            assert_eq!(decode_into(bytes, other.as_mut()), Ok((expected.width(), expected.height())));
            assert!(decode_into(&bytes[..bytes.len() / 2], frame.as_mut()).is_err(), "{number}");
        }
    }

    #[test]
    fn a_jpeg_is_decoded_as_the_image_crate_does() {
        let bytes = encoded(ImageFormat::Jpeg);
        let theirs = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert_eq!(decode(&bytes).unwrap().data(), theirs.as_raw().as_slice());
    }

    #[test]
    fn a_jpeg_cut_off_anywhere_is_an_error() {
        let bytes = encoded(ImageFormat::Jpeg);
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes were taken", bytes.len());
        }
        assert!(decode(&bytes).is_ok());
    }

    #[test]
    fn a_jpeg_whose_tail_was_never_written_is_an_error() {
        let bytes = encoded(ImageFormat::Jpeg);
        for length in (0..bytes.len() - 1).step_by(7) {
            let mut blank = bytes[..length].to_vec();
            blank.resize(bytes.len(), 0);
            assert!(decode(&blank).is_err(), "{length} of {} bytes were taken", bytes.len());
        }
    }

    /// JPEGs as other programs write them: in several passes, with restarts, with fewer samples of color, grey.
    fn foreign() -> [&'static [u8]; 4] {
        [
            include_bytes!("../tests/jpeg/progressive.jpg"),
            include_bytes!("../tests/jpeg/restarts.jpg"),
            include_bytes!("../tests/jpeg/progressive_restarts.jpg"),
            include_bytes!("../tests/jpeg/grey_progressive.jpg"),
        ]
    }

    #[test]
    fn all_forms_of_jpeg_are_read_and_none_with_missing_data() {
        for (number, bytes) in foreign().into_iter().chain([&encoded(ImageFormat::Jpeg)[..]]).enumerate() {
            let theirs = image::load_from_memory(bytes).unwrap().into_rgb8();
            assert_eq!(decode(bytes).unwrap().data(), theirs.as_raw().as_slice(), "{number}");
            // Compressed data goes on from the first scan's header to the end marker.
            let begin = bytes.windows(2).position(|pair| pair == [0xff, 0xda]).unwrap() + 14;
            let end = bytes.len() - 2;
            let (mut taken, mut tried) = (0, 0);
            for from in (begin..end).step_by(7) {
                // Without a few bytes, what follows may happen to be as many blocks again, which no decoder can tell: JPEG has no
                // checksum. A larger hole is found.
                for (length, may_be_taken) in [(1, true), (16, true), (150, false), (end - from, false)] {
                    if from + length > end {
                        continue;
                    }
                    let deleted = [&bytes[..from], &bytes[from + length..]].concat();
                    let read = decode(&deleted).is_ok();
                    assert!(may_be_taken || !read, "{number}: {length} bytes from {from} on are missing");
                    (taken, tried) = (taken + usize::from(read), tried + 1);
                }
            }
            assert!(taken * 3 <= tried, "{number}: {taken} of {tried} with a hole were taken");
        }
    }

    #[test]
    fn a_scan_that_is_missing_as_a_whole_is_an_error() {
        for bytes in [foreign()[0], foreign()[3]] {
            let scans: Vec<usize> =
                (0..bytes.len() - 1).filter(|&at| bytes[at..at + 2] == [0xff, 0xda]).collect();
            assert!(scans.len() > 3);
            for &scan in &scans {
                let deleted = [&bytes[..scan], &bytes[bytes.len() - 2..]].concat();
                let error = decode(&deleted).unwrap_err().to_string();
                assert!(error.starts_with("it is damaged"), "{error}");
            }
        }
    }

    #[test]
    fn small_files_that_claim_large_pictures_are_refused() {
        let mut jpeg = encoded(ImageFormat::Jpeg);
        let size = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap() + 5;
        let error = |bytes: &[u8]| decode(bytes).unwrap_err().to_string();
        jpeg[size..size + 4].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
        assert_eq!(
            error(&jpeg),
            "it is 16000 x 16000, and pictures may have 64 megapixels and sides of 16384; scale it down, or raise the limit \
             with PDK_MEGAPIXELS"
        );
        jpeg[size..size + 4].copy_from_slice(&[0x20, 0, 0x20, 0]);
        assert_eq!(error(&jpeg), "it is damaged: a part of its compressed data is missing");
        let mut png = encoded(ImageFormat::Png);
        png[16..24].copy_from_slice(&[0, 0, 0x40, 1, 0, 0, 0, 1]);
        let checksum = crc(&png[12..29]);
        png[29..33].copy_from_slice(&checksum.to_be_bytes());
        assert!(error(&png).starts_with("it is 16385 x 1, and pictures may have"), "{}", error(&png));
        let mut bmp = encoded(ImageFormat::Bmp);
        bmp[18..26].copy_from_slice(&[0, 0x30, 0, 0, 0, 0x30, 0, 0]);
        assert!(error(&bmp).starts_with("it is 12288 x 12288, and pictures may have"), "{}", error(&bmp));
    }

    /// The checksum of a PNG's chunk (PNG specification, annex D).
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8)
                .fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
        })
    }

    /// A PNG file with another chunk before its pixels.
    fn with_chunk(png: &[u8], name: &[u8; 4], data: &[u8]) -> Vec<u8> {
        let body = [name, data].concat();
        let chunk = [&(data.len() as u32).to_be_bytes()[..], &body, &crc(&body).to_be_bytes()].concat();
        [&png[..33], &chunk, &png[33..]].concat()
    }

    #[test]
    fn a_png_whose_pixels_do_not_fit_their_checksum_is_an_error() {
        let whole = encoded(ImageFormat::Png);
        // The checksum of the pixels comes last in the last IDAT, before that of the chunk and the IEND.
        let at = whole.windows(4).position(|name| name == b"IEND").unwrap() - 4 - 4 - 4;
        let begin = whole.windows(4).rposition(|name| name == b"IDAT").unwrap();
        let mut wrong = whole.clone();
        wrong[at] ^= 1;
        let checksum = crc(&wrong[begin..at + 4]);
        wrong[at + 4..at + 8].copy_from_slice(&checksum.to_be_bytes());
        let error = decode(&wrong).unwrap_err().to_string();
        assert!(error.starts_with("it is damaged"), "{error}");
        assert!(decode(&whole).is_ok());
    }

    #[test]
    fn chunks_that_are_not_part_of_the_picture_of_a_png_are_not_expanded() {
        let whole = encoded(ImageFormat::Png);
        // Not even valid, which would show if it were read.
        let texts = with_chunk(&with_chunk(&whole, b"zTXt", b"k\0\0no zlib"), b"iCCP", b"k\0\0no zlib");
        assert_eq!(decode(&texts).unwrap(), decode(&whole).unwrap());
        assert_eq!(without_texts(&texts).unwrap(), whole);
        assert!(without_texts(&whole[..whole.len() - 5]).is_err());
    }

    #[test]
    fn pngs_of_all_kinds_are_read_as_the_image_crate_does() {
        use image::ColorType::{L8, L16, La8, La16, Rgb8, Rgb16, Rgba8, Rgba16};
        for color in [L8, La8, Rgb8, Rgba8, L16, La16, Rgb16, Rgba16] {
            let pixels: Vec<u8> =
                (0..5 * 3 * usize::from(color.bytes_per_pixel())).map(|i| (i * 37) as u8).collect();
            let mut bytes = Vec::new();
            let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
            encoder.write_image(&pixels, 5, 3, color.into()).unwrap();
            let theirs = image::load_from_memory(&bytes).unwrap();
            assert_eq!(super::decode(&bytes).unwrap(), theirs, "{color:?}");
        }
    }

    #[test]
    fn the_end_of_a_thumbnail_is_not_taken_for_the_end() {
        let bytes = encoded(ImageFormat::Jpeg);
        let mut with_thumbnail = bytes[..2].to_vec();
        with_thumbnail.extend([0xff, 0xe1, 0, 6, 1, 2, 0xff, 0xd9]);
        with_thumbnail.extend(&bytes[2..]);
        assert!(decode(&with_thumbnail).is_ok());
        assert!(decode(&with_thumbnail[..with_thumbnail.len() - 2]).is_err());
        // Some cameras write a few bytes behind the end.
        with_thumbnail.extend([0, 0, 0, 0]);
        assert!(decode(&with_thumbnail).is_ok());
    }

    #[test]
    fn other_formats_cut_off_are_whole_or_an_error() {
        for format in [ImageFormat::Png, ImageFormat::Bmp, ImageFormat::WebP] {
            let bytes = encoded(format);
            let whole = decode(&bytes).unwrap();
            for length in 0..bytes.len() {
                if let Ok(frame) = decode(&bytes[..length]) {
                    assert_eq!(frame, whole, "{format:?}: {length} of {} bytes", bytes.len());
                }
            }
        }
    }

    #[test]
    fn what_was_written_is_read_back() {
        let folder = std::env::temp_dir().join(format!("pdk-image-{}", std::process::id()));
        let frame = FrameBuf::from_vec(picture(9, 7).into_raw(), 9, 7).unwrap();
        for name in ["a.png", "deeper/a.bmp", "a.webp"] {
            write(&folder.join(name), frame.as_ref()).unwrap();
            assert_eq!(read(&folder.join(name)).unwrap(), frame);
        }
        let error = write(&folder.join("a.xyz"), frame.as_ref()).unwrap_err().to_string();
        assert!(error.ends_with("its name has to end in .png, .jpg, .bmp or .webp"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// EXIF data that says how the camera was held, in either byte order.
    fn exif(orientation: u8, big: bool) -> Vec<u8> {
        match big {
            true => {
                [&b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..], &[orientation, 0, 0, 0, 0, 0, 0]]
                    .concat()
            }
            false => {
                [&b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"[..], &[orientation, 0, 0, 0, 0, 0, 0, 0]]
                    .concat()
            }
        }
    }

    /// Where the pixel of the upright picture lies in the stored one (TIFF 6.0, tag Orientation): row 0 and column 0 of
    /// the stored picture are the sides that the value names.
    fn stored_at(orientation: u8, x: u32, y: u32, width: u32, height: u32) -> (u32, u32) {
        let (right, bottom) = (width - 1 - x, height - 1 - y);
        match orientation {
            1 => (x, y),
            2 => (right, y),
            3 => (right, bottom),
            4 => (x, bottom),
            5 => (y, x),
            6 => (y, right),
            7 => (bottom, right),
            _ => (bottom, x),
        }
    }

    #[test]
    fn pictures_are_turned_upright() {
        for orientation in 1..=8 {
            let turned = orientation >= 5;
            // A gradient that JPEG keeps nearly as it is.
            let stored =
                RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * 3) as u8, (y * 4) as u8, (x + y) as u8]));
            let mut files = vec![Vec::new(); 4];
            let mut png = image::codecs::png::PngEncoder::new(&mut files[0]);
            png.set_exif_metadata(exif(orientation, true)).unwrap();
            png.write_image(&stored, 64, 48, ExtendedColorType::Rgb8).unwrap();
            for (file, big) in [(1, true), (2, false)] {
                let mut jpeg = JpegEncoder::new_with_quality(&mut files[file], 100);
                jpeg.set_exif_metadata(exif(orientation, big)).unwrap();
                jpeg.write_image(&stored, 64, 48, ExtendedColorType::Rgb8).unwrap();
            }
            let mut webp = image::codecs::webp::WebPEncoder::new_lossless(&mut files[3]);
            webp.set_exif_metadata(exif(orientation, false)).unwrap();
            webp.write_image(&stored, 64, 48, ExtendedColorType::Rgb8).unwrap();
            for bytes in files {
                let frame = decode(&bytes).unwrap();
                let (width, height) = if turned { (48, 64) } else { (64, 48) };
                assert_eq!((frame.width(), frame.height()), (width, height), "orientation {orientation}");
                for (x, y) in [(0, 0), (5, 9), (47, 0), (0, 47), (30, 40)] {
                    let (u, v) = stored_at(orientation, x, y, width as u32, height as u32);
                    let (found, expected) =
                        (frame.as_ref().pixel(x as usize, y as usize), stored.get_pixel(u, v).0);
                    let near = found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 3);
                    assert!(near, "orientation {orientation}, ({x}, {y}): {found:?} for {expected:?}");
                }
            }
        }
    }

    #[test]
    fn exif_data_that_makes_no_sense_is_passed_over() {
        for nonsense in [&b""[..], b"MM", b"II*\0\xff\xff\xff\xff", &exif(9, true), &exif(0, false)] {
            let mut bytes = Vec::new();
            let mut jpeg = JpegEncoder::new(&mut bytes);
            jpeg.set_exif_metadata(nonsense.to_vec()).unwrap();
            jpeg.write_image(&picture(9, 7), 9, 7, ExtendedColorType::Rgb8).unwrap();
            assert_eq!(decode(&bytes).unwrap().width(), 9, "{nonsense:?}");
        }
    }

    #[test]
    fn alpha_is_read_where_it_is_asked_for() {
        let path = std::env::temp_dir().join(format!("pdk-image-alpha-{}.png", std::process::id()));
        image::RgbaImage::from_fn(3, 1, |x, _| image::Rgba([10, 20, 30, (x * 100) as u8]))
            .save(&path)
            .unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(
            error.contains("3 of its pixels are not opaque") && error.contains("a background"),
            "{error}"
        );
        let (frame, alpha) = read_with_alpha(&path).unwrap();
        assert_eq!((frame.data()[..3].to_vec(), alpha), (vec![10, 20, 30], vec![0, 100, 200]));
        write(&path, frame.as_ref()).unwrap();
        assert_eq!(read_with_alpha(&path).unwrap().1, [255; 3]);
        // An alpha channel that hides nothing is none.
        image::RgbaImage::from_pixel(3, 1, image::Rgba([10, 20, 30, 255])).save(&path).unwrap();
        assert_eq!(read(&path).unwrap().data()[..3], [10, 20, 30]);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_jpeg_that_is_written_stays_near_the_frame() {
        let path = std::env::temp_dir().join(format!("pdk-image-quality-{}.jpg", std::process::id()));
        let frame = FrameBuf::from_vec(picture(64, 48).into_raw(), 64, 48).unwrap();
        write(&path, frame.as_ref()).unwrap();
        let table = std::fs::read(&path).unwrap();
        // The first quantisation table (T.81, B.2.4.1) begins with the step of the mean: 16 at quality 50, 2 at 95.
        let start = table.windows(2).position(|marker| marker == [0xff, 0xdb]).unwrap();
        assert_eq!(table[start + 5], 2);
        let back = read(&path).unwrap();
        let difference =
            frame.data().iter().zip(back.data()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
        let mean = difference / frame.data().len() as f64;
        assert!(mean < 2.5, "the mean difference is {mean}");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_file_that_is_not_an_image_is_reported_as_such() {
        assert!(decode(b"GIF89a\x01\0\x01\0\0\0\0;").unwrap_err().message().starts_with("it is not a JPEG"));
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::WebP] {
            assert!(is_image(&encoded(format)[..12]), "{format:?}");
        }
        assert!(!is_image(b"hello hello!") && !is_image(b""));
        assert_eq!(decode(b"hello").unwrap_err().message(), "it is not a JPEG, PNG, BMP or WebP file");
        let missing = read(Path::new("/no/such.jpg")).unwrap_err();
        assert_eq!(missing.message(), "image `/no/such.jpg`: it does not exist; check the path");
    }

    #[test]
    fn the_instruction_set_makes_no_difference_to_a_jpeg() {
        let files = [encoded(ImageFormat::Jpeg)];
        for bytes in files {
            let plain =
                DecoderOptions::default().set_use_unsafe(false).jpeg_set_out_colorspace(ColorSpace::RGB);
            let pixels = JpegDecoder::new_with_options(ZCursor::new(&bytes), plain).decode().unwrap();
            assert_eq!(decode(&bytes).unwrap().data(), pixels);
        }
    }
}
