//! A quantity below the frames of a clip: its name and value, a bar, and its course over the scenario.

use image::{Rgb, RgbImage};
use pdk_preview::text::{LINE_HEIGHT, draw_in};

/// Pixels between two gauges.
const GAP: u32 = 16;
/// Pixels from the left edge to the value, which is more than the longest name takes.
const VALUE: u32 = 128;
const BAR: u32 = 10;
const CURVE: u32 = 64;

const INK: Rgb<u8> = Rgb([228, 231, 235]);
const NAME: Rgb<u8> = Rgb([150, 156, 166]);
const FIELD: Rgb<u8> = Rgb([40, 43, 50]);
const ZERO: Rgb<u8> = Rgb([92, 98, 110]);
const COURSE: Rgb<u8> = Rgb([90, 169, 255]);

/// One quantity.
pub struct Gauge {
    name: &'static str,
    unit: &'static str,
    /// The values at the two ends of the bar.
    range: [f64; 2],
    /// Seconds that the curve has room for.
    seconds: f64,
    left: u32,
    top: u32,
    width: u32,
    /// Where the curve has come to.
    last: Option<[u32; 2]>,
}

impl Gauge {
    /// The height of all gauges in pixels.
    pub const HEIGHT: u32 = LINE_HEIGHT + BAR + 4 + CURVE;

    /// One of four in columns side by side in this many pixels from this place on.
    pub fn new(
        name: &'static str,
        unit: &'static str,
        range: [f64; 2],
        seconds: f64,
        column: u32,
        room: u32,
        [left, top]: [u32; 2],
    ) -> Self {
        let width = (room - 3 * GAP) / 4;
        Self { name, unit, range, seconds, left: left + column * (width + GAP), top, width, last: None }
    }

    /// Draws what does not change.
    pub fn prepare(&self, picture: &mut RgbImage) {
        draw_in(picture, self.left, self.top, self.name, NAME);
        fill(picture, [self.left, self.bar_top()], [self.width, BAR], FIELD);
        fill(picture, [self.left, self.curve_top()], [self.width, CURVE], FIELD);
        let zero = self.row(0.0);
        fill(picture, [self.left, zero], [self.width, 1], ZERO);
    }

    /// Goes on with the curve to the value at this time in seconds.
    pub fn draw_curve(&mut self, picture: &mut RgbImage, time: f64, value: f64) {
        let share = (time / self.seconds).clamp(0.0, 1.0);
        let here = [self.left + (share * f64::from(self.width - 1)).round() as u32, self.row(value)];
        let [last_x, last_y] = self.last.replace(here).unwrap_or(here);
        let [x, y] = here;
        // Column by column, each from where the line comes in to where it goes out.
        let columns = x.saturating_sub(last_x).max(1);
        let at = |column: u32| {
            let share = f64::from(column) / f64::from(columns);
            (f64::from(last_y) + (f64::from(y) - f64::from(last_y)) * share).round() as u32
        };
        for column in 0..columns {
            let (from, to) = (at(column), at(column + 1));
            let column = (last_x + column + u32::from(x > last_x)).min(self.left + self.width - 1);
            fill(picture, [column, from.min(to)], [1, from.abs_diff(to) + 2], COURSE);
        }
    }

    /// Shows the value now.
    pub fn draw_value(&self, picture: &mut RgbImage, value: f64) {
        // Rounded as it is shown; adding nothing turns minus zero into zero.
        let shown = (value * 100.0).round() / 100.0 + 0.0;
        let text = format!("{shown:.2}{}", self.unit);
        draw_in(picture, self.left + VALUE, self.top, &text, INK);
        let (zero, here) = (self.along(0.0), self.along(value));
        let (from, to) = (zero.min(here), zero.max(here));
        fill(picture, [from, self.bar_top()], [to - from, BAR], COURSE);
        fill(picture, [zero, self.bar_top()], [1, BAR], INK);
    }

    fn bar_top(&self) -> u32 {
        self.top + LINE_HEIGHT
    }

    fn curve_top(&self) -> u32 {
        self.bar_top() + BAR + 4
    }

    /// The column of a value in the bar.
    fn along(&self, value: f64) -> u32 {
        self.left + (self.share(value) * f64::from(self.width - 1)).round() as u32
    }

    /// The row of a value in the field of the curve, whose line is two pixels thick.
    fn row(&self, value: f64) -> u32 {
        self.curve_top() + ((1.0 - self.share(value)) * f64::from(CURVE - 2)).round() as u32
    }

    fn share(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        ((value - from) / (to - from)).clamp(0.0, 1.0)
    }
}

/// Fills a rectangle that starts at `[x, y]` and is `[width, height]` large.
pub fn fill(picture: &mut RgbImage, [x, y]: [u32; 2], [width, height]: [u32; 2], color: Rgb<u8>) {
    let (right, bottom) = ((x + width).min(picture.width()), (y + height).min(picture.height()));
    for y in y..bottom {
        for x in x..right {
            picture.put_pixel(x, y, color);
        }
    }
}

/// Fills the border of a rectangle, this many pixels thick inwards.
pub fn fill_border(
    picture: &mut RgbImage,
    [x, y]: [u32; 2],
    [width, height]: [u32; 2],
    thickness: u32,
    color: Rgb<u8>,
) {
    fill(picture, [x, y], [width, thickness], color);
    fill(picture, [x, y + height - thickness], [width, thickness], color);
    fill(picture, [x, y], [thickness, height], color);
    fill(picture, [x + width - thickness, y], [thickness, height], color);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_has_no_gaps_and_stays_in_its_field() {
        let mut picture = RgbImage::new(400, 140);
        let mut gauge = Gauge::new("speed", " m/s", [-1.0, 1.0], 2.0, 1, 380, [10, 10]);
        gauge.prepare(&mut picture);
        // A wild course, coarser and finer than columns, beyond the range and beyond the end.
        let mut time = 0.0;
        for number in 0..60 {
            gauge.draw_curve(&mut picture, time, if number % 3 == 0 { 5.0 } else { -0.5 });
            time += if number < 30 { 0.004 } else { 0.07 };
        }
        let blue = |x: u32, y: u32| *picture.get_pixel(x, y) == COURSE;
        for x in gauge.left..gauge.left + gauge.width {
            let rows: Vec<u32> = (0..140).filter(|&y| blue(x, y)).collect();
            assert!(!rows.is_empty(), "column {x}");
            assert!(rows.windows(2).all(|pair| pair[1] == pair[0] + 1), "column {x}: {rows:?}");
            assert!(rows.iter().all(|row| (gauge.curve_top()..gauge.curve_top() + CURVE).contains(row)));
        }
        assert!((0..140).all(|y| !blue(gauge.left - 1, y) && !blue(gauge.left + gauge.width, y)));
        gauge.draw_value(&mut picture, 0.5);
        let bar = |x: u32| *picture.get_pixel(x, gauge.bar_top() + 3) == COURSE;
        let lit: Vec<u32> = (gauge.left..gauge.left + gauge.width).filter(|&x| bar(x)).collect();
        let (first, last) = (lit[0] - gauge.left, lit[lit.len() - 1] - gauge.left);
        assert_eq!((first, last), (gauge.width / 2 + 1, (gauge.width - 1) * 3 / 4));
    }
}
