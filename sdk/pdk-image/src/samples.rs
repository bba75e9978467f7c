//! PNG files as the numbers that they hold, which stand for something else than light: classes of a mask, distances.

use ::png::{BitDepth, ColorType, Encoder, Info, Transformations};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::png::{DAMAGED, check_still, read_with};

/// The numbers of a PNG file.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers of a pixel. One with a palette has one, its place in the palette.
    pub channels: usize,
    /// The numbers of each pixel, row by row, as the file has them: none is scaled.
    pub values: Vec<u16>,
    info: Info<'static>,
}

/// Reads a PNG file.
///
/// # Errors
/// If it is none, is damaged, an animation or too large.
pub fn read(bytes: &[u8]) -> Result<Samples> {
    let (mut reader, length) = read_with(bytes, Transformations::IDENTITY)?;
    check_still(&reader)?;
    let mut packed = vec![0; length];
    let frame = reader.next_frame(&mut packed).place(DAMAGED)?;
    reader.finish().place(DAMAGED)?;
    let source = reader.info();
    let mut info = Info::with_size(source.width, source.height);
    (info.color_type, info.bit_depth) = (source.color_type, source.bit_depth);
    info.palette = source.palette.as_ref().map(|palette| palette.to_vec().into());
    info.trns = source.trns.as_ref().map(|trns| trns.to_vec().into());
    if info.color_type == ColorType::Indexed && info.palette.is_none() {
        return Err(Error::new("it is damaged: it has no palette"));
    }
    let (width, height) = (info.width as usize, info.height as usize);
    let channels = info.color_type.samples();
    let bits = info.bit_depth as usize;
    let rows = packed[..frame.buffer_size()].chunks_exact(frame.line_size.max(1));
    let values = match info.bit_depth {
        BitDepth::Sixteen => rows
            .flatten()
            .copied()
            .collect::<Vec<u8>>()
            .chunks_exact(2)
            .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
            .collect(),
        BitDepth::Eight => rows.flatten().map(|byte| u16::from(*byte)).collect(),
        // Several numbers in a byte, the first in its highest bits.
        _ => rows
            .flat_map(|row| {
                let number =
                    move |at: usize| row[at * bits / 8] >> (8 - bits - at * bits % 8) & ((1 << bits) - 1);
                (0..width * channels).map(move |at| u16::from(number(at)))
            })
            .collect(),
    };
    Ok(Samples { width, height, channels, values, info })
}

impl Samples {
    /// The largest number that the file can hold.
    pub fn most(&self) -> u16 {
        match self.info.bit_depth {
            BitDepth::Sixteen => u16::MAX,
            depth => (1 << depth as u8) - 1,
        }
    }

    /// Writes a file of the same form with other numbers. Of a number that is too large the lowest bits are kept.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn write(&self, values: &[u16]) -> Result<Vec<u8>> {
        let bits = self.info.bit_depth as usize;
        let packed: Vec<u8> = match self.info.bit_depth {
            BitDepth::Sixteen => values.iter().flat_map(|value| value.to_be_bytes()).collect(),
            BitDepth::Eight => values.iter().map(|value| *value as u8).collect(),
            _ => values
                .chunks_exact((self.width * self.channels).max(1))
                .flat_map(|row| {
                    row.chunks(8 / bits).map(|values| {
                        let place = |(at, value): (usize, &u16)| {
                            (*value as u8 & ((1 << bits) - 1)) << (8 - bits - at * bits)
                        };
                        values.iter().enumerate().map(place).fold(0, |byte, value| byte | value)
                    })
                })
                .collect(),
        };
        const FAILED: &str = "cannot write a PNG file";
        let mut file = Vec::new();
        let mut writer =
            Encoder::with_info(&mut file, self.info.clone()).place(FAILED)?.write_header().place(FAILED)?;
        writer.write_image_data(&packed).place(FAILED)?;
        writer.finish().place(FAILED)?;
        Ok(file)
    }

    /// Whether its numbers are places in a palette.
    pub fn has_palette(&self) -> bool {
        self.info.color_type == ColorType::Indexed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_depth_survives() {
        for (color, depth, channels) in [
            (ColorType::Grayscale, BitDepth::One, 1),
            (ColorType::Indexed, BitDepth::Two, 1),
            (ColorType::Indexed, BitDepth::Four, 1),
            (ColorType::Grayscale, BitDepth::Eight, 1),
            (ColorType::Grayscale, BitDepth::Sixteen, 1),
            (ColorType::Rgb, BitDepth::Eight, 3),
            (ColorType::Rgb, BitDepth::Sixteen, 3),
        ] {
            let mut info = Info::with_size(11, 3);
            (info.color_type, info.bit_depth) = (color, depth);
            info.palette = (color == ColorType::Indexed).then(|| vec![7; 48].into());
            let made = Samples { width: 11, height: 3, channels, values: Vec::new(), info };
            let values: Vec<u16> =
                (0..33 * channels).map(|at| (at * 3701 % 65_536) as u16 & made.most()).collect();
            let again = read(&made.write(&values).unwrap()).unwrap();
            assert_eq!((again.width, again.height, again.channels), (11, 3, channels), "{color:?} {depth:?}");
            assert_eq!(again.values, values, "{color:?} {depth:?}");
            assert_eq!(again.has_palette(), color == ColorType::Indexed);
        }
    }

    #[test]
    fn what_is_damaged_is_refused() {
        let info = Info::with_size(4, 4);
        let made = Samples { width: 4, height: 4, channels: 1, values: Vec::new(), info };
        let file = made.write(&[1; 16]).unwrap();
        assert!(read(&file).is_ok());
        for cut in [0, 8, 30, file.len() - 14] {
            assert!(read(&file[..cut]).is_err(), "{cut}");
        }
        let mut turned = file;
        let middle = turned.len() - 20;
        turned[middle] ^= 1;
        assert!(read(&turned).is_err());
    }
}
