//! Brings keyed pictures to the size of the frame: averaged over the area of each pixel where they shrink, linear
//! between pixels where they grow.

/// How a clip is fitted to a frame of another shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fit {
    /// Keeps its shape and fills the frame; what sticks out is cut off at both sides alike.
    Cover,
    /// Keeps its shape and fills the frame, with the horizon of the clip where that of the frame is, both as shares of the height
    /// from the top. The clip is enlarged as far as that takes.
    Horizon { clip: f64, frame: f64 },
    /// Takes the shape of the frame.
    Stretch,
}

/// For each output position: the first input position, and the range of its weights.
#[derive(Debug, Clone, Default)]
struct Taps {
    spans: Vec<(usize, std::ops::Range<usize>)>,
    weights: Vec<f32>,
}

impl Taps {
    /// The input positions `start..start + length`, real numbers within `0..=from`, are spread over `to` outputs.
    fn fill(&mut self, from: usize, start: f64, length: f64, to: usize) {
        self.spans.clear();
        self.weights.clear();
        let step = length / to as f64;
        for i in 0..to {
            let before = self.weights.len();
            let first = if step > 1.0 {
                let (low, high) = (start + i as f64 * step, start + (i + 1) as f64 * step);
                let (first, last) = (low.floor() as usize, (high.ceil() as usize).clamp(1, from));
                let first = first.min(last - 1);
                for pixel in first..last {
                    let inside = high.min(pixel as f64 + 1.0) - low.max(pixel as f64);
                    self.weights.push((inside.max(0.0) / step) as f32);
                }
                first
            } else {
                let centre = (start + (i as f64 + 0.5) * step - 0.5).clamp(0.0, from as f64 - 1.0);
                let first = (centre as usize).min(from.saturating_sub(2));
                let share = centre - first as f64;
                self.weights.push((1.0 - share) as f32);
                if from > 1 {
                    self.weights.push(share as f32);
                }
                first
            };
            self.spans.push((first, before..self.weights.len()));
        }
    }
}

/// Width, height and upper edge of the part of a picture that a frame shows.
fn shown((from_width, from_height): (usize, usize), (width, height): (usize, usize), fit: Fit) -> [f64; 3] {
    let [from_width, from_height, width, height] = [from_width, from_height, width, height].map(|n| n as f64);
    let shrink = (from_width / width).min(from_height / height);
    match fit {
        Fit::Stretch => [from_width, from_height, 0.0],
        Fit::Cover => [width * shrink, height * shrink, (from_height - height * shrink) / 2.0],
        Fit::Horizon { clip, frame } => {
            // What lies above and below the horizon has to reach the edges of the frame.
            let whole = height * shrink;
            let reach =
                [(clip, frame), (1.0 - clip, 1.0 - frame)].map(|(has, needs)| has * from_height / needs);
            let shown = whole.min(reach[0]).min(reach[1]);
            [width * shrink * shown / whole, shown, (clip * from_height - frame * shown).max(0.0)]
        }
    }
}

/// Scales pictures of one size to another. Keeps its workspace between pictures.
#[derive(Debug, Clone, Default)]
pub struct Scaler {
    columns: Taps,
    rows: Taps,
    /// Every input row at the output's width, as red, green, blue, alpha.
    narrow: Vec<f32>,
    /// Whether an input row has anything in it.
    filled: Vec<bool>,
    sums: Vec<f32>,
}

impl Scaler {
    /// Scales a picture of premultiplied red, green, blue, alpha. `colours` gets red, green and blue of all pixels,
    /// `alphas` the alpha of all pixels; a colour never exceeds its alpha.
    pub fn scale(
        &mut self,
        rgba: &[u8],
        (from_width, from_height): (usize, usize),
        (width, height): (usize, usize),
        fit: Fit,
        colours: &mut Vec<u8>,
        alphas: &mut Vec<u8>,
    ) {
        let [crop_width, crop_height, top] = shown((from_width, from_height), (width, height), fit);
        self.columns.fill(from_width, (from_width as f64 - crop_width) / 2.0, crop_width, width);
        self.rows.fill(from_height, top, crop_height, height);
        self.narrow_rows(rgba, from_width, width);
        colours.resize(width * height * 3, 0);
        alphas.resize(width * height, 0);
        self.sums.resize(width * 4, 0.0);
        let lines = colours.chunks_exact_mut(width * 3).zip(alphas.chunks_exact_mut(width));
        for ((colours, alphas), (first, weights)) in lines.zip(&self.rows.spans) {
            let weights = &self.rows.weights[weights.clone()];
            self.sums.fill(0.0);
            for (row, weight) in (*first..).zip(weights) {
                if self.filled[row] {
                    let line = &self.narrow[row * width * 4..][..width * 4];
                    for (sum, value) in self.sums.iter_mut().zip(line) {
                        *sum += value * weight;
                    }
                }
            }
            let pixels = colours.chunks_exact_mut(3).zip(alphas).zip(self.sums.chunks_exact(4));
            for ((colour, alpha), sums) in pixels {
                *alpha = (sums[3] + 0.5) as u8;
                for (value, sum) in colour.iter_mut().zip(sums) {
                    *value = ((sum + 0.5) as u8).min(*alpha);
                }
            }
        }
    }

    fn narrow_rows(&mut self, rgba: &[u8], from_width: usize, width: usize) {
        self.filled.clear();
        self.narrow.resize(rgba.len() / (from_width * 4) * width * 4, 0.0);
        let lines = rgba.chunks_exact(from_width * 4).zip(self.narrow.chunks_exact_mut(width * 4));
        for (line, narrow) in lines {
            let filled = line.chunks_exact(4).any(|pixel| pixel[3] != 0);
            self.filled.push(filled);
            if !filled {
                continue;
            }
            for (out, (first, weights)) in narrow.chunks_exact_mut(4).zip(&self.columns.spans) {
                let mut sums = [0.0f32; 4];
                let pixels = line[first * 4..].chunks_exact(4);
                for (pixel, weight) in pixels.zip(&self.columns.weights[weights.clone()]) {
                    for (sum, &value) in sums.iter_mut().zip(pixel) {
                        *sum += f32::from(value) * weight;
                    }
                }
                out.copy_from_slice(&sums);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scaled(rgba: &[u8], from: (usize, usize), to: (usize, usize), fit: Fit) -> (Vec<u8>, Vec<u8>) {
        let (mut colours, mut alphas) = (Vec::new(), Vec::new());
        Scaler::default().scale(rgba, from, to, fit, &mut colours, &mut alphas);
        (colours, alphas)
    }

    fn picture(width: usize, height: usize) -> Vec<u8> {
        let pixel = |i: usize| {
            let alpha = (i * 37 % 256) as u8;
            [alpha / 2, alpha, alpha / 3, alpha]
        };
        (0..width * height).flat_map(pixel).collect()
    }

    #[test]
    fn shrinking_by_whole_numbers_gives_the_mean_of_each_block() {
        let (width, height) = (12, 6);
        let rgba = picture(width, height);
        let (colours, alphas) = scaled(&rgba, (width, height), (4, 3), Fit::Stretch);
        for y in 0..3 {
            for x in 0..4 {
                let mean = |channel: usize| {
                    let block = (0..6).map(|i| (x * 3 + i % 3, y * 2 + i / 3));
                    block.map(|(x, y)| f64::from(rgba[(y * width + x) * 4 + channel])).sum::<f64>() / 6.0
                };
                assert!((f64::from(alphas[y * 4 + x]) - mean(3)).abs() <= 0.51);
                (0..3)
                    .for_each(|c| assert!((f64::from(colours[(y * 4 + x) * 3 + c]) - mean(c)).abs() <= 0.51));
            }
        }
    }

    #[test]
    fn a_flat_picture_stays_flat_at_every_size() {
        let rgba = [40, 80, 120, 160].repeat(5 * 7);
        for to in [(1, 1), (5, 7), (3, 2), (64, 48), (2, 31)] {
            for fit in [Fit::Cover, Fit::Stretch] {
                let (colours, alphas) = scaled(&rgba, (5, 7), to, fit);
                assert!(colours.chunks(3).all(|c| c == [40, 80, 120]), "{to:?} {fit:?}");
                assert!(alphas.iter().all(|&a| a == 160), "{to:?} {fit:?}");
            }
        }
    }

    #[test]
    fn cover_keeps_the_shape_and_stretch_does_not() {
        // Columns of alpha 0, 200, 100, 0 in a picture twice as wide as high, brought to a square.
        let rgba: Vec<u8> =
            [0u8, 200, 100, 0].iter().flat_map(|&a| [0, 0, 0, a]).collect::<Vec<_>>().repeat(2);
        assert_eq!(scaled(&rgba, (4, 2), (2, 2), Fit::Cover).1, [200, 100, 200, 100]);
        assert_eq!(scaled(&rgba, (4, 2), (2, 2), Fit::Stretch).1, [100, 50, 100, 50]);
    }

    #[test]
    fn the_horizon_of_the_clip_comes_to_lie_on_that_of_the_frame() {
        // Opaque above the horizon, transparent below.
        let (width, height) = (64, 80);
        let rgba: Vec<u8> =
            (0..width * height).flat_map(|i| [0, 0, 0, if i / width < 36 { 255 } else { 0 }]).collect();
        for to in [(64, 80), (64, 32), (20, 100), (31, 31)] {
            for frame in [0.1, 0.3, 0.5, 0.9] {
                let fit = Fit::Horizon { clip: 0.45, frame };
                let alphas = scaled(&rgba, (width, height), to, fit).1;
                let column: f64 = (0..to.1).map(|y| f64::from(alphas[y * to.0]) / 255.0).sum();
                assert!((column - frame * to.1 as f64).abs() < 0.51, "{to:?} {frame}: {column}");
                let [shown_width, shown_height, top] = shown((width, height), to, fit);
                let shape = shown_width / shown_height * to.1 as f64 / to.0 as f64;
                assert!((shape - 1.0).abs() < 1e-9 && shown_width <= 64.0 + 1e-9, "{to:?} {frame}");
                assert!(top >= 0.0 && top + shown_height <= 80.0 + 1e-9, "{to:?} {frame}");
            }
        }
    }

    #[test]
    fn colours_never_exceed_alpha() {
        for to in [(1, 1), (13, 9), (40, 30), (7, 21)] {
            let (colours, alphas) = scaled(&picture(17, 11), (17, 11), to, Fit::Cover);
            assert!(colours.chunks(3).zip(&alphas).all(|(c, a)| c.iter().all(|v| v <= a)));
        }
    }
}
