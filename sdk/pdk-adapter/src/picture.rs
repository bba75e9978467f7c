//! Pictures that come as raw pixels, or encoded as JPEG or PNG.

use std::fmt::Display;

use pdk_sdk::prelude::{Error, ErrorKind, FrameMut, Result};

/// The order in which a simulator sends the colours of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Red, green, blue.
    Rgb,
    /// Red, green, blue, and one that does not count.
    Rgba,
    /// Blue, green, red, and one that does not count.
    Bgra,
}

impl Order {
    /// Bytes of a pixel.
    fn bytes(self) -> usize {
        match self {
            Self::Rgb => 3,
            Self::Rgba | Self::Bgra => 4,
        }
    }
}

/// The latest picture of a camera, kept until the loop asks for it.
#[derive(Debug, Clone)]
pub struct Picture {
    width: usize,
    height: usize,
    /// Red, green and blue, row by row.
    pixels: Vec<u8>,
}

impl Picture {
    /// A black picture of this size in pixels.
    pub fn new(width: u32, height: u32) -> Self {
        let (width, height) = (width as usize, height as usize);
        Self { width, height, pixels: vec![0; 3 * width * height] }
    }

    /// The number of bytes that a picture of this size has on the wire.
    pub fn sent(&self, order: Order) -> usize {
        order.bytes() * self.width * self.height
    }

    /// Takes the pixels of the next picture, row by row: as many bytes as [`Picture::sent`] says. Missing pixels stay as they were.
    pub fn take(&mut self, sent: &[u8], order: Order) {
        for (pixel, rgb) in sent.chunks_exact(order.bytes()).zip(self.pixels.chunks_exact_mut(3)) {
            rgb.copy_from_slice(&match order {
                Order::Rgb | Order::Rgba => [pixel[0], pixel[1], pixel[2]],
                Order::Bgra => [pixel[2], pixel[1], pixel[0]],
            });
        }
    }

    /// Red, green and blue, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// Writes it to a frame of the loop.
    ///
    /// # Errors
    /// If that has another size.
    pub fn write(&self, mut into: FrameMut<'_>) -> Result<()> {
        if (into.width(), into.height()) != (self.width, self.height) {
            return Err(Error::new(format!(
                "it was given a {}x{} frame, but its camera delivers {}x{}",
                into.width(),
                into.height(),
                self.width,
                self.height
            )));
        }
        for (row, pixels) in into.rows_mut().zip(self.pixels.chunks_exact(3 * self.width)) {
            row.copy_from_slice(pixels);
        }
        Ok(())
    }
}

/// Decodes a picture of the simulator `peer` into a frame of the loop.
///
/// # Errors
/// If it cannot be decoded, or has another size than the frame.
pub fn decode(encoded: &[u8], peer: impl Display, mut into: FrameMut<'_>) -> Result<()> {
    match pdk_image::decode_into(encoded, into.reborrow()) {
        Ok(size) if size == (into.width(), into.height()) => Ok(()),
        Ok((width, height)) => Err(Error::of(
            ErrorKind::Configuration,
            format!("{peer} sends pictures of {width}x{height}; set width={width} and height={height}"),
        )),
        Err(error) => Err(Error::of(
            ErrorKind::Nonsense,
            format!("{peer} sends a picture that cannot be used: {error}"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::FrameBuf;

    use super::*;

    #[test]
    fn colours_come_in_both_orders_and_frames_have_their_size() {
        let mut picture = Picture::new(2, 1);
        assert_eq!([Order::Rgb, Order::Rgba].map(|order| picture.sent(order)), [6, 8]);
        let mut frame = FrameBuf::new(2, 1);
        for (order, expected) in [(Order::Rgba, [1, 2, 3, 4, 5, 6]), (Order::Bgra, [3, 2, 1, 6, 5, 4])] {
            picture.take(&[1, 2, 3, 255, 4, 5, 6, 255], order);
            picture.write(frame.as_mut()).unwrap();
            assert_eq!(frame.data(), expected);
        }
        picture.take(&[7, 8, 9, 10, 11, 12], Order::Rgb);
        picture.write(frame.as_mut()).unwrap();
        assert_eq!(frame.data(), [7, 8, 9, 10, 11, 12]);
        let error = picture.write(FrameBuf::new(1, 2).as_mut()).unwrap_err();
        assert_eq!(error.message(), "it was given a 1x2 frame, but its camera delivers 2x1");
    }
}
