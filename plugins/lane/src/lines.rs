//! Finds the lane in an image: the white edge line on its right and the dashed yellow line on its left.
//!
//! Some rows of pixels, each of which shows the ground at one distance, are searched from near to far. In each the two
//! lines are looked for around the place where the rows before lead one to expect them: stretches of a row, as wide as a
//! line is there, that are brighter (or yellower) than what lies on both sides of them. The places found say where the
//! centre of the lane is; a parabola through them is the lane.

use pdk_sdk::prelude::Frame;

use crate::camera::{MOUNTING, Projection};
use crate::section;

/// Nearest and farthest distance at which lines are looked for, ahead of the camera, and the step between, in metres.
const NEAREST: f64 = 2.6;
const FARTHEST: f64 = 17.0;
const STEP: f64 = 0.6;
/// Lines are looked for this far to either side of where they are expected, in metres.
const WINDOW: f64 = 0.9;
/// How much brighter than its surroundings a line has to be, of 255.
const CONTRAST: f64 = 22.0;
/// Fewest rows that make a lane.
pub const FEWEST_ROWS: usize = 5;
/// The white line's and the yellow line's distance to the right of the lane's centre, in metres.
const WHITE_OFFSET: f64 = section::EDGE_LINE + section::ROAD_CENTRE;
const YELLOW_OFFSET: f64 = section::ROAD_CENTRE;
/// How far the distance between the two lines may be off in a row before one of them is not believed, in metres.
const WIDTH_TOLERANCE: f64 = 0.45;

/// The centre of the lane ahead: `right = offset + slope * ahead + bend * ahead^2`, in metres from the camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LaneShape {
    /// Distance of the lane's centre to the right of the camera.
    pub offset: f64,
    /// Its change per metre ahead.
    pub slope: f64,
    /// Half its curvature in 1/m, positive to the right.
    pub bend: f64,
}

impl LaneShape {
    /// Distance to the right of the camera, this many metres ahead.
    pub fn at(&self, ahead: f64) -> f64 {
        self.offset + (self.slope + self.bend * ahead) * ahead
    }
}

/// A lane that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundLane {
    /// Where it runs.
    pub shape: LaneShape,
    /// The farthest distance at which it was seen, in metres.
    pub farthest: f64,
}

/// A row to search.
#[derive(Debug, Clone, Copy)]
struct Row {
    y: usize,
    ahead: f64,
    pixel_width: f64,
}

/// Finds lanes in frames of one size.
#[derive(Debug)]
pub struct LaneFinder {
    size: (usize, usize),
    centre_x: f64,
    rows: Vec<Row>,
    /// Sums over the row at hand: of the darkest channel, and of yellowness.
    white: Vec<u32>,
    yellow: Vec<u32>,
    /// Distance ahead, the lane's centre there, and how much it counts.
    found: Vec<[f64; 3]>,
}

impl LaneFinder {
    /// A finder for frames of this size.
    pub fn new(width: usize, height: usize) -> Self {
        let projection = Projection::new(width, height, MOUNTING);
        let mut rows: Vec<Row> = Vec::new();
        for step in 0..=((FARTHEST - NEAREST) / STEP) as usize {
            let y = projection.row_of(NEAREST + step as f64 * STEP);
            if y < 0.0 || y >= height as f64 || rows.last().is_some_and(|last| last.y == y as usize) {
                continue;
            }
            if let Some(ground) = projection.ground(y.floor() + 0.5) {
                rows.push(Row { y: y as usize, ahead: ground.ahead, pixel_width: ground.pixel_width });
            }
        }
        let found = Vec::with_capacity(rows.len());
        let sums = || vec![0; width + 1];
        let centre_x = projection.centre_x;
        Self { size: (width, height), centre_x, rows, white: sums(), yellow: sums(), found }
    }

    /// The frame size it was made for.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Number of rows that are searched.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Looks for the lane around where it is expected. `None` where too little of it is seen.
    pub fn find(&mut self, frame: Frame<'_>, expected: LaneShape) -> Option<FoundLane> {
        self.found.clear();
        // How far the lane lies to the right of what was expected, and the change of that per metre ahead.
        let (mut error, mut drift, mut last_ahead) = (0.0, 0.0, NEAREST);
        for i in 0..self.rows.len() {
            let row = self.rows[i];
            self.sum(frame.row(row.y));
            let step = row.ahead - last_ahead;
            let guess = expected.at(row.ahead) + error + drift * step;
            let slope = expected.slope + 2.0 * expected.bend * row.ahead + drift;
            // If the lane runs aslant, a row cuts it in a longer line.
            let stretch = (1.0 + slope * slope).sqrt();
            let look = |sums: &[u32], offset: f64| {
                let line = section::LINE_WIDTH * stretch / row.pixel_width;
                let at = (guess + offset * stretch) / row.pixel_width + self.centre_x;
                let place = strongest(sums, at, WINDOW / row.pixel_width, line)?;
                Some((place - self.centre_x) * row.pixel_width - offset * stretch)
            };
            let white = look(&self.white, WHITE_OFFSET);
            let yellow = look(&self.yellow, YELLOW_OFFSET);
            let (centre, weight) = match (white, yellow) {
                (Some(a), Some(b)) if (a - b).abs() <= WIDTH_TOLERANCE => ((a + b) / 2.0, 2.0),
                // They contradict each other: the one nearer to the guess is believed.
                (Some(a), Some(b)) if (a - guess).abs() < (b - guess).abs() => (a, 0.5),
                (Some(_), Some(b)) => (b, 0.5),
                (Some(a), None) | (None, Some(a)) => (a, 1.0),
                (None, None) => continue,
            };
            self.found.push([row.ahead, centre, weight]);
            // An alpha-beta filter along the lane.
            let surprise = centre - guess;
            error += drift * step + 0.6 * surprise;
            if step > 0.05 {
                drift = (drift + 0.25 * surprise / step.max(0.4)).clamp(-1.5, 1.5);
            }
            last_ahead = row.ahead;
        }
        if self.found.len() < FEWEST_ROWS {
            return None;
        }
        let first = fit(&self.found)?;
        // What lies far from the first parabola counts for less in the second.
        for sample in &mut self.found {
            let off = (sample[1] - first.at(sample[0])).abs();
            sample[2] *= 0.15 / off.max(0.15);
        }
        let farthest = self.found.last().map_or(0.0, |sample| sample[0]);
        fit(&self.found).map(|shape| FoundLane { shape, farthest })
    }

    /// Sums up one row of pixels.
    fn sum(&mut self, row: &[u8]) {
        let (mut white, mut yellow) = (0, 0);
        for (x, pixel) in row.chunks_exact(3).enumerate() {
            let [r, g, b] = [pixel[0], pixel[1], pixel[2]];
            white += u32::from(r.min(g).min(b));
            yellow += u32::from(r.min(g).saturating_sub(b));
            (self.white[x + 1], self.yellow[x + 1]) = (white, yellow);
        }
    }
}

/// The place within `reach` of `at` where a stretch of `line` pixels stands out most from both of its sides, refined to
/// parts of a pixel. All in pixels; `sums` are the running sums of a row.
fn strongest(sums: &[u32], at: f64, reach: f64, line: f64) -> Option<f64> {
    let width = sums.len() - 1;
    let line = line.round().max(1.0) as usize;
    // The sides keep a distance, since edges are never quite sharp.
    let gap = line / 2 + 1;
    let margin = line + gap;
    let low = (at - reach - line as f64 / 2.0).ceil().max(margin as f64);
    let high = (at + reach - line as f64 / 2.0).min(width as f64 - (line + margin) as f64);
    if !at.is_finite() || low > high {
        return None;
    }
    let mean = |from: usize| f64::from(sums[from + line] - sums[from]) / line as f64;
    let mut best = (CONTRAST, usize::MAX);
    for start in low as usize..=high as usize {
        let contrast = mean(start) - mean(start - margin).max(mean(start + margin));
        if contrast > best.0 {
            best = (contrast, start);
        }
    }
    let (contrast, start) = best;
    if start == usize::MAX {
        return None;
    }
    // The centre of gravity of what is brighter than half-way between the sides and the line.
    let floor = mean(start) - contrast / 2.0;
    let (mut weights, mut moments) = (0.0, 0.0);
    for x in start - gap..start + line + gap {
        let weight = (f64::from(sums[x + 1] - sums[x]) - floor).max(0.0);
        weights += weight;
        moments += weight * (x as f64 + 0.5);
    }
    Some(if weights > 0.0 { moments / weights } else { start as f64 + line as f64 / 2.0 })
}

/// The parabola through samples of distance, place and weight, by least squares.
fn fit(samples: &[[f64; 3]]) -> Option<LaneShape> {
    // Bends that no road has are held down; the unit is a sample a metre off.
    const STIFFNESS: f64 = 40.0;
    let mut m = [[0.0f64; 4]; 3];
    for &[ahead, place, weight] in samples {
        let powers = [1.0, ahead, ahead * ahead];
        for i in 0..3 {
            for j in 0..3 {
                m[i][j] += weight * powers[i] * powers[j];
            }
            m[i][3] += weight * powers[i] * place;
        }
    }
    m[2][2] += STIFFNESS;
    // Gaussian elimination; the matrix is symmetric and positive, so that the order does not matter.
    for i in 0..3 {
        if m[i][i] < 1e-9 {
            return None;
        }
        for j in i + 1..3 {
            let factor = m[j][i] / m[i][i];
            let pivot = m[i];
            for (value, above) in m[j].iter_mut().zip(pivot).skip(i) {
                *value -= factor * above;
            }
        }
    }
    let bend = m[2][3] / m[2][2];
    let slope = (m[1][3] - m[1][2] * bend) / m[1][1];
    let offset = (m[0][3] - m[0][1] * slope - m[0][2] * bend) / m[0][0];
    Some(LaneShape { offset, slope, bend })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parabola_goes_through_its_samples() {
        let shape = LaneShape { offset: 0.4, slope: -0.1, bend: 0.01 };
        let samples: Vec<[f64; 3]> =
            (0..20).map(|i| [3.0 + i as f64 * 0.7, shape.at(3.0 + i as f64 * 0.7), 1.0]).collect();
        let found = fit(&samples).unwrap();
        assert!((found.offset - shape.offset).abs() < 0.02 && (found.bend - shape.bend).abs() < 1e-3);
    }

    #[test]
    fn a_bright_stretch_is_found_to_parts_of_a_pixel() {
        let mut sums = vec![0u32];
        for x in 0..100 {
            // Three pixels and a half from 50 to 53.5.
            let value = if (50..53).contains(&x) {
                200
            } else if x == 53 {
                125
            } else {
                50
            };
            sums.push(sums[x] + value);
        }
        let place = strongest(&sums, 45.0, 20.0, 3.5).unwrap();
        assert!((place - 51.75).abs() < 0.3, "{place}");
        assert_eq!(strongest(&sums, 20.0, 15.0, 3.5), None);
        assert_eq!(strongest(&sums, f64::NAN, 15.0, 3.5), None);
        assert_eq!(strongest(&sums, -500.0, 15.0, 3.5), None);
    }

    #[test]
    fn an_even_picture_has_no_lane() {
        let frame = pdk_sdk::prelude::FrameBuf::new(320, 240);
        assert_eq!(LaneFinder::new(320, 240).find(frame.as_ref(), LaneShape::default()), None);
    }
}
