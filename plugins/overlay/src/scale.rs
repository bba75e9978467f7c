//! Brings keyed pictures to the size of the frame: averaged over the area of each pixel where they shrink, linear
//! between pixels where they grow.

/// How a clip is fitted to a frame of another shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// Keeps its shape and fills the frame; what sticks out is cut off at both sides alike.
    Cover,
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
        let (crop_width, crop_height) = match fit {
            Fit::Stretch => (from_width as f64, from_height as f64),
            Fit::Cover => {
                let shrink = (from_width as f64 / width as f64).min(from_height as f64 / height as f64);
                (width as f64 * shrink, height as f64 * shrink)
            }
        };
        self.columns.fill(from_width, (from_width as f64 - crop_width) / 2.0, crop_width, width);
        self.rows.fill(from_height, (from_height as f64 - crop_height) / 2.0, crop_height, height);
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
    fn colours_never_exceed_alpha() {
        for to in [(1, 1), (13, 9), (40, 30), (7, 21)] {
            let (colours, alphas) = scaled(&picture(17, 11), (17, 11), to, Fit::Cover);
            assert!(colours.chunks(3).zip(&alphas).all(|(c, a)| c.iter().all(|v| v <= a)));
        }
    }
}
