//! A video among several of a recording: the one that was read last stays open, since opening and seeking cost the most. And videos that are written again.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_video::{Video, Yuv420};

/// Writes a video again; `number` says which frame of the recording each of the video is. With `keys` that many frames lie between two that
/// can be decoded alone, if the codec is left to ffmpeg.
///
/// # Errors
/// If the video cannot be read, perturbed or written.
pub fn rewrite(
    video: &mut Video,
    into: &Path,
    keys: Option<u32>,
    number: &dyn Fn(u32) -> usize,
    perturb: &mut Perturb<'_>,
) -> Result<()> {
    let recoding = video.recoding()?;
    let (mut planes, mut perturbed, mut recoder) = (Yuv420::default(), FrameBuf::default(), None);
    video.seek(0)?;
    for frame in 0..video.count() {
        if !video.next(&mut planes)? {
            return Err(ends_before());
        }
        let (width, height) = (planes.width, planes.height);
        let mut picture = FrameBuf::new(width, height);
        planes.to_rgb(picture.as_mut());
        perturbed.resize(width, height);
        perturb(number(frame), picture.as_ref(), perturbed.as_mut())?;
        let recoder = match &mut recoder {
            Some(recoder) => recoder,
            none => none.insert(recoding.begin(into, [width, height], video.times(), keys)?),
        };
        recoder.push(perturbed.as_ref())?;
    }
    recoder.ok_or_else(ends_before)?.finish()
}

fn ends_before() -> Error {
    Error::new("the video ends before this frame; it is damaged, so copy it again")
}

/// The video that was read last.
#[derive(Default)]
pub struct Reel {
    open: Option<(PathBuf, Video)>,
    picture: Yuv420,
}

impl Reel {
    /// Reads the frame of a video that `which` names. `open` opens the video if it is not open.
    ///
    /// # Errors
    /// If the video cannot be opened, or ends before that frame.
    pub fn read(
        &mut self,
        path: &Path,
        open: impl FnOnce() -> Result<Video>,
        which: impl FnOnce(&Video) -> Result<u32>,
    ) -> Result<FrameBuf> {
        let (_, mut video) = match self.open.take() {
            Some((kept, video)) if kept == path => (kept, video),
            _ => (path.to_owned(), open()?),
        };
        video.seek(which(&video)?)?;
        if !video.next(&mut self.picture)? {
            return Err(ends_before());
        }
        self.open = Some((path.to_owned(), video));
        let mut rgb = FrameBuf::new(self.picture.width, self.picture.height);
        self.picture.to_rgb(rgb.as_mut());
        Ok(rgb)
    }
}
