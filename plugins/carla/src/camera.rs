//! What a camera of CARLA sees.

use pdk_adapter::picture::Order;
use pdk_adapter::{Deadline, Picture, Station};
use pdk_sdk::prelude::{Error, ErrorKind, FrameMut, Result};

use crate::stream::{HEADER, Stream, Token};

/// What comes before the pixels.
const BEFORE: usize = 12;

/// A camera's stream, and its latest frame.
#[derive(Debug)]
pub struct Camera {
    stream: Stream,
    size: [u32; 2],
    picture: Picture,
}

impl Camera {
    /// Subscribes to the stream of a camera with frames of this size.
    ///
    /// # Errors
    /// If the stream cannot be had.
    pub fn subscribe(
        station: &mut Station,
        token: Token,
        [width, height]: [u32; 2],
        deadline: &Deadline,
    ) -> Result<Self> {
        let picture = Picture::new(width, height);
        let size = HEADER + BEFORE + picture.sent(Order::Bgra);
        let stream = Stream::subscribe(station, token, "a camera frame", (size, size), deadline)?;
        Ok(Self { stream, size: [width, height], picture })
    }

    /// Its stream.
    pub fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    /// Waits for the frame of this number.
    ///
    /// # Errors
    /// If it does not come, is missing, or is of another size.
    pub fn look(&mut self, frame: u64, deadline: &Deadline) -> Result<()> {
        loop {
            let (header, body) = self.stream.next(deadline)?;
            if header.frame < frame {
                continue;
            }
            let number = |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]);
            let size = [number(0), number(4)];
            if header.frame > frame || size != self.size {
                return Err(Error::of(
                    ErrorKind::Nonsense,
                    format!(
                        "the camera sends frame {} with {}x{} pixels, but frame {frame} with {}x{} was expected; does another client of CARLA \
                         step the same server?",
                        header.frame, size[0], size[1], self.size[0], self.size[1]
                    ),
                ));
            }
            self.picture.take(&body[BEFORE..], Order::Bgra);
            return Ok(());
        }
    }

    /// Red, green and blue of the latest frame, row by row.
    pub fn pixels(&self) -> &[u8] {
        self.picture.pixels()
    }

    /// Writes the latest frame.
    ///
    /// # Errors
    /// If it is of another size.
    pub fn write(&self, into: FrameMut<'_>) -> Result<()> {
        self.picture.write(into)
    }
}
