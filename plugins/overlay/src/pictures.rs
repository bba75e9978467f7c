//! Clips made of pictures: animated GIF, PNG and WebP, still pictures, and folders of pictures.

use std::collections::VecDeque;
use std::io::{BufReader, SeekFrom};
use std::path::{Path, PathBuf};

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, DynamicImage, ImageFormat, ImageReader};
use pdk_sdk::prelude::*;
use pdk_video::Input;

use crate::clip::Frames;
use crate::picture::{Layout, Picture};

/// Pictures a second where nothing says how many: in a folder, or in a clip whose pictures have no duration.
const RATE: f64 = 30.0;

/// An animation, or a still picture as an animation of one frame.
pub struct Animation {
    frames: image::Frames<'static>,
    count: u64,
    /// Seconds that the frames read so far are shown.
    seconds: f64,
}

impl Animation {
    /// Opens a picture file.
    ///
    /// # Errors
    /// Where it is damaged.
    pub fn open(mut input: Box<dyn Input>, format: ImageFormat) -> Result<Self> {
        input.seek(SeekFrom::Start(0))?;
        let input = BufReader::new(input);
        let frames = match format {
            ImageFormat::Gif => GifDecoder::new(input).map_err(damaged)?.into_frames(),
            ImageFormat::WebP => {
                let decoder = WebPDecoder::new(input).map_err(damaged)?;
                match decoder.has_animation() {
                    true => decoder.into_frames(),
                    false => still(DynamicImage::from_decoder(decoder).map_err(damaged)?),
                }
            }
            ImageFormat::Png => {
                let decoder = PngDecoder::new(input).map_err(damaged)?;
                match decoder.is_apng().map_err(damaged)? {
                    true => decoder.apng().map_err(damaged)?.into_frames(),
                    false => still(DynamicImage::from_decoder(decoder).map_err(damaged)?),
                }
            }
            format => still(ImageReader::with_format(input, format).decode().map_err(damaged)?),
        };
        Ok(Self { frames, count: 0, seconds: 0.0 })
    }
}

fn still(image: DynamicImage) -> image::Frames<'static> {
    image::Frames::new(Box::new(std::iter::once(Ok(image::Frame::new(image.into_rgba8())))))
}

fn damaged(error: image::ImageError) -> Error {
    Error::new(format!("it is damaged or cut off ({error}); copy it again"))
}

impl Frames for Animation {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        let Some(frame) = self.frames.next() else { return Ok(false) };
        let frame = frame.map_err(damaged)?;
        let (numerator, denominator) = frame.delay().numer_denom_ms();
        let milliseconds = f64::from(numerator) / f64::from(denominator.max(1));
        // Browsers too take very short durations for "not given".
        self.seconds += if milliseconds < 1.0 { 1.0 / RATE } else { milliseconds / 1000.0 };
        self.count += 1;
        take(frame.into_buffer(), into);
        Ok(true)
    }

    fn rate(&self) -> f64 {
        if self.count == 0 { RATE } else { self.count as f64 / self.seconds }
    }
}

/// The pictures of a folder, by name.
pub struct Folder {
    files: VecDeque<PathBuf>,
}

impl Folder {
    /// Opens a folder.
    ///
    /// # Errors
    /// Where it cannot be read, or has no pictures.
    pub fn open(folder: &Path) -> Result<Self> {
        Ok(Self { files: Self::files(folder)?.into() })
    }

    /// The picture files of a folder, in the order of their names.
    ///
    /// # Errors
    /// Where the folder cannot be read, or has no pictures.
    pub fn files(folder: &Path) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if ["png", "jpg", "jpeg", "bmp", "webp", "gif"].contains(&ending.as_str()) {
                files.push(path);
            }
        }
        files.sort();
        match files.is_empty() {
            true => Err(Error::new("the folder has no pictures (PNG, JPEG, BMP, WebP or GIF)")),
            false => Ok(files),
        }
    }
}

impl Frames for Folder {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        let Some(file) = self.files.pop_front() else { return Ok(false) };
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let image = ImageReader::open(&file)
            .and_then(ImageReader::with_guessed_format)
            .map_err(|error| Error::from(error).at(format!("its picture `{name}`")))?
            .decode()
            .map_err(|error| damaged(error).at(format!("its picture `{name}`")))?;
        take(image.into_rgba8(), into);
        Ok(true)
    }

    fn rate(&self) -> f64 {
        RATE
    }
}

fn take(image: image::RgbaImage, into: &mut Picture) {
    (into.width, into.height) = (image.width() as usize, image.height() as usize);
    into.layout = Layout::Rgba;
    into.data = image.into_raw();
}
