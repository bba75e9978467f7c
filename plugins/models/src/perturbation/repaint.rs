//! The perturbation `repaint`: any network that makes of an image another one.
//!
//! Networks have an image of their own size. A frame is either brought to that size and back, or cut into tiles of it: these
//! overlap, and where they do, one fades into the next, so that no seams show, though each tile was computed alone.

use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;

use crate::model_file;
use crate::picture::{PictureNetwork, parameters};

/// Repaints frames with a network.
pub struct Repaint {
    network: PictureNetwork,
    channels: usize,
    range: Range,
    /// The place of red, green and blue among the network's channels.
    order: [usize; 3],
    /// The share of a tile by which it reaches into the next; none if the frame is brought to the network's size.
    overlap: Option<f64>,
    painted: FrameBuf,
    tile: FrameBuf,
    sums: Vec<f32>,
    weights: Vec<f32>,
}

/// The range of the numbers that a network gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Range {
    Bytes,
    Unit,
    Signed,
}

impl Range {
    const NAMES: [&str; 4] = ["auto", "0..255", "0..1", "-1..1"];

    /// The range of this name.
    fn named(name: &str) -> Option<Self> {
        match name {
            "0..255" => Some(Self::Bytes),
            "0..1" => Some(Self::Unit),
            "-1..1" => Some(Self::Signed),
            _ => None,
        }
    }

    /// The range that numbers seem to have.
    fn of(values: &[f32]) -> Self {
        let least = values.iter().copied().fold(f32::INFINITY, f32::min);
        let greatest = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        if greatest > 2.0 {
            Self::Bytes
        } else if least < -0.1 {
            Self::Signed
        } else {
            Self::Unit
        }
    }

    /// A number of the network as the value of a pixel.
    fn byte(self, value: f32) -> f32 {
        match self {
            Self::Bytes => value,
            Self::Unit => value * 255.0,
            Self::Signed => (value + 1.0) * 127.5,
        }
        .clamp(0.0, 255.0)
    }
}

impl Component for Repaint {
    fn description() -> Description {
        let description = Description::perturbation("repaint", "Repaints the frame with a network that makes of an image another one")
            .family("generative")
            .alters_geometry()
            .not_default()
            .source("Any image-to-image network, such as those of Zhu et al., CycleGAN, 2017, and Johnson et al., Perceptual Losses, 2016")
            .mathematics("(1 - strength) v + strength G(v)");
        laying(parameters(description).parameter(Parameter::choice(
            "result",
            &Range::NAMES,
            "the range of the numbers that the network gives; auto finds it out from a picture with all colours",
        )))
    }

    fn new(config: &Config) -> Result<Self> {
        Self::of(PictureNetwork::open(config)?, config)
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(model_file::weights(config.text("model")))
    }
}

/// Adds the parameters that say how what a network paints is laid over the frame.
pub fn laying(description: Description) -> Description {
    description
        .parameter(
            Parameter::by_level(
                "strength",
                [0.2, 0.4, 0.6, 0.8, 1.0],
                "how much of the result is the network's",
            )
            .range(0.0, 1.0),
        )
        .parameter(Parameter::choice(
            "fit",
            &["scale", "tile"],
            "scale: the frame is brought to the size of the network's image and the result back; tile: the network sees the frame \
             piece by piece at its own resolution, for frames that are not smaller than its image",
        ))
        .parameter(
            Parameter::number("overlap", 0.25, "the share of a tile by which it reaches into the next")
                .range(0.0, 0.5)
                .only_for("fit", "tile"),
        )
}

impl Perturbation for Repaint {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let [width, height] = self.network.size;
        match self.overlap.filter(|_| [src.width(), src.height()] != [width, height]) {
            Some(_) if src.width() < width || src.height() < height => {
                return Err(Error::new(format!(
                    "the network's image is {width} x {height} pixels, and no tile of that size fits into a frame of {} x {}; leave \
                     `fit=tile` out, or give it larger frames",
                    src.width(),
                    src.height()
                )));
            }
            Some(overlap) => self.paint_tiles(src, overlap)?,
            None => self.paint_whole(src)?,
        }
        let strength = cx.number("strength");
        for y in 0..src.height() {
            let painted = self.painted.as_ref();
            let pairs = src.row(y).iter().zip(painted.row(y));
            for ((from, to), into) in pairs.zip(dst.row_mut(y)) {
                let value = f64::from(*from) + (f64::from(*to) - f64::from(*from)) * strength;
                *into = (value + 0.5) as u8;
            }
        }
        Ok(())
    }
}

impl Repaint {
    /// Repaints with a network.
    ///
    /// # Errors
    /// If its result is not a picture.
    pub fn of(mut network: PictureNetwork, config: &Config) -> Result<Self> {
        let channels = network.channels()?;
        if channels != 1 && channels != 3 {
            return Err(Error::new(format!(
                "its result has {channels} numbers for each pixel, but a picture has 1 or 3; a segmentation network is for the mask \
                 `segmentation`"
            ))
            .at(&network.place));
        }
        let range = match Range::named(config.text("result")) {
            Some(range) => range,
            None => Range::of(network.run(all_colors(network.size).as_ref())?),
        };
        Ok(Self {
            order: if config.text("color") == "bgr" { [2, 1, 0] } else { [0, 1, 2] },
            overlap: (config.text("fit") == "tile").then(|| config.number("overlap")),
            painted: FrameBuf::default(),
            tile: FrameBuf::new(network.size[0], network.size[1]),
            sums: Vec::new(),
            weights: Vec::new(),
            network,
            channels,
            range,
        })
    }

    /// Brings the frame to the network's size, and the result back.
    fn paint_whole(&mut self, src: Frame<'_>) -> Result<()> {
        let [width, height] = self.network.size;
        let values = self.network.run(src)?.to_vec();
        for pixel in 0..width * height {
            let color = self.color(&values, pixel).map(|value| (value + 0.5) as u8);
            self.tile.as_mut().set_pixel(pixel % width, pixel / width, color);
        }
        self.painted.resize(src.width(), src.height());
        if (src.width(), src.height()) == (width, height) {
            self.painted.as_mut().copy_from(self.tile.as_ref());
        } else {
            resize_linear(self.tile.as_ref(), self.painted.as_mut());
        }
        Ok(())
    }

    /// Paints the frame tile by tile.
    fn paint_tiles(&mut self, src: Frame<'_>, overlap: f64) -> Result<()> {
        let [width, height] = self.network.size;
        let frame = [src.width(), src.height()];
        self.sums.clear();
        self.sums.resize(frame[0] * frame[1] * 3, 0.0);
        self.weights.clear();
        self.weights.resize(frame[0] * frame[1], 0.0);
        let fade = [width, height].map(|side| ((side as f64 * overlap).round() as usize).min(side - 1));
        for top in starts(frame[1], height, fade[1]) {
            for left in starts(frame[0], width, fade[0]) {
                for y in 0..height {
                    let from = &src.row(top + y)[left * 3..][..width * 3];
                    self.tile.as_mut().row_mut(y).copy_from_slice(from);
                }
                let values = self.network.run(self.tile.as_ref())?.to_vec();
                for pixel in 0..width * height {
                    let (x, y) = (pixel % width, pixel / width);
                    let weight = ramp(x, width, fade[0]) * ramp(y, height, fade[1]);
                    let at = (top + y) * frame[0] + left + x;
                    self.weights[at] += weight;
                    let color = self.color(&values, pixel);
                    for (sum, value) in self.sums[at * 3..].iter_mut().zip(color) {
                        *sum += value * weight;
                    }
                }
            }
        }
        self.painted.resize(frame[0], frame[1]);
        let mut painted = self.painted.as_mut();
        for y in 0..frame[1] {
            for (x, pixel) in painted.row_mut(y).chunks_exact_mut(3).enumerate() {
                let at = y * frame[0] + x;
                for (channel, value) in pixel.iter_mut().enumerate() {
                    *value = (self.sums[at * 3 + channel] / self.weights[at] + 0.5) as u8;
                }
            }
        }
        Ok(())
    }

    /// The colour of a pixel of the network's result, 0 to 255.
    fn color(&self, values: &[f32], pixel: usize) -> [f32; 3] {
        self.order.map(|channel| {
            let channel = channel.min(self.channels - 1);
            self.range.byte(values[self.network.at(channel, pixel, self.channels)])
        })
    }
}

/// Where tiles begin along an axis: each reaches at least `fade` into the next, and the last one ends with the frame.
fn starts(length: usize, tile: usize, fade: usize) -> Vec<usize> {
    let last = length.saturating_sub(tile);
    let count = last.div_ceil(tile - fade);
    (0..=count).map(|place| (last * place).checked_div(count).unwrap_or(0)).collect()
}

/// How much a tile counts at a place along an axis: less towards its ends, and never nothing.
fn ramp(at: usize, length: usize, fade: usize) -> f32 {
    let inside = at.min(length - 1 - at) + 1;
    (inside as f32 / (fade + 1) as f32).min(1.0)
}

/// A picture with dark and bright pixels of all colours.
fn all_colors([width, height]: [usize; 2]) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    for (x, y) in (0..width * height).map(|at| (at % width, at / width)) {
        let (u, v) = (x * 256 / width, y * 256 / height);
        frame.as_mut().set_pixel(x, y, [u as u8, v as u8, (255 - (u + v) / 2) as u8]);
    }
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradient_tests::engines;
    use pdk_onnx::testing::Sketch;
    use pdk_onnx::{Tensor, model};
    use pdk_sdk::serde_json::{Value, json};
    use pdk_sdk::testing::Trial;
    use tempfile::NamedTempFile;

    /// A network for images of 16 x 12 that swaps red and blue, with numbers from 0 to 1 in and `gain` times that plus `offset` out.
    fn swap(gain: f64, offset: f64) -> NamedTempFile {
        let mut s = Sketch::new(13);
        s.input("image", &[1, 3, 12, 16]);
        let weights = [0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0].map(|weight| weight * gain).to_vec();
        let filter = s.weights("filter", Tensor::floats(&[3, 3, 1, 1], weights));
        let bias = s.weights("bias", Tensor::floats(&[3], vec![offset; 3]));
        s.node("Conv", &["image", &filter, &bias], "painted", &[]);
        let file = NamedTempFile::with_suffix(".onnx").unwrap();
        std::fs::write(file.path(), model::encode(&s.model(&["painted"]))).unwrap();
        file
    }

    fn open(file: &NamedTempFile, mut more: Value, level: f64) -> Result<Trial<Repaint>> {
        more["model"] = file.path().to_str().unwrap().into();
        more["scale"] = "0..1".into();
        Trial::new(&more, level, Key([1; 32]))
    }

    fn painted(file: &NamedTempFile, more: Value, level: f64, frame: &FrameBuf) -> FrameBuf {
        open(file, more, level).unwrap().frame(frame, 0, 0.0).unwrap()
    }

    fn swapped(frame: &FrameBuf) -> FrameBuf {
        let mut swapped = frame.clone();
        for (x, y) in (0..frame.width() * frame.height()).map(|at| (at % frame.width(), at / frame.width())) {
            let [red, green, blue] = frame.as_ref().pixel(x, y);
            swapped.as_mut().set_pixel(x, y, [blue, green, red]);
        }
        swapped
    }

    #[test]
    fn a_picture_is_painted_in_every_range_and_on_every_engine() {
        let frame = all_colors([16, 12]);
        for engine in engines() {
            for (gain, offset) in [(1.0, 0.0), (255.0, 0.0), (2.0, -1.0)] {
                let found = painted(&swap(gain, offset), json!({"engine": engine}), 4.0, &frame);
                let expected = swapped(&frame);
                let close = found.data().iter().zip(expected.data()).all(|(a, b)| a.abs_diff(*b) <= 1);
                assert!(close, "{gain} {offset} on {engine}");
            }
        }
        // The level says how much of it shows.
        let half = painted(&swap(1.0, 0.0), json!({"strength": 0.5}), 0.0, &frame);
        let [red, _, blue] = frame.as_ref().pixel(15, 0).map(u32::from);
        assert!(u32::from(half.as_ref().pixel(15, 0)[0]).abs_diff(u32::midpoint(red, blue)) <= 1);
    }

    #[test]
    fn tiles_leave_no_seams() {
        let frame = all_colors([50, 31]);
        for overlap in [0.0, 0.25, 0.5] {
            let found = painted(&swap(1.0, 0.0), json!({"fit": "tile", "overlap": overlap}), 4.0, &frame);
            let expected = swapped(&frame);
            assert!(found.data().iter().zip(expected.data()).all(|(a, b)| a.abs_diff(*b) <= 1), "{overlap}");
        }
        assert_eq!(starts(50, 16, 4), [0, 11, 22, 34]);
        assert_eq!(starts(16, 16, 4), [0]);
        assert_eq!(starts(17, 16, 0), [0, 1]);
        assert_eq!([0, 1, 3, 8, 15].map(|at| ramp(at, 16, 3)), [0.25, 0.5, 1.0, 1.0, 0.25]);
        for small in [[10, 12], [50, 11]] {
            let tiled = open(&swap(1.0, 0.0), json!({"fit": "tile"}), 4.0).unwrap();
            let error = { tiled }.frame(&all_colors(small), 0, 0.0).err().unwrap().to_string();
            assert!(error.contains("no tile of that size fits"), "{error}");
        }
    }

    #[test]
    fn networks_that_paint_nothing_are_refused() {
        let mut s = Sketch::new(13);
        s.input("image", &[1, 3, 12, 16]);
        let filter = s.weights("filter", Tensor::floats(&[5, 3, 1, 1], vec![0.1; 15]));
        s.node("Conv", &["image", &filter], "classes", &[]);
        s.node("GlobalAveragePool", &["classes"], "means", &[]);
        for (output, part) in
            [("classes", "5 numbers for each pixel"), ("means", "5 numbers, which cannot be a picture")]
        {
            let file = NamedTempFile::with_suffix(".onnx").unwrap();
            std::fs::write(file.path(), model::encode(&s.model(&[output]))).unwrap();
            let error = open(&file, json!({}), 0.0).err().unwrap().to_string();
            assert!(error.contains(part), "{error}");
        }
        let error = Config::check(&Repaint::description(), json!({}).as_object().unwrap());
        assert!(error.unwrap_err().to_string().contains("model"));
    }
}
