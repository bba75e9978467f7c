//! Reads and writes image files.

use std::path::Path;

use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::{Frame, FrameBuf};

/// Reads an image of any supported format as 8-bit RGB.
///
/// # Errors
/// Where the file cannot be read, is damaged or is no image.
pub fn read(path: &Path) -> Result<FrameBuf> {
    let bytes = std::fs::read(path).place(format_args!("cannot read the image {}", path.display()))?;
    decode(&bytes).place(format_args!("cannot read the image {}", path.display()))
}

fn decode(bytes: &[u8]) -> Result<FrameBuf> {
    let format = image::guess_format(bytes)
        .map_err(|_| Error::new("it is no image of a known format (JPEG, PNG, BMP, WebP)"))?;
    // The JPEG decoder fills what is missing with grey; a picture that was cut off has no end marker.
    if format == image::ImageFormat::Jpeg && !ends_with_marker(bytes) {
        return Err(Error::new("the JPEG is cut off: its end marker is missing"));
    }
    let image = image::load_from_memory_with_format(bytes, format).map_err(|e| Error::new(e.to_string()))?.into_rgb8();
    let (width, height) = (image.width() as usize, image.height() as usize);
    Ok(FrameBuf::from_vec(image.into_raw(), width, height)?)
}

/// Whether a JPEG has its end marker; some cameras pad the file behind it.
fn ends_with_marker(bytes: &[u8]) -> bool {
    let tail = &bytes[bytes.len().saturating_sub(64)..];
    tail.windows(2).any(|pair| pair == [0xff, 0xd9])
}

/// Writes an image; the ending of the name says the format.
///
/// # Errors
/// Where the ending is unknown or the file cannot be written.
pub fn write(path: &Path, frame: Frame<'_>) -> Result<()> {
    let place = || format!("cannot write the image {}", path.display());
    let format = image::ImageFormat::from_path(path)
        .map_err(|_| Error::new(format!("{}: its name has to end in .png, .jpg, .bmp or .webp", place())))?;
    let pixels = frame.to_buf().into_vec();
    let image = image::RgbImage::from_raw(frame.width() as u32, frame.height() as u32, pixels)
        .ok_or_else(|| Error::new(place()))?;
    let mut encoded = std::io::Cursor::new(Vec::new());
    image.write_to(&mut encoded, format).place(place())?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).place(place())?;
    }
    std::fs::write(path, encoded.into_inner()).place(place())
}
