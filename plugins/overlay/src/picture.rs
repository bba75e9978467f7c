//! Decoded frames of a clip, and the samples that keying works on.

/// How the bytes of a [`Picture`] are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    /// Red, green, blue and alpha of each pixel.
    #[default]
    Rgba,
    /// All luma, then blue and red chroma at half the width and height, rounded up; values as video has them (luma 16 to
    /// 235, chroma about 128).
    Yuv420,
}

/// One frame as its decoder delivers it.
#[derive(Debug, Clone, Default)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub layout: Layout,
    pub data: Vec<u8>,
}

impl Picture {
    /// Takes a size and a layout, and makes room for the bytes.
    pub fn reset(&mut self, width: usize, height: usize, layout: Layout) {
        (self.width, self.height, self.layout) = (width, height, layout);
        let len = match layout {
            Layout::Rgba => width * height * 4,
            Layout::Yuv420 => width * height + 2 * width.div_ceil(2) * height.div_ceil(2),
        };
        self.data.resize(len, 0);
    }

    /// Takes red, green, blue and alpha from four planes of the picture's size: luma, blue and red chroma as video has them, and alpha.
    pub fn fill_from_planes(&mut self, planes: &[u8]) {
        let size = self.width * self.height;
        let value = |plane: usize, at: usize, offset: f32| f32::from(planes[plane * size + at]) - offset;
        for (at, pixel) in self.data.chunks_exact_mut(4).enumerate() {
            let colour = rgb([value(0, at, 16.0), value(1, at, 128.0), value(2, at, 128.0)]);
            pixel
                .iter_mut()
                .zip(colour)
                .for_each(|(out, value)| *out = (value.clamp(0.0, 255.0) + 0.5) as u8);
            pixel[3] = planes[3 * size + at];
        }
    }

    /// Whether some pixel is not opaque.
    pub fn has_transparency(&self) -> bool {
        self.layout == Layout::Rgba && self.data.chunks_exact(4).any(|pixel| pixel[3] != 255)
    }

    /// Luma, blue chroma and red chroma of a picture in [`Layout::Yuv420`].
    #[cfg(test)]
    pub fn planes_mut(&mut self) -> [&mut [u8]; 3] {
        let chroma = self.width.div_ceil(2) * self.height.div_ceil(2);
        let (luma, rest) = self.data.split_at_mut(self.width * self.height);
        let (blue, red) = rest.split_at_mut(chroma);
        [luma, blue, red]
    }
}

/// The weights of red and blue in luma: ITU-R BT.601. Videos that name another matrix or full range are brought to it when they are read;
/// those that name none are taken for it at any size, as the published tool's decoder does.
const RED: f32 = 0.299;
const BLUE: f32 = 0.114;

/// Luma, blue and red chroma of a colour, each without its offset.
pub fn luma_and_chroma([r, g, b]: [f32; 3]) -> [f32; 3] {
    let luma = RED * r + (1.0 - RED - BLUE) * g + BLUE * b;
    [
        luma * (219.0 / 255.0),
        (b - luma) * (112.0 / 255.0) / (1.0 - BLUE),
        (r - luma) * (112.0 / 255.0) / (1.0 - RED),
    ]
}

/// The reverse of [`luma_and_chroma`].
#[inline]
pub fn rgb([luma, blue, red]: [f32; 3]) -> [f32; 3] {
    let luma = luma * (255.0 / 219.0);
    let r = luma + red * (255.0 / 112.0) * (1.0 - RED);
    let b = luma + blue * (255.0 / 112.0) * (1.0 - BLUE);
    let g = (luma - RED * r - BLUE * b) / (1.0 - RED - BLUE);
    [r, g, b]
}

/// Luma and chroma of every pixel, in three planes of the same size.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    pub width: usize,
    pub height: usize,
    pub luma: Vec<u8>,
    pub blue: Vec<u8>,
    pub red: Vec<u8>,
    column: [Vec<u16>; 2],
}

impl Samples {
    /// Takes the samples of a picture. With `halve`, video comes out at half the width and height, which is the size of
    /// its chroma.
    pub fn fill(&mut self, picture: &Picture, halve: bool) {
        match (picture.layout, halve) {
            (Layout::Rgba, _) => self.fill_from_rgba(picture),
            (Layout::Yuv420, true) if picture.width >= 2 && picture.height >= 2 => self.fill_halved(picture),
            (Layout::Yuv420, _) => self.fill_enlarged(picture),
        }
    }

    /// Mixes each sample with its neighbours: chroma over five, luma over three in each direction. It takes the pattern out of dithered
    /// colours.
    pub fn smooth(&mut self) {
        let (width, height) = (self.width, self.height);
        for plane in [&mut self.blue, &mut self.red] {
            blur(plane, (width, height), &[1, 4, 6, 4, 1]);
        }
        blur(&mut self.luma, (width, height), &[1, 2, 1]);
    }

    fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        for plane in [&mut self.luma, &mut self.blue, &mut self.red] {
            plane.resize(width * height, 0);
        }
    }

    fn fill_from_rgba(&mut self, picture: &Picture) {
        self.resize(picture.width, picture.height);
        for (i, pixel) in picture.data.chunks_exact(4).enumerate() {
            let [luma, blue, red] =
                luma_and_chroma([f32::from(pixel[0]), f32::from(pixel[1]), f32::from(pixel[2])]);
            self.luma[i] = (luma + 16.5) as u8;
            self.blue[i] = (blue + 128.5) as u8;
            self.red[i] = (red + 128.5) as u8;
        }
    }

    /// Each block of four luma values becomes their mean.
    fn fill_halved(&mut self, picture: &Picture) {
        let (wide, chroma_width) = (picture.width, picture.width.div_ceil(2));
        let (width, height) = (picture.width / 2, picture.height / 2);
        self.resize(width, height);
        let (luma, chroma) = picture.data.split_at(wide * picture.height);
        let (blue, red) = chroma.split_at(chroma.len() / 2);
        for y in 0..height {
            let (upper, lower) = (&luma[2 * y * wide..][..wide], &luma[(2 * y + 1) * wide..][..wide]);
            let blocks = upper.chunks_exact(2).zip(lower.chunks_exact(2));
            for (out, (a, b)) in self.luma[y * width..][..width].iter_mut().zip(blocks) {
                let sum = u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]);
                *out = ((sum + 2) >> 2) as u8;
            }
            let row = y * chroma_width..y * chroma_width + width;
            self.blue[y * width..][..width].copy_from_slice(&blue[row.clone()]);
            self.red[y * width..][..width].copy_from_slice(&red[row]);
        }
    }

    /// Chroma is interpolated to the size of luma. Its samples lie on the even columns, halfway between two rows, which is
    /// what H.264 means if it says nothing.
    fn fill_enlarged(&mut self, picture: &Picture) {
        let (width, height) = (picture.width, picture.height);
        let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
        self.resize(width, height);
        let (luma, chroma) = picture.data.split_at(width * height);
        self.luma.copy_from_slice(luma);
        let (blue, red) = chroma.split_at(chroma_width * chroma_height);
        for (plane, (from, column)) in
            [&mut self.blue, &mut self.red].into_iter().zip([blue, red].into_iter().zip(&mut self.column))
        {
            column.resize(chroma_width, 0);
            for y in 0..height {
                let near = y / 2;
                let far = if y % 2 == 0 { near.saturating_sub(1) } else { (near + 1).min(chroma_height - 1) };
                let (near, far) = (&from[near * chroma_width..], &from[far * chroma_width..]);
                for ((out, &near), &far) in column.iter_mut().zip(near).zip(far) {
                    *out = 3 * u16::from(near) + u16::from(far);
                }
                for (x, out) in plane[y * width..][..width].iter_mut().enumerate() {
                    let (left, right) = (column[x / 2], column[(x.div_ceil(2)).min(chroma_width - 1)]);
                    *out = ((left + right + 4) >> 3) as u8;
                }
            }
        }
    }
}

/// Blurs a plane with these weights in both directions. Its border is repeated outside of it.
fn blur(plane: &mut [u8], (width, height): (usize, usize), weights: &[u16]) {
    let (middle, sum) = ((weights.len() / 2) as isize, u32::from(weights.iter().sum::<u16>()));
    let mixed = |size: usize, at: usize, value: &dyn Fn(usize) -> u8| {
        let place = |ahead: isize| (at as isize + ahead).clamp(0, size as isize - 1) as usize;
        let total: u32 = (-middle..)
            .zip(weights)
            .map(|(ahead, weight)| u32::from(*weight) * u32::from(value(place(ahead))))
            .sum();
        ((total + sum / 2) / sum) as u8
    };
    let before = plane.to_vec();
    for (row, from) in plane.chunks_exact_mut(width).zip(before.chunks_exact(width)) {
        row.iter_mut().enumerate().for_each(|(x, out)| *out = mixed(width, x, &|x| from[x]));
    }
    let before = plane.to_vec();
    for (y, row) in plane.chunks_exact_mut(width).enumerate() {
        row.iter_mut().enumerate().for_each(|(x, out)| *out = mixed(height, y, &|y| before[y * width + x]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture in one colour, given as luma and chroma with offsets.
    fn flat(width: usize, height: usize, values: [u8; 3]) -> Picture {
        let mut picture = Picture::default();
        picture.reset(width, height, Layout::Yuv420);
        for (plane, value) in picture.planes_mut().into_iter().zip(values) {
            plane.fill(value);
        }
        picture
    }

    #[test]
    fn a_flat_picture_of_any_size_stays_flat() {
        for (width, height) in [(1, 1), (2, 1), (3, 5), (8, 6), (7, 720)] {
            for halve in [false, true] {
                let mut samples = Samples::default();
                samples.fill(&flat(width, height, [90, 60, 200]), halve);
                assert!(samples.width * samples.height > 0);
                assert!(samples.luma.iter().all(|&v| v == 90), "{width}x{height}");
                assert!(samples.blue.iter().all(|&v| v == 60), "{width}x{height}");
                assert!(samples.red.iter().all(|&v| v == 200), "{width}x{height}");
            }
        }
    }

    #[test]
    fn colours_survive_the_trip_through_luma_and_chroma() {
        for colour in [[0.0, 255.0, 0.0], [255.0; 3], [66.0, 193.0, 5.0]] {
            let back = rgb(luma_and_chroma(colour));
            assert!(colour.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-3), "{colour:?} {back:?}");
        }
        // ITU-R BT.601: pure green.
        let [luma, blue, red] = luma_and_chroma([0.0, 255.0, 0.0]);
        assert_eq!([luma + 16.0, blue + 128.0, red + 128.0].map(|v| v.round()), [145.0, 54.0, 34.0]);
    }

    #[test]
    fn chroma_is_interpolated_between_its_samples() {
        let mut picture = flat(4, 2, [16, 0, 128]);
        picture.planes_mut()[1].copy_from_slice(&[100, 200]);
        let mut samples = Samples::default();
        samples.fill(&picture, false);
        assert_eq!(samples.blue[..4], [100, 150, 200, 200]);
    }
}
