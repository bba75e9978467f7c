//! What a camera of CARLA sees.

use pdk_adapter::{Deadline, Station};
use pdk_sdk::prelude::{Error, ErrorKind, FrameMut, Result};

use crate::stream::{HEADER, Stream, Token};

/// What comes before the pixels.
const BEFORE: usize = 12;

/// A camera's stream, and its latest frame.
#[derive(Debug)]
pub struct Camera {
    stream: Stream,
    width: u32,
    height: u32,
    /// Red, green and blue of the latest frame.
    pixels: Vec<u8>,
}

impl Camera {
    /// Subscribes to the stream of a camera with frames of this size.
    ///
    /// # Errors
    /// Where the stream cannot be had.
    pub fn subscribe(
        station: &mut Station,
        token: Token,
        [width, height]: [u32; 2],
        deadline: &Deadline,
    ) -> Result<Self> {
        let count = width as usize * height as usize;
        let size = HEADER + BEFORE + 4 * count;
        let stream = Stream::subscribe(station, token, "a camera frame", (size, size), deadline)?;
        Ok(Self { stream, width, height, pixels: vec![0; 3 * count] })
    }

    /// Its stream.
    pub fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    /// Waits for the frame of this number.
    ///
    /// # Errors
    /// Where it does not come, is missing, or is of another size.
    pub fn look(&mut self, frame: u64, deadline: &Deadline) -> Result<()> {
        loop {
            let (header, body) = self.stream.next(deadline)?;
            if header.frame < frame {
                continue;
            }
            let number = |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]);
            let size = [number(0), number(4)];
            if header.frame > frame || size != [self.width, self.height] {
                return Err(Error::of(
                    ErrorKind::Nonsense,
                    format!(
                        "the camera sends frame {} with {}x{} pixels, but frame {frame} with {}x{} was expected; does another client of CARLA \
                         step the same server?",
                        header.frame, size[0], size[1], self.width, self.height
                    ),
                ));
            }
            for (bgra, rgb) in body[BEFORE..].chunks_exact(4).zip(self.pixels.chunks_exact_mut(3)) {
                rgb.copy_from_slice(&[bgra[2], bgra[1], bgra[0]]);
            }
            return Ok(());
        }
    }

    /// Writes the latest frame.
    ///
    /// # Errors
    /// Where it is of another size.
    pub fn write(&self, mut into: FrameMut<'_>) -> Result<()> {
        let (width, height) = (into.width(), into.height());
        if [width, height] != [self.width as usize, self.height as usize] {
            return Err(Error::new(format!(
                "it was given a {width}x{height} frame, but its camera delivers {}x{}",
                self.width, self.height
            )));
        }
        for (row, pixels) in into.rows_mut().zip(self.pixels.chunks_exact(3 * width)) {
            row.copy_from_slice(pixels);
        }
        Ok(())
    }
}
