//! A clip as the user gives it: a video, an animated or still picture, or a folder of pictures.

use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_video::{Container, Ffmpeg, Input, Opened, Reader, Yuv420};

use crate::file;
use crate::frames::Frames;
use crate::picture::{Layout, Picture};
use crate::pictures::{Animation, Folder};

/// The frames of an H.264 video.
struct Video {
    reader: Box<Reader>,
    frame: Yuv420,
    /// Frames that were read.
    count: u32,
}

impl Frames for Video {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        if !self.reader.next(&mut self.frame)? {
            return Ok(false);
        }
        self.count += 1;
        // The screen is looked for, and colours are mixed, in planes of this coding.
        self.frame.to_bt601();
        // The planes are laid out as the picture has them, so the memory is exchanged.
        (into.width, into.height, into.layout) = (self.frame.width, self.frame.height, Layout::Yuv420);
        std::mem::swap(&mut into.data, &mut self.frame.data);
        Ok(true)
    }

    fn end(&self) -> f64 {
        self.reader.time(self.count)
    }
}

/// The frames of a video that ffmpeg decodes, at a fixed rate.
struct Decoded {
    ffmpeg: Ffmpeg,
    frame: Yuv420,
    /// The planes of a frame with alpha.
    planes: Vec<u8>,
}

impl Frames for Decoded {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        if self.ffmpeg.has_alpha() {
            if !self.ffmpeg.next_with_alpha(&mut self.planes)? {
                return Ok(false);
            }
            let (width, height) = self.ffmpeg.size();
            into.reset(width, height, Layout::Rgba);
            into.fill_from_planes(&self.planes);
            return Ok(true);
        }
        if !self.ffmpeg.next(&mut self.frame)? {
            return Ok(false);
        }
        (into.width, into.height, into.layout) = (self.frame.width, self.frame.height, Layout::Yuv420);
        std::mem::swap(&mut into.data, &mut self.frame.data);
        Ok(true)
    }

    fn end(&self) -> f64 {
        self.ffmpeg.end()
    }
}

/// Where a clip comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Clip {
    /// A file or a folder.
    Path(PathBuf),
    /// A clip that is part of the plugin, with its name.
    BuiltIn(&'static str, &'static [u8]),
}

/// What the first bytes of a file say that it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Content {
    Video(Container),
    Picture(image::ImageFormat),
    Text,
    Unknown,
}

impl Clip {
    /// The clip's content as a hash: of a file its bytes, of a folder the names and bytes of its files.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn hash(&self) -> Result<blake3::Hash> {
        let mut hasher = blake3::Hasher::new();
        match self {
            Self::BuiltIn(_, bytes) => {
                hasher.update(bytes);
            }
            Self::Path(path) if path.is_dir() => {
                for picture in Folder::files(path)? {
                    let name = picture.file_name().unwrap_or_default();
                    hasher.update(name.as_encoded_bytes());
                    hasher.update(&[0]);
                    let place = || format!("its picture `{}`", name.display());
                    hasher.update_reader(file::open(&picture).map_err(|error| error.at(place()))?.0)?;
                }
            }
            Self::Path(path) => {
                hasher.update_reader(file::open(path)?.0)?;
            }
        }
        Ok(hasher.finalize())
    }

    /// Opens the clip to read its frames. With `few`, some frames are left out where that saves time: what is left is
    /// enough to find the screen.
    ///
    /// # Errors
    /// If it is nothing that can be decoded here.
    pub fn open(&self, few: bool) -> Result<Box<dyn Frames>> {
        let (input, head, size): (Box<dyn Input>, Vec<u8>, u64) = match self {
            Self::BuiltIn(_, bytes) => {
                (Box::new(Cursor::new(*bytes)), bytes[..bytes.len().min(4096)].to_vec(), bytes.len() as u64)
            }
            Self::Path(path) if path.is_dir() => return Ok(Box::new(Folder::open(path)?)),
            Self::Path(path) => {
                let (mut file, size) = file::open(path)?;
                let mut head = Vec::new();
                (&mut file).take(4096).read_to_end(&mut head)?;
                file.rewind()?;
                (Box::new(BufReader::new(file)), head, size)
            }
        };
        match content(&head) {
            Content::Video(Container::Mp4) => match Reader::open(input, size, few)? {
                Opened::Frames(reader) => Ok(Box::new(Video { reader, frame: Yuv420::default(), count: 0 })),
                Opened::OtherCodec(codec) => self.through_ffmpeg(&codec),
            },
            Content::Picture(format) => Ok(Box::new(Animation::open(input, format)?)),
            Content::Video(Container::Other(name)) => self.through_ffmpeg(name),
            Content::Unknown if !head.is_empty() => self.through_ffmpeg("of an unknown kind"),
            Content::Unknown => Err(Error::new("the file is empty")),
            Content::Text => Err(Error::new("it is a text file, not a video, whatever its name says")),
        }
    }

    fn through_ffmpeg(&self, codec: &str) -> Result<Box<dyn Frames>> {
        let Self::Path(path) = self else { return Err(Error::new(format!("it is {codec}"))) };
        let ffmpeg = Ffmpeg::start_with_alpha(Path::new("ffmpeg"), path, codec)?;
        Ok(Box::new(Decoded { ffmpeg, frame: Yuv420::default(), planes: Vec::new() }))
    }
}

impl std::fmt::Display for Clip {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Path(path) => write!(f, "clip `{}`", path.display()),
            Self::BuiltIn(name, _) => write!(f, "built-in clip `{name}`"),
        }
    }
}

fn content(head: &[u8]) -> Content {
    use image::ImageFormat::{Gif, Png, WebP};
    if let Some(container) = pdk_video::container(head) {
        return Content::Video(container);
    }
    match image::guess_format(head) {
        Ok(format @ (Gif | Png | WebP | image::ImageFormat::Jpeg | image::ImageFormat::Bmp)) => {
            Content::Picture(format)
        }
        _ if is_text(head) => Content::Text,
        _ => Content::Unknown,
    }
}

/// Whether bytes are printable text as far as they go.
fn is_text(head: &[u8]) -> bool {
    // A character may be cut in two at the end.
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default()
        }
        Err(_) => return false,
    };
    !text.is_empty() && text.chars().all(|c| !c.is_control() || matches!(c, '\n' | '\r' | '\t'))
}

/// Decodes the first of the frames that `few` leaves, at most `most`.
///
/// # Errors
/// If the clip is damaged, or has no frames.
pub fn some_pictures(clip: &Clip, most: usize) -> Result<Vec<Picture>> {
    let mut frames = clip.open(true)?;
    let mut pictures = Vec::new();
    let mut picture = Picture::default();
    while pictures.len() < most && frames.next(&mut picture)? {
        pictures.push(picture.clone());
    }
    if pictures.is_empty() { Err(Error::new("it has no frames")) } else { Ok(pictures) }
}
