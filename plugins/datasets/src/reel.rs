//! A video among several of a recording: the one that was read last stays open, since opening and seeking cost the most.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_video::{Video, Yuv420};

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
            return Err(Error::new("the video ends before this frame; it is damaged, so copy it again"));
        }
        self.open = Some((path.to_owned(), video));
        let mut rgb = FrameBuf::new(self.picture.width, self.picture.height);
        self.picture.to_rgb(rgb.as_mut());
        Ok(rgb)
    }
}
