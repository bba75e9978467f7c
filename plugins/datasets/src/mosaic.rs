//! Pictures of sensors with a colour filter before each pixel (Bayer), as RGB.
//!
//! Each pixel keeps the colour that it has. The two others are the mean of its neighbours that have them, among the eight around it, which is
//! bilinear interpolation. At the edges of the picture fewer neighbours are left.

use pdk_sdk::prelude::*;

/// Which colours the pixels of a picture have.
pub struct Mosaic {
    /// The column and the row of red in each square of 2 x 2 pixels; blue is opposite, and the other two are green.
    red: [usize; 2],
}

impl Mosaic {
    /// The order that ROS calls so; none if it is another encoding.
    pub fn of(encoding: &str) -> Option<Self> {
        let red = match encoding {
            "bayer_rggb8" => [0, 0],
            "bayer_grbg8" => [1, 0],
            "bayer_gbrg8" => [0, 1],
            "bayer_bggr8" => [1, 1],
            _ => return None,
        };
        Some(Self { red })
    }

    /// The colour of a pixel: 0 for red, 1 for green, 2 for blue.
    fn colour(&self, x: usize, y: usize) -> usize {
        usize::from((x + self.red[0]) % 2 == 1) + usize::from((y + self.red[1]) % 2 == 1)
    }

    /// What the sensor has of a row of a picture.
    pub fn pick(&self, y: usize, row: &[u8], into: &mut [u8]) {
        for (x, (out, pixel)) in into.iter_mut().zip(row.chunks_exact(3)).enumerate() {
            *out = pixel[self.colour(x, y)];
        }
    }

    /// The picture, whose rows begin every `step` bytes; it has at least two pixels on each side.
    pub fn frame(&self, data: &[u8], width: usize, height: usize, step: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(width, height);
        let mut into = frame.as_mut();
        for y in 0..height {
            let row = into.row_mut(y);
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let (mut sums, mut counts) = ([0_u32; 3], [0_u32; 3]);
                for near_y in y.saturating_sub(1)..(y + 2).min(height) {
                    for near_x in x.saturating_sub(1)..(x + 2).min(width) {
                        let colour = self.colour(near_x, near_y);
                        sums[colour] += u32::from(data[near_y * step + near_x]);
                        counts[colour] += 1;
                    }
                }
                let own = self.colour(x, y);
                (sums[own], counts[own]) = (u32::from(data[y * step + x]), 1);
                for ((channel, sum), count) in pixel.iter_mut().zip(sums).zip(counts) {
                    *channel = ((sum + count / 2) / count) as u8;
                }
            }
        }
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pixels that a sensor has of a picture in which each channel is a plane.
    fn sensor(order: &str, size: usize, at: impl Fn(usize, usize) -> [u8; 3]) -> Vec<u8> {
        let mosaic = Mosaic::of(order).unwrap();
        (0..size * size).map(|i| at(i % size, i / size)[mosaic.colour(i % size, i / size)]).collect()
    }

    #[test]
    fn every_order_gives_back_a_picture_that_changes_evenly() {
        let plane = |x: usize, y: usize| {
            [(10 + 4 * x + 6 * y) as u8, (200 - 2 * x - 4 * y) as u8, (30 + 8 * x) as u8]
        };
        for order in ["bayer_rggb8", "bayer_grbg8", "bayer_gbrg8", "bayer_bggr8"] {
            let data = sensor(order, 8, plane);
            let frame = Mosaic::of(order).unwrap().frame(&data, 8, 8, 8);
            // Within the picture, the mean of neighbours of a plane is the plane.
            for (x, y) in (1..7).flat_map(|x| (1..7).map(move |y| (x, y))) {
                assert_eq!(frame.data()[3 * (8 * y + x)..][..3], plane(x, y), "{order} {x} {y}");
            }
        }
        assert!(Mosaic::of("rgb8").is_none() && Mosaic::of("bayer_rggb16").is_none());
    }

    #[test]
    fn the_first_letters_are_the_first_row() {
        let flat = |_: usize, _: usize| [1, 2, 3];
        assert_eq!(sensor("bayer_rggb8", 2, flat), [1, 2, 2, 3]);
        assert_eq!(sensor("bayer_grbg8", 2, flat), [2, 1, 3, 2]);
        assert_eq!(sensor("bayer_gbrg8", 2, flat), [2, 3, 1, 2]);
        assert_eq!(sensor("bayer_bggr8", 2, flat), [3, 2, 2, 1]);
    }
}
