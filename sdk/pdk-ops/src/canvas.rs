//! Drawing of the textures that lie on the glass or in the air: soft strokes and clouds of noise, in shades from 0 to 1.
//! It happens once for each frame size, so it is written to be simple rather than fast.

use pdk_seed::Random;

/// A point: columns to the right, rows down.
pub type Point = [f64; 2];

/// `from`, and then `length` in the direction `angle` (0 is right, positive is down).
pub fn ahead(from: Point, angle: f64, length: f64) -> Point {
    [from[0] + length * libm::cos(angle), from[1] + length * libm::sin(angle)]
}

/// 0 below `low`, 1 above `high`, and smooth in between.
pub fn smooth_step(low: f64, high: f64, value: f64) -> f64 {
    let place = ((value - low) / (high - low)).clamp(0.0, 1.0);
    place * place * (3.0 - 2.0 * place)
}

/// One pixel of a texture.
pub struct Texel {
    /// Its colour, from 0 to 1.
    pub rgb: [f64; 3],
    /// How much of what is behind it hides, from 0 to 1.
    pub cover: f64,
}

/// A single channel.
#[derive(Debug, Clone)]
pub struct Canvas {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The shades, row by row.
    pub shades: Vec<f64>,
}

impl Canvas {
    /// Black.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, shades: vec![0.0; width * height] }
    }

    /// A hundredth of the diagonal: what sizes are measured in, so that a texture looks the same at any resolution.
    pub fn unit(&self) -> f64 {
        let (width, height) = (self.width as f64, self.height as f64);
        (width * width + height * height).sqrt() / 100.0
    }

    /// Brightens the surroundings of a line: by `opacity` of what is missing to white along the line, and less and less
    /// towards `radius`.
    pub fn stroke(&mut self, from: Point, to: Point, radius: f64, opacity: f64) {
        // What is thinner than a pixel is drawn fainter instead.
        let drawn = radius.max(0.9);
        let opacity = opacity * radius / drawn;
        let range = |axis: usize, size: usize| {
            let low = (from[axis].min(to[axis]) - drawn).ceil().max(0.0);
            let high = (from[axis].max(to[axis]) + drawn).floor().min(size as f64 - 1.0);
            low as usize..if high < low { low as usize } else { high as usize + 1 }
        };
        let along = [to[0] - from[0], to[1] - from[1]];
        let length_squared = along[0] * along[0] + along[1] * along[1];
        for y in range(1, self.height) {
            for x in range(0, self.width) {
                let (dx, dy) = (x as f64 - from[0], y as f64 - from[1]);
                let place = if length_squared > 0.0 {
                    ((dx * along[0] + dy * along[1]) / length_squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let (dx, dy) = (dx - place * along[0], dy - place * along[1]);
                let distance = (dx * dx + dy * dy) / (drawn * drawn);
                if distance < 1.0 {
                    let shade = &mut self.shades[y * self.width + x];
                    *shade += (1.0 - *shade) * opacity * (1.0 - distance) * (1.0 - distance);
                }
            }
        }
    }

    /// Clouds around 0.5: noise on a grid with cells of `cell` pixels, on one with cells half as large, and so on, each
    /// half as strong as the one before.
    pub fn clouds(width: usize, height: usize, cell: f64, octaves: usize, random: &mut Random) -> Self {
        let mut canvas = Self::new(width, height);
        let mut weight = 0.5 / (1.0 - libm::exp2(-(octaves as f64)));
        let mut cell = cell;
        for _ in 0..octaves {
            let columns = (width as f64 / cell) as usize + 2;
            let rows = (height as f64 / cell) as usize + 2;
            let grid: Vec<f64> = (0..columns * rows).map(|_| random.unit()).collect();
            for y in 0..height {
                let down = y as f64 / cell;
                let (row, down) = (down as usize * columns, smooth_step(0.0, 1.0, down.fract()));
                for x in 0..width {
                    let right = x as f64 / cell;
                    let (column, right) = (right as usize, smooth_step(0.0, 1.0, right.fract()));
                    let mix = |start: usize| grid[start] + (grid[start + 1] - grid[start]) * right;
                    let (top, bottom) = (mix(row + column), mix(row + columns + column));
                    canvas.shades[y * width + x] += weight * (top + (bottom - top) * down);
                }
            }
            weight /= 2.0;
            cell /= 2.0;
        }
        canvas
    }
}

#[cfg(test)]
mod tests {
    use pdk_seed::Key;

    use super::*;

    #[test]
    fn strokes_stay_within_their_radius_and_within_white() {
        let mut canvas = Canvas::new(40, 30);
        for _ in 0..50 {
            canvas.stroke([10.0, 10.0], [30.0, 10.0], 4.0, 0.9);
        }
        assert!(canvas.shades.iter().all(|s| (0.0..=1.0).contains(s)));
        assert!(canvas.shades[10 * 40 + 20] > 0.99 && canvas.shades[10 * 40 + 8] > 0.5);
        assert!((0..40).all(|x| canvas.shades[15 * 40 + x] == 0.0));
        // Outside the canvas, and thinner than a pixel.
        let before = canvas.clone();
        canvas.stroke([-90.0, 500.0], [-9.0, -9.0], 3.0, 1.0);
        assert_eq!(canvas.shades, before.shades);
        canvas.stroke([5.0, 25.0], [5.0, 25.0], 0.09, 1.0);
        assert!((canvas.shades[25 * 40 + 5] - 0.1).abs() < 1e-9);
    }

    #[test]
    fn clouds_lie_around_one_half() {
        let clouds = Canvas::clouds(200, 150, 20.0, 4, &mut Key([1; 32]).sequence());
        let mean = clouds.shades.iter().sum::<f64>() / clouds.shades.len() as f64;
        assert!((mean - 0.5).abs() < 0.05, "{mean}");
        assert!(clouds.shades.iter().all(|s| (0.0..=1.0).contains(s)));
        assert!(clouds.shades.iter().any(|s| *s < 0.25) && clouds.shades.iter().any(|s| *s > 0.75));
    }
}
