//! Pictures as they are sent.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use pdk_sdk::prelude::FrameBuf;

/// A frame as PNG or JPEG, in base64.
pub fn encode(frame: &FrameBuf, png: bool) -> String {
    let (width, height) = (frame.width() as u32, frame.height() as u32);
    let mut bytes = Vec::new();
    if png {
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub)
            .write_image(frame.data(), width, height, ExtendedColorType::Rgb8)
            .unwrap();
    } else {
        JpegEncoder::new_with_quality(&mut bytes, 75)
            .encode(frame.data(), width, height, ExtendedColorType::Rgb8)
            .unwrap();
    }
    STANDARD.encode(bytes)
}
