//! Pictures without compression, as cameras of robots give them, as RGB.

use pdk_image::check_size;
use pdk_sdk::ops::yuv;
use pdk_sdk::prelude::*;

use crate::mosaic::Mosaic;

/// A picture without compression.
pub struct Raw<'a> {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// How the pixels are stored, as ROS calls it.
    pub encoding: &'a str,
    /// Bytes from one row to the next.
    pub step: u32,
    /// The pixels.
    pub data: &'a [u8],
}

impl Raw<'_> {
    /// The picture as RGB.
    ///
    /// # Errors
    /// If it is too large, is stored in another way, or has too few bytes.
    pub fn to_frame(&self) -> Result<FrameBuf> {
        let stored = self.stored()?;
        let (width, height, step) = (self.width as usize, self.height as usize, self.step as usize);
        let layout = match stored {
            Stored::Mosaic(mosaic) => return Ok(mosaic.frame(self.data, width, height, step)),
            Stored::Layout(layout) => layout,
        };
        let mut frame = FrameBuf::new(width, height);
        let mut into = frame.as_mut();
        for (y, from) in self.data.chunks(step).take(height).enumerate() {
            layout.convert(&from[..width * layout.bytes()], into.row_mut(y));
        }
        Ok(frame)
    }

    /// The pixels of another picture of the same size, stored as those of this one: with its gaps between rows, and its alpha.
    ///
    /// # Errors
    /// As [`to_frame`](Self::to_frame), and if the frame has another size.
    pub fn with_picture(&self, frame: Frame<'_>) -> Result<Vec<u8>> {
        let stored = self.stored()?;
        let (width, height, step) = (self.width as usize, self.height as usize, self.step as usize);
        if (frame.width(), frame.height()) != (width, height) {
            return Err(Error::new("the perturbed picture has another size"));
        }
        let mut data = self.data.to_vec();
        for (y, into) in data.chunks_mut(step).take(height).enumerate() {
            match &stored {
                Stored::Mosaic(mosaic) => mosaic.pick(y, frame.row(y), &mut into[..width]),
                Stored::Layout(layout) => layout.store(frame.row(y), &mut into[..width * layout.bytes()]),
            }
        }
        Ok(data)
    }

    /// How the pixels are stored, as many as there have to be.
    fn stored(&self) -> Result<Stored> {
        check_size(self.width, self.height)?;
        if self.width == 0 || self.height == 0 {
            return Err(Error::new("it has no pixels"));
        }
        let (width, height, step) = (self.width as usize, self.height as usize, self.step as usize);
        let encoding = self.encoding.to_ascii_lowercase();
        if let Some(mosaic) = Mosaic::of(&encoding) {
            let fits =
                width > 1 && height > 1 && step >= width && self.data.len() >= step * (height - 1) + width;
            return if fits { Ok(Stored::Mosaic(mosaic)) } else { Err(self.does_not_fit()) };
        }
        let layout = Layout::of(&encoding).ok_or_else(|| {
            Error::new(format!(
                "its pixels are stored as `{}`, and rgb8, bgr8, rgba8, bgra8, mono8, 8UC1, 8UC3, yuv422, yuv422_yuy2 and the four of Bayer with 8 bits, such as bayer_rggb8, are read; \
                 convert the topic",
                self.encoding
            ))
        })?;
        let row = width * layout.bytes();
        let enough = step >= row && self.data.len() >= step * (height - 1) + row;
        if !enough || (layout.is_yuv() && width % 2 == 1) {
            return Err(self.does_not_fit());
        }
        Ok(Stored::Layout(layout))
    }

    fn does_not_fit(&self) -> Error {
        let Self { width, height, encoding, step, data } = self;
        Error::new(format!(
            "it is {width} x {height} in `{encoding}` with {step} bytes a row, and has {} bytes, which does not fit; record it again",
            data.len()
        ))
    }
}

/// How pixels are stored.
enum Stored {
    /// Each has one colour.
    Mosaic(Mosaic),
    /// Each has all.
    Layout(Layout),
}

/// Where the channels of a pixel lie.
enum Layout {
    /// Bytes a pixel, and the places of red, green and blue among them.
    Colours(usize, [usize; 3]),
    /// Two pixels in four bytes: the places of their lumas, and of blue and red chroma.
    Yuv422([usize; 2], [usize; 2]),
}

impl Layout {
    fn of(encoding: &str) -> Option<Self> {
        Some(match encoding {
            "rgb8" => Self::Colours(3, [0, 1, 2]),
            "bgr8" | "8uc3" => Self::Colours(3, [2, 1, 0]),
            "rgba8" => Self::Colours(4, [0, 1, 2]),
            "bgra8" | "8uc4" => Self::Colours(4, [2, 1, 0]),
            "mono8" | "8uc1" => Self::Colours(1, [0, 0, 0]),
            "yuv422" | "uyvy" => Self::Yuv422([1, 3], [0, 2]),
            "yuv422_yuy2" | "yuyv" => Self::Yuv422([0, 2], [1, 3]),
            _ => return None,
        })
    }

    fn bytes(&self) -> usize {
        match self {
            Self::Colours(bytes, _) => *bytes,
            Self::Yuv422(..) => 2,
        }
    }

    fn is_yuv(&self) -> bool {
        matches!(self, Self::Yuv422(..))
    }

    /// Stores a row of RGB; what is not a colour stays.
    fn store(&self, from: &[u8], into: &mut [u8]) {
        match self {
            Self::Colours(1, _) => {
                for (out, pixel) in into.iter_mut().zip(from.chunks_exact(3)) {
                    *out = luma([pixel[0], pixel[1], pixel[2]]);
                }
            }
            Self::Colours(bytes, places) => {
                for (out, pixel) in into.chunks_exact_mut(*bytes).zip(from.chunks_exact(3)) {
                    for (place, value) in places.iter().zip(pixel) {
                        out[*place] = *value;
                    }
                }
            }
            Self::Yuv422(lumas, chroma) => {
                for (pair, pixels) in into.chunks_exact_mut(4).zip(from.chunks_exact(6)) {
                    let [first, second] =
                        [0, 3].map(|at| yuv::components([pixels[at], pixels[at + 1], pixels[at + 2]]));
                    for (place, value) in lumas.iter().zip([first[0], second[0]]) {
                        pair[*place] = value;
                    }
                    for (place, channel) in chroma.iter().zip([1, 2]) {
                        pair[*place] = first[channel].midpoint(second[channel]);
                    }
                }
            }
        }
    }

    fn convert(&self, from: &[u8], into: &mut [u8]) {
        match self {
            Self::Colours(bytes, places) => {
                for (pixel, out) in from.chunks_exact(*bytes).zip(into.chunks_exact_mut(3)) {
                    out.copy_from_slice(&places.map(|place| pixel[place]));
                }
            }
            Self::Yuv422(lumas, chroma) => {
                for (pair, out) in from.chunks_exact(4).zip(into.chunks_exact_mut(6)) {
                    let [blue, red] = chroma.map(|place| pair[place]);
                    let colours = lumas.map(|place| yuv::colour(pair[place], blue, red));
                    out.copy_from_slice(colours.as_flattened());
                }
            }
        }
    }
}

/// The brightness of a pixel as ITU-R BT.601 weighs its channels; that of grey is its value.
fn luma([red, green, blue]: [u8; 3]) -> u8 {
    ((299 * u32::from(red) + 587 * u32::from(green) + 114 * u32::from(blue) + 500) / 1000) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_stored_as_the_one_before_it() {
        for (encoding, bytes) in [
            ("rgb8", 3),
            ("bgr8", 3),
            ("8UC3", 3),
            ("rgba8", 4),
            ("bgra8", 4),
            ("mono8", 1),
            ("yuv422", 2),
            ("yuv422_yuy2", 2),
            ("bayer_rggb8", 1),
            ("bayer_gbrg8", 1),
        ] {
            // With a gap behind each row.
            let (width, step) = (4_u32, 4 * bytes + 3);
            let data: Vec<u8> = (0..2 * step).map(|i| (60 + i * 5 % 130) as u8).collect();
            let raw = Raw { width, height: 2, encoding, step, data: &data };
            let own = raw.to_frame().unwrap();
            let same = raw.with_picture(own.as_ref()).unwrap();
            if encoding.starts_with("yuv") {
                let again = Raw { data: &same, ..raw }.to_frame().unwrap();
                let most = own.data().iter().zip(again.data()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                assert!(most <= 40, "{encoding}: {most}");
            } else {
                assert_eq!(same, data, "{encoding}");
            }
            let grey = FrameBuf::from_vec(vec![77; 4 * 2 * 3], 4, 2).unwrap();
            let stored = raw.with_picture(grey.as_ref()).unwrap();
            let again = Raw { data: &stored, ..raw }.to_frame().unwrap();
            assert!(again.data().iter().all(|value| value.abs_diff(77) <= 1), "{encoding}");
            let row = (width * bytes) as usize;
            assert_eq!(
                (stored.len(), &stored[row..row + 3]),
                (data.len(), &data[row..row + 3]),
                "{encoding}"
            );
            assert!(raw.with_picture(FrameBuf::new(2, 2).as_ref()).is_err());
        }
    }

    fn pixels(encoding: &str, width: u32, data: &[u8]) -> Result<Vec<u8>> {
        let step = data.len() as u32;
        Raw { width, height: 1, encoding, step, data }.to_frame().map(|frame| frame.data().to_vec())
    }

    #[test]
    fn every_order_of_channels_becomes_rgb() {
        assert_eq!(pixels("rgb8", 1, &[1, 2, 3]).unwrap(), [1, 2, 3]);
        assert_eq!(pixels("bgr8", 1, &[1, 2, 3]).unwrap(), [3, 2, 1]);
        assert_eq!(pixels("8UC3", 1, &[1, 2, 3]).unwrap(), [3, 2, 1]);
        assert_eq!(pixels("rgba8", 1, &[1, 2, 3, 4]).unwrap(), [1, 2, 3]);
        assert_eq!(pixels("bgra8", 1, &[1, 2, 3, 4]).unwrap(), [3, 2, 1]);
        assert_eq!(pixels("mono8", 2, &[7, 8]).unwrap(), [7, 7, 7, 8, 8, 8]);
        // White and black without chroma.
        assert_eq!(pixels("yuv422", 2, &[128, 235, 128, 16]).unwrap(), [255, 255, 255, 0, 0, 0]);
        assert_eq!(pixels("yuv422_yuy2", 2, &[235, 128, 16, 128]).unwrap(), [255, 255, 255, 0, 0, 0]);
    }

    #[test]
    fn pixels_of_bayer_become_rgb() {
        let data = [10, 20, 0, 30, 40, 0];
        let raw = Raw { width: 2, height: 2, encoding: "bayer_rggb8", step: 3, data: &data };
        assert_eq!(raw.to_frame().unwrap().data(), [10, 25, 40, 10, 20, 40, 10, 30, 40, 10, 25, 40]);
        assert!(Raw { height: 3, ..raw }.to_frame().unwrap_err().message().contains("does not fit"));
        let deep = Raw { encoding: "bayer_rggb16", ..raw }.to_frame().unwrap_err();
        assert!(deep.message().contains("bayer_rggb8, are read"), "{deep}");
    }

    #[test]
    fn rows_may_be_padded_and_what_does_not_fit_is_refused() {
        let data = [1, 2, 3, 9, 4, 5, 6];
        let raw = Raw { width: 1, height: 2, encoding: "rgb8", step: 4, data: &data };
        assert_eq!(raw.to_frame().unwrap().data(), [1, 2, 3, 4, 5, 6]);
        let error = |raw: Raw<'_>| raw.to_frame().unwrap_err().to_string();
        assert!(error(Raw { height: 3, ..raw }).contains("does not fit"));
        assert!(
            error(Raw { width: 1, height: 2, encoding: "rgb8", step: 2, data: &data })
                .contains("does not fit")
        );
        assert!(
            error(Raw { width: 1, height: 1, encoding: "16UC1", step: 2, data: &data }).contains("`16UC1`")
        );
        assert!(
            error(Raw { width: u32::MAX, height: u32::MAX, encoding: "mono8", step: 1, data: &data })
                .contains("pictures may have")
        );
        assert!(error(Raw { width: 0, height: 1, encoding: "mono8", step: 0, data: &data }).len() > 5);
    }
}
