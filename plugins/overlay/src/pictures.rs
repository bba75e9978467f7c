//! Clips made of pictures: animated GIF, PNG and WebP, still pictures, and folders of pictures.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, DynamicImage, ImageDecoder, ImageError, ImageFormat, Limits};
use pdk_image::{LARGEST_FILE, LONGEST, check_size, most_pixels};
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use pdk_video::Input;

use crate::file;
use crate::frames::Frames;
use crate::picture::{Layout, Picture};

/// Pictures a second if nothing says how many: in a folder, or in a clip whose pictures have no duration.
const RATE: f64 = 30.0;
/// The endings of the pictures in a folder.
pub const PICTURES: [&str; 6] = ["png", "jpg", "jpeg", "bmp", "webp", "gif"];

/// An animation, or a still picture as an animation of one frame.
pub struct Animation {
    frames: image::Frames<'static>,
    /// Seconds that the frames read so far are shown.
    seconds: f64,
}

impl Animation {
    /// Opens a picture file.
    ///
    /// # Errors
    /// If it is damaged or too large.
    pub fn open(mut input: Box<dyn Input>, format: ImageFormat) -> Result<Self> {
        input.rewind()?;
        let mut input = BufReader::new(input);
        let frames = match format {
            ImageFormat::Gif => limited(GifDecoder::new(input).map_err(damaged)?)?.into_frames(),
            ImageFormat::WebP if is_moving(&mut input)? => {
                limited(WebPDecoder::new(input).map_err(damaged)?)?.into_frames()
            }
            ImageFormat::Png => {
                let bytes = whole(input)?;
                let pictures = Cursor::new(pdk_image::without_texts(&bytes)?);
                let decoder = limited(PngDecoder::new(pictures).map_err(damaged)?)?;
                match decoder.is_apng().map_err(damaged)? {
                    true => {
                        pdk_image::check_animation(&bytes)?;
                        decoder.apng().map_err(damaged)?.into_frames()
                    }
                    false => once(pdk_image::decode(&bytes)?),
                }
            }
            _ => once(pdk_image::decode(&whole(input)?)?),
        };
        Ok(Self { frames, seconds: 0.0 })
    }
}

/// Whether a WebP file is an animation. The input is where it was.
fn is_moving<R: BufRead + Seek>(input: &mut R) -> Result<bool> {
    let moving = WebPDecoder::new(&mut *input).map_err(damaged)?.has_animation();
    input.rewind()?;
    Ok(moving)
}

/// The content of a file, which is not read if it is too large.
fn whole(mut input: impl Read + Seek) -> Result<Vec<u8>> {
    let length = input.seek(SeekFrom::End(0))?;
    if length > LARGEST_FILE {
        return Err(Error::new(format!(
            "it has more than {} MiB, and the file of a still picture may not have; scale it down",
            LARGEST_FILE >> 20
        )));
    }
    input.rewind()?;
    let mut bytes = Vec::with_capacity(length as usize);
    // It may grow meanwhile.
    input.take(LARGEST_FILE).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn once(image: DynamicImage) -> image::Frames<'static> {
    image::Frames::new(Box::new(std::iter::once(Ok(image::Frame::new(image.into_rgba8())))))
}

/// Does not believe a picture that says it is as large as the world.
fn limited<D: ImageDecoder>(mut decoder: D) -> Result<D> {
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    decoder.set_limits(limits()?).map_err(damaged)?;
    Ok(decoder)
}

/// What decoding may take.
fn limits() -> Result<Limits> {
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LONGEST), Some(LONGEST));
    // The largest picture, four times: as it is decoded, as it was before, as it is laid over that, and 16 bits instead of 8.
    limits.max_alloc = Some(4 * 4 * most_pixels()? as u64);
    Ok(limits)
}

fn damaged(error: ImageError) -> Error {
    match error {
        ImageError::Limits(_) => Error::new(
            "its pictures are too large: decoding them takes more memory than pictures may; scale it down",
        ),
        error => Error::new(format!("it is damaged or cut off ({error}); copy it again")),
    }
}

impl Frames for Animation {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        let Some(frame) = self.frames.next() else { return Ok(false) };
        let frame = frame.map_err(damaged)?;
        let (numerator, denominator) = frame.delay().numer_denom_ms();
        let milliseconds = f64::from(numerator) / f64::from(denominator.max(1));
        // Browsers too take very short durations for "not given".
        self.seconds += if milliseconds < 1.0 { 1.0 / RATE } else { milliseconds / 1000.0 };
        take(frame.into_buffer(), into);
        Ok(true)
    }

    fn end(&self) -> f64 {
        self.seconds
    }
}

/// The pictures of a folder, by name.
pub struct Folder {
    files: VecDeque<PathBuf>,
    /// Pictures that were read.
    count: u64,
}

impl Folder {
    /// Opens a folder.
    ///
    /// # Errors
    /// If it cannot be read, or has no pictures.
    pub fn open(folder: &Path) -> Result<Self> {
        Ok(Self { files: Self::files(folder)?.into(), count: 0 })
    }

    /// The picture files of a folder, in the order of their names.
    ///
    /// # Errors
    /// If the folder cannot be read, or has no pictures.
    pub fn files(folder: &Path) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if PICTURES.contains(&ending.as_str()) {
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
        let Some(path) = self.files.pop_front() else { return Ok(false) };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let decode = || {
            let (mut input, _) = file::open(&path)?;
            let mut head = [0; 12];
            let read = (&mut input).take(12).read(&mut head)?;
            match image::guess_format(&head[..read]) {
                // Its first picture.
                Ok(ImageFormat::Gif) => {
                    input.rewind()?;
                    DynamicImage::from_decoder(limited(
                        GifDecoder::new(BufReader::new(input)).map_err(damaged)?,
                    )?)
                    .map_err(damaged)
                }
                _ => {
                    input.rewind()?;
                    pdk_image::decode(&whole(input)?)
                }
            }
        };
        let image = decode().place(format!("its picture `{name}`"))?;
        take(image.into_rgba8(), into);
        self.count += 1;
        Ok(true)
    }

    fn end(&self) -> f64 {
        self.count as f64 / RATE
    }
}

fn take(image: image::RgbaImage, into: &mut Picture) {
    (into.width, into.height) = (image.width() as usize, image.height() as usize);
    into.layout = Layout::Rgba;
    into.data = image.into_raw();
}
