//! From a frame to the numbers that a model expects.

use pdk_sdk::ops::color::grey;
use pdk_sdk::prelude::*;

use crate::model_file::{ImageInput, Layout};

/// How the pixels of a frame become a model's input.
pub struct Pixels {
    layout: Layout,
    channels: usize,
    /// Which of red, green and blue comes first, second and third.
    order: [usize; 3],
    /// The number for each of the 256 pixel values.
    scale: [f32; 256],
}

impl Pixels {
    /// The range of the numbers, by the names that the parameter `scale` takes.
    pub const SCALES: [&str; 3] = ["0..255", "0..1", "-1..1"];

    /// The conversion for a model's input. `scale` is one of [`Self::SCALES`]; `color` is `rgb` or `bgr`.
    pub fn new(input: &ImageInput, scale: &str, color: &str) -> Self {
        let number = |value: usize| match scale {
            "0..1" => value as f32 / 255.0,
            "-1..1" => value as f32 / 127.5 - 1.0,
            _ => value as f32,
        };
        Self {
            layout: input.layout,
            channels: input.channels,
            order: if color == "bgr" { [2, 1, 0] } else { [0, 1, 2] },
            scale: std::array::from_fn(number),
        }
    }

    /// The least and the greatest of the numbers.
    pub fn range(&self) -> (f32, f32) {
        (self.scale[0], self.scale[255])
    }

    /// Writes the numbers of `frame`, which has the size of the model's input, into `values`.
    pub fn write(&self, frame: Frame<'_>, values: &mut [f32]) {
        let width = frame.width();
        let rows = frame.rows().enumerate();
        match (self.channels, self.layout) {
            (1, _) => {
                for (y, row) in rows {
                    for (value, pixel) in values[y * width..].iter_mut().zip(row.chunks_exact(3)) {
                        *value = self.scale[usize::from(grey(pixel[0], pixel[1], pixel[2]))];
                    }
                }
            }
            (_, Layout::Nhwc) => {
                for (y, row) in rows {
                    let values = values[y * width * 3..].chunks_exact_mut(3);
                    for (value, pixel) in values.zip(row.chunks_exact(3)) {
                        for (value, channel) in value.iter_mut().zip(self.order) {
                            *value = self.scale[usize::from(pixel[channel])];
                        }
                    }
                }
            }
            (_, Layout::Nchw) => {
                let plane = width * frame.height();
                for (y, row) in rows {
                    for (values, channel) in values.chunks_exact_mut(plane).zip(self.order) {
                        for (value, pixel) in values[y * width..].iter_mut().zip(row.chunks_exact(3)) {
                            *value = self.scale[usize::from(pixel[channel])];
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of two pixels with a gap between the rows: 10 11 12, 20 21 22; 30 31 32, 40 41 42.
    const BYTES: [u8; 14] = [10, 11, 12, 20, 21, 22, 99, 99, 30, 31, 32, 40, 41, 42];

    fn numbers(layout: Layout, channels: usize, scale: &str, color: &str) -> Vec<f32> {
        let input = ImageInput { layout, channels, height: 2, width: 2 };
        let frame = Frame::with_stride(&BYTES, 2, 2, 8).unwrap();
        let mut values = vec![f32::NAN; input.len()];
        Pixels::new(&input, scale, color).write(frame, &mut values);
        values
    }

    #[test]
    fn planes_follow_each_other_or_channels_do() {
        let planes = [10, 20, 30, 40, 11, 21, 31, 41, 12, 22, 32, 42].map(|v| v as f32);
        assert_eq!(numbers(Layout::Nchw, 3, "0..255", "rgb"), planes);
        let pixels = [12, 11, 10, 22, 21, 20, 32, 31, 30, 42, 41, 40].map(|v| v as f32);
        assert_eq!(numbers(Layout::Nhwc, 3, "0..255", "bgr"), pixels);
    }

    #[test]
    fn one_channel_is_the_luma() {
        assert_eq!(numbers(Layout::Nchw, 1, "0..255", "rgb"), [11.0, 21.0, 31.0, 41.0]);
        assert_eq!(numbers(Layout::Nhwc, 1, "0..255", "bgr"), [11.0, 21.0, 31.0, 41.0]);
    }

    #[test]
    fn scales_reach_both_ends_of_their_range() {
        let input = ImageInput { layout: Layout::Nhwc, channels: 3, height: 1, width: 1 };
        let mut values = [0.0; 3];
        for (scale, expected) in
            [("0..255", [0.0, 51.0, 255.0]), ("0..1", [0.0, 0.2, 1.0]), ("-1..1", [-1.0, -0.6, 1.0])]
        {
            Pixels::new(&input, scale, "rgb").write(Frame::new(&[0, 51, 255], 1, 1).unwrap(), &mut values);
            assert!(
                values.iter().zip(expected).all(|(v, e): (&f32, f32)| (v - e).abs() < 1e-6),
                "{scale}: {values:?}"
            );
        }
    }
}
