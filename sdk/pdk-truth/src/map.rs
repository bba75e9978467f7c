//! Outputs of a network that have something for each place of the picture.

use pdk_sdk::error::{Error, ErrorKind, Result};

/// The values of an output as a map: rows by columns, each place with its channels.
pub struct Map<'a> {
    values: &'a [f32],
    pub width: usize,
    pub height: usize,
    channels: usize,
    /// Whether the channels of a place lie side by side.
    channels_last: bool,
}

impl<'a> Map<'a> {
    /// The output of this shape as a map of one channel, or of this many. Axes of length 1 in front do not count.
    ///
    /// # Errors
    /// If it has another shape.
    pub fn new(shape: &[usize], values: &'a [f32], channels: usize) -> Result<Self> {
        let map =
            |height, width, channels, channels_last| Self { values, width, height, channels, channels_last };
        let skipped = shape.iter().take_while(|side| **side == 1).count();
        // Of a map with a single row, that is an axis of length 1 as well.
        let fits = (0..=skipped).rev().find_map(|skipped| match &shape[skipped..] {
            [count, height, width] if *count == channels => Some(map(*height, *width, channels, false)),
            [height, width, count] if *count == channels => Some(map(*height, *width, channels, true)),
            [height, width] => Some(map(*height, *width, 1, false)),
            _ => None,
        });
        let full = |map: &Self| map.width * map.height * map.channels == values.len() && !values.is_empty();
        fits.filter(full).ok_or_else(|| {
            Error::of(
                ErrorKind::Nonsense,
                format!(
                    "its output has the shape {shape:?}, but has to have a number for each place (height, width){}",
                    match channels {
                        1 => String::new(),
                        _ => format!(
                            ", or {channels} for each place ({channels}, height, width or height, width, {channels})"
                        ),
                    }
                ),
            )
        })
    }

    /// How many numbers each place has.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// A number of a place.
    pub fn at(&self, x: usize, y: usize, channel: usize) -> f32 {
        let place = y * self.width + x;
        self.values[match self.channels_last {
            true => place * self.channels + channel,
            false => channel * self.width * self.height + place,
        }]
    }
}

/// For each place of a side of `length`, the nearest place of a side of `of`: the one in which its centre lies.
pub fn nearest(length: usize, of: usize) -> Vec<usize> {
    (0..length).map(|at| ((2 * at + 1) * of / (2 * length)).min(of - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_have_their_channels_first_or_last() {
        let values: Vec<f32> = (0..12).map(|n| n as f32).collect();
        let first = Map::new(&[1, 3, 2, 2], &values, 3).unwrap();
        assert_eq!((first.at(1, 0, 2), first.at(0, 1, 0)), (9.0, 2.0));
        let last = Map::new(&[1, 2, 2, 3], &values, 3).unwrap();
        assert_eq!((last.at(1, 0, 2), last.at(0, 1, 0)), (5.0, 6.0));
        let plain = Map::new(&[1, 1, 3, 4], &values, 3).unwrap();
        assert_eq!((plain.channels(), plain.width, plain.at(3, 1, 0)), (1, 4, 7.0));
        assert_eq!(Map::new(&[1, 12], &values, 1).unwrap().width, 12);
        for shape in [&[12][..], &[5, 2, 2], &[3, 3]] {
            assert!(Map::new(shape, &values, 3).is_err(), "{shape:?}");
        }
    }

    #[test]
    fn the_nearest_place_is_the_one_around_a_centre() {
        assert_eq!(nearest(4, 2), [0, 0, 1, 1]);
        assert_eq!(nearest(2, 6), [1, 4]);
        assert_eq!(nearest(3, 3), [0, 1, 2]);
    }
}
