//! Image files as frames. Reading is strict: a file is read whole and undamaged, or it is an error, because a model
//! would be judged on what a lenient decoder makes up.

use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, RgbImage};
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The quality of a JPEG that is written, of 100: high, so that what a perturbation does is not mixed with what JPEG does.
const JPEG_QUALITY: u8 = 95;

/// Reads a JPEG, PNG, BMP or WebP file as RGB; what it contains decides, not its name. An alpha channel is dropped. A
/// picture that its camera held otherwise (the orientation of the file's EXIF data) is turned upright.
///
/// # Errors
/// Where the file cannot be read, is no such image, or is damaged or cut off: there is no partial image.
pub fn read(path: &Path) -> Result<FrameBuf> {
    read_as(path, |image| frame(image.into_rgb8()))
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

fn read_as<T>(path: &Path, convert: impl FnOnce(DynamicImage) -> Result<T>) -> Result<T> {
    let place = format!("image `{}`", path.display());
    let bytes = std::fs::read(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => Error::new(format!("{place} does not exist")),
        _ => Error::from(error).at(&place),
    })?;
    decode(&bytes).and_then(convert).map_err(|e| e.at(&place))
}

fn frame(image: RgbImage) -> Result<FrameBuf> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    Ok(FrameBuf::from_vec(image.into_raw(), width, height)?)
}

fn decode(bytes: &[u8]) -> Result<DynamicImage> {
    let format = image::guess_format(bytes)
        .ok()
        .filter(is_still)
        .ok_or_else(|| Error::new("it is no JPEG, PNG, BMP or WebP file"))?;
    let (mut image, orientation) = match format {
        ImageFormat::Jpeg => jpeg(bytes)?,
        _ => other(bytes, format).place("it is damaged")?,
    };
    image.apply_orientation(orientation);
    Ok(image)
}

/// Decodes what is no JPEG.
fn other(bytes: &[u8], format: ImageFormat) -> image::ImageResult<(DynamicImage, Orientation)> {
    let mut decoder = ImageReader::with_format(Cursor::new(bytes), format).into_decoder()?;
    // A file that says it is as large as the world is not believed.
    let mut limits = Limits::default();
    limits.reserve(decoder.total_bytes())?;
    decoder.set_limits(limits)?;
    let orientation = decoder.orientation()?;
    Ok((DynamicImage::from_decoder(decoder)?, orientation))
}

/// The formats that are read and written: those of single pictures.
fn is_still(format: &ImageFormat) -> bool {
    matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Bmp | ImageFormat::WebP)
}

/// Decodes a JPEG. Most decoders, `image`'s among them, fill what is missing of a damaged file with grey; a model
/// would be judged on that. What cannot be told from a whole file is one in which bytes were exchanged for others that
/// still decode, for JPEG has no checksum.
fn jpeg(bytes: &[u8]) -> Result<(DynamicImage, Orientation)> {
    if !reaches_end(bytes) {
        return Err(Error::new("it is cut off: the JPEG's end is missing"));
    }
    let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let pixels = decoder.decode().place("it is damaged")?;
    let (width, height) = decoder.dimensions().ok_or_else(|| Error::new("it is damaged: it has no size"))?;
    let orientation = decoder.exif().and_then(|exif| Orientation::from_exif_chunk(exif));
    let image = RgbImage::from_raw(width as u32, height as u32, pixels)
        .ok_or_else(|| Error::new("it is damaged: it has fewer pixels than its size says"))?;
    Ok((image.into(), orientation.unwrap_or(Orientation::NoTransforms)))
}

/// Whether a JPEG has the marker that ends it (ITU-T T.81, annex B). Looks at the segments one after the other, because
/// the thumbnail inside a segment may end with the same bytes.
fn reaches_end(bytes: &[u8]) -> bool {
    const END_OF_IMAGE: u8 = 0xd9;
    let mut position = 0;
    loop {
        // Inside compressed data 0xff is followed by 0 (a plain 0xff) or by a restart marker; between segments it may
        // be repeated.
        while !matches!(bytes.get(position..position + 2), Some([0xff, next]) if !matches!(next, 0 | 0xff)) {
            position += 1;
            if position >= bytes.len() {
                return false;
            }
        }
        let marker = bytes[position + 1];
        position += 2;
        match marker {
            END_OF_IMAGE => return true,
            // Start of image, restarts and the temporary marker stand alone.
            0x01 | 0xd0..=0xd8 => {}
            _ => match bytes.get(position..position + 2) {
                Some(&[high, low]) => position += usize::from(u16::from_be_bytes([high, low])),
                _ => return false,
            },
        }
    }
}

/// Writes a frame as PNG, JPEG (of quality 95), BMP or WebP; the ending of the name says which. Folders on the way are made.
///
/// # Errors
/// Where the ending is another one, or the file cannot be written.
pub fn write(path: &Path, frame: Frame<'_>) -> Result<()> {
    let place = format!("cannot write the image {}", path.display());
    let format = ImageFormat::from_path(path)
        .ok()
        .filter(is_still)
        .ok_or_else(|| Error::new(format!("{place}: its name has to end in .png, .jpg, .bmp or .webp")))?;
    let (width, height) = (frame.width() as u32, frame.height() as u32);
    let image = RgbImage::from_raw(width, height, frame.to_buf().into_vec())
        .ok_or_else(|| Error::new(format!("{place}: it is too large")))?;
    let mut encoded = Cursor::new(Vec::new());
    match format {
        ImageFormat::Jpeg => {
            JpegEncoder::new_with_quality(&mut encoded, JPEG_QUALITY).encode_image(&image).place(&place)?;
        }
        _ => image.write_to(&mut encoded, format).place(&place)?,
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).place(&place)?;
    }
    std::fs::write(path, encoded.into_inner()).place(&place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ExtendedColorType, ImageEncoder};

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

    #[test]
    fn the_end_of_a_thumbnail_is_not_taken_for_the_end() {
        let bytes = encoded(ImageFormat::Jpeg);
        let mut with_thumbnail = bytes[..2].to_vec();
        with_thumbnail.extend([0xff, 0xe1, 0, 6, 1, 2, 0xff, 0xd9]);
        with_thumbnail.extend(&bytes[2..]);
        assert!(decode(&with_thumbnail).is_ok());
        assert!(!reaches_end(&with_thumbnail[..with_thumbnail.len() - 2]));
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
        let (frame, alpha) = read_with_alpha(&path).unwrap();
        assert_eq!((frame.data()[..3].to_vec(), alpha), (vec![10, 20, 30], vec![0, 100, 200]));
        write(&path, frame.as_ref()).unwrap();
        assert_eq!(read_with_alpha(&path).unwrap().1, [255; 3]);
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
    fn what_is_no_image_is_said_to_be_none() {
        assert!(decode(b"GIF89a\x01\0\x01\0\0\0\0;").unwrap_err().message().starts_with("it is no JPEG"));
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::WebP] {
            assert!(is_image(&encoded(format)[..12]), "{format:?}");
        }
        assert!(!is_image(b"hello hello!") && !is_image(b""));
        assert_eq!(decode(b"hello").unwrap_err().message(), "it is no JPEG, PNG, BMP or WebP file");
        let missing = read(Path::new("/no/such.jpg")).unwrap_err();
        assert_eq!(missing.message(), "image `/no/such.jpg` does not exist");
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
