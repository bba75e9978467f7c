//! Decodes JPEG.

use image::metadata::Orientation;
use image::{DynamicImage, RgbImage};
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::scan;
use crate::size::check_size;

const DAMAGED: &str = "it is damaged";

type Decoder<'a> = JpegDecoder<ZCursor<&'a [u8]>>;

/// A file of which the head was read, and the size of its picture.
///
/// Most decoders fill what is missing of a damaged file with grey; a model would be judged on that. What cannot be told from
/// a whole file is one in which bytes were exchanged for others that still decode, for JPEG has no checksum.
fn read(bytes: &[u8]) -> Result<(Decoder<'_>, u32, u32)> {
    // The limit of all pictures is checked below; the decoder's own is not to speak first.
    let largest = usize::from(u16::MAX);
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(largest)
        .set_max_height(largest)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().place(DAMAGED)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| Error::new("it is damaged: it has no size"))?;
    let (width, height) = (width as u32, height as u32);
    check_size(width, height)?;
    scan::check(bytes)?;
    Ok((decoder, width, height))
}

fn orientation(decoder: &Decoder<'_>) -> Orientation {
    let orientation = decoder.exif().and_then(|exif| Orientation::from_exif_chunk(exif));
    orientation.unwrap_or(Orientation::NoTransforms)
}

/// Decodes a file. The orientation is returned beside the picture.
pub fn decode(bytes: &[u8]) -> Result<(DynamicImage, Orientation)> {
    let (mut decoder, width, height) = read(bytes)?;
    let pixels = decoder.decode().place(DAMAGED)?;
    let image = RgbImage::from_raw(width, height, pixels)
        .ok_or_else(|| Error::new("it is damaged: it has fewer pixels than its size says"))?;
    Ok((image.into(), orientation(&decoder)))
}

/// Decodes a file into a frame, if it is one of its size that needs no more; whether it was.
pub fn decode_into(bytes: &[u8], into: &mut FrameMut<'_>) -> Result<bool> {
    let (mut decoder, width, height) = read(bytes)?;
    let size = (width as usize, height as usize);
    if size != (into.width(), into.height()) || orientation(&decoder) != Orientation::NoTransforms {
        return Ok(false);
    }
    let length = decoder.output_buffer_size();
    match into.contiguous_mut() {
        Some(pixels) if length == Some(pixels.len()) => {
            decoder.decode_into(pixels).place(DAMAGED)?;
            Ok(true)
        }
        _ => Ok(false),
    }
}
