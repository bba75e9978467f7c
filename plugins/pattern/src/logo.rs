//! The project's logo: the letters p, d and k on a yellow plate with a dark rim, computed from distances.

use pdk_sdk::ops::frame::CHANNELS;

/// Width over height.
pub const ASPECT: f64 = 2560.0 / 1330.0;

const PLATE: [f64; 3] = [250.0, 200.0, 30.0];
const INK: [f64; 3] = [32.0, 32.0, 40.0];

/// Radius of the plate's corners, width of its rim, and half the width of a stroke; the plate is 1 high.
const CORNER: f64 = 0.2;
const RIM: f64 = 0.06;
const STROKE: f64 = 0.05;

/// The bowls of p and d: middle and radius.
const BOWLS: [(f64, f64, f64); 2] = [(0.52, 0.5, 0.15), (1.04, 0.5, 0.15)];

/// The straight strokes: the stems of p, d and k, then the arm and the leg of k.
const STROKES: [[f64; 4]; 5] = [
    [0.37, 0.35, 0.37, 0.85],
    [1.19, 0.15, 1.19, 0.65],
    [1.4, 0.15, 1.4, 0.65],
    [1.4, 0.52, 1.6, 0.35],
    [1.47, 0.46, 1.62, 0.65],
];

/// The logo's colour at a place, from (0, 0) to (`ASPECT`, 1); nothing outside the plate.
fn colour(x: f64, y: f64) -> Option<[f64; 3]> {
    // How far inside the plate's edge; negative is outside.
    let (across, down) = ((x - ASPECT / 2.0).abs(), (y - 0.5).abs());
    let (past_x, past_y) = (across - (ASPECT / 2.0 - CORNER), down - (0.5 - CORNER));
    let inside = if past_x > 0.0 && past_y > 0.0 {
        CORNER - (past_x * past_x + past_y * past_y).sqrt()
    } else {
        CORNER - past_x.max(past_y)
    };
    if inside < 0.0 {
        return None;
    }
    let bowl = |&(cx, cy, radius): &(f64, f64, f64)| {
        let distance = ((x - cx) * (x - cx) + (y - cy) * (y - cy)).sqrt();
        (distance - radius).abs() < STROKE
    };
    let stroke = |&[x0, y0, x1, y1]: &[f64; 4]| {
        let (dx, dy) = (x1 - x0, y1 - y0);
        let along = (((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        let (off_x, off_y) = (x - x0 - along * dx, y - y0 - along * dy);
        off_x * off_x + off_y * off_y < STROKE * STROKE
    };
    let ink = inside < RIM || BOWLS.iter().any(bowl) || STROKES.iter().any(stroke);
    Some(if ink { INK } else { PLATE })
}

/// The logo in one size.
#[derive(Debug, Default)]
pub struct Logo {
    width: usize,
    height: usize,
    /// Red, green, blue, row by row.
    pixels: Vec<u8>,
    /// Which pixels belong to the logo.
    opaque: Vec<bool>,
}

impl Logo {
    /// Draws the logo `width` x `height` pixels large, whatever its aspect; nothing happens if it has this size already.
    /// A pixel is the mean of two by two places, and belongs to the logo where two of them do.
    pub fn draw(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) {
            return;
        }
        (self.width, self.height) = (width, height);
        self.pixels.clear();
        self.opaque.clear();
        for y in 0..height {
            for x in 0..width {
                let (mut sum, mut count) = ([0.0; CHANNELS], 0.0);
                for (sub_x, sub_y) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
                    let u = (x as f64 + sub_x) / width as f64 * ASPECT;
                    let v = (y as f64 + sub_y) / height as f64;
                    if let Some(colour) = colour(u, v) {
                        (0..CHANNELS).for_each(|c| sum[c] += colour[c]);
                        count += 1.0;
                    }
                }
                self.pixels.extend(sum.map(|s| if count > 0.0 { (s / count).round() as u8 } else { 0 }));
                self.opaque.push(count >= 2.0);
            }
        }
    }

    /// A row: for each pixel whether it belongs to the logo, and its colour.
    pub fn row(&self, y: usize) -> impl Iterator<Item = (bool, &[u8])> {
        let row = y * self.width..(y + 1) * self.width;
        let pixels = self.pixels[row.start * CHANNELS..row.end * CHANNELS].chunks_exact(CHANNELS);
        self.opaque[row].iter().copied().zip(pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_are_open_and_the_rest_is_covered() {
        let mut logo = Logo::default();
        logo.draw(200, 104);
        assert_eq!((logo.pixels.len(), logo.opaque.len()), (200 * 104 * 3, 200 * 104));
        let opaque: Vec<Vec<bool>> = (0..104).map(|y| logo.row(y).map(|(o, _)| o).collect()).collect();
        for (x, y) in [(0, 0), (199, 0), (0, 103), (199, 103)] {
            assert!(!opaque[y][x]);
        }
        // Four corners miss a square each but for a quarter of a circle.
        let open = opaque.iter().flatten().filter(|&&o| !o).count() as f64 / (200.0 * 104.0);
        let expected = CORNER * CORNER * (4.0 - std::f64::consts::PI) / ASPECT;
        assert!((open - expected).abs() < 0.002, "{open} {expected}");
    }

    #[test]
    fn letters_stand_apart_on_the_plate() {
        // Along the middle line: rim, p (two strokes), d (two strokes), k (stem and the place where arm and leg meet), rim.
        let dark: Vec<bool> = (0..1925).map(|i| colour(f64::from(i) / 1000.0, 0.5) == Some(INK)).collect();
        let strokes = dark.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        assert!(dark[0] && strokes >= 6, "{strokes}");
    }
}
