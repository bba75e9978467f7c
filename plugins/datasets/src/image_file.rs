//! Reads an image file, all of it or not at all.

use std::path::Path;

use image::ImageFormat;
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Reads a JPEG, PNG, BMP or WebP file as RGB; what it contains decides, not its name. An alpha channel is dropped.
///
/// # Errors
/// Where the file cannot be read, is no such image, or is damaged or cut off: there is no partial image.
pub fn read(path: &Path) -> Result<FrameBuf> {
    let place = format!("image `{}`", path.display());
    let bytes = std::fs::read(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => Error::new(format!("{place} does not exist")),
        _ => Error::from(error).at(&place),
    })?;
    decode(&bytes).map_err(|e| e.at(&place))
}

fn decode(bytes: &[u8]) -> Result<FrameBuf> {
    let format =
        image::guess_format(bytes).map_err(|_| Error::new("it is no JPEG, PNG, BMP or WebP file"))?;
    if format == ImageFormat::Jpeg {
        return jpeg(bytes);
    }
    let rgb = image::load_from_memory_with_format(bytes, format).place("it is damaged")?.into_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    Ok(FrameBuf::from_vec(rgb.into_raw(), width, height)?)
}

/// Decodes a JPEG. Most decoders, `image`'s among them, fill what is missing of a damaged file with grey; a model
/// would be judged on that. What cannot be told from a whole file is one in which bytes were exchanged for others that
/// still decode, for JPEG has no checksum.
fn jpeg(bytes: &[u8]) -> Result<FrameBuf> {
    if !reaches_end(bytes) {
        return Err(Error::new("it is cut off: the JPEG's end is missing"));
    }
    let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let pixels = decoder.decode().place("it is damaged")?;
    let (width, height) = decoder.dimensions().ok_or_else(|| Error::new("it is damaged: it has no size"))?;
    Ok(FrameBuf::from_vec(pixels, width, height)?)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use image::codecs::jpeg::JpegEncoder;
    use image::{DynamicImage, ExtendedColorType, ImageEncoder};
    use std::io::Cursor;

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::from(fixture::picture(64, 48)).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn whole_images_are_read_as_they_are() {
        for format in [ImageFormat::Png, ImageFormat::Bmp] {
            let frame = decode(&encoded(format)).unwrap();
            assert_eq!((frame.width(), frame.height()), (64, 48));
            assert_eq!(frame.data(), fixture::picture(64, 48).as_raw().as_slice());
        }
        let grey = DynamicImage::from(fixture::picture(9, 7)).into_luma8();
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
    fn what_is_no_image_is_said_to_be_none() {
        assert_eq!(decode(b"hello").unwrap_err().message(), "it is no JPEG, PNG, BMP or WebP file");
        let missing = read(Path::new("/no/such.jpg")).unwrap_err();
        assert_eq!(missing.message(), "image `/no/such.jpg` does not exist");
    }

    #[test]
    fn the_instruction_set_makes_no_difference_to_a_jpeg() {
        let mut files = vec![encoded(ImageFormat::Jpeg)];
        if let Some(images) = fixture::shared("tub/images") {
            files.extend(
                std::fs::read_dir(images).unwrap().map(|f| std::fs::read(f.unwrap().path()).unwrap()),
            );
        }
        for bytes in files {
            let plain =
                DecoderOptions::default().set_use_unsafe(false).jpeg_set_out_colorspace(ColorSpace::RGB);
            let pixels = JpegDecoder::new_with_options(ZCursor::new(&bytes), plain).decode().unwrap();
            assert_eq!(decode(&bytes).unwrap().data(), pixels);
        }
    }
}
