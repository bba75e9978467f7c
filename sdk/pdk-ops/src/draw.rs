//! Filled circles, rectangles and lines. What lies outside the frame is left out.

use crate::frame::{CHANNELS, FrameMut};

/// Fills the pixels `first..=last` of row `y`, as far as they lie inside.
fn fill_span(dst: &mut FrameMut<'_>, y: i64, first: i64, last: i64, rgb: [u8; 3]) {
    let (width, height) = (dst.width() as i64, dst.height() as i64);
    let (first, last) = (first.max(0), last.min(width - 1));
    if !(0..height).contains(&y) || first > last {
        return;
    }
    let row = &mut dst.row_mut(y as usize)[first as usize * CHANNELS..(last as usize + 1) * CHANNELS];
    row.chunks_exact_mut(CHANNELS).for_each(|pixel| pixel.copy_from_slice(&rgb));
}

/// Fills the circle of radius `r` about (`cx`, `cy`): all pixels whose distance from it is at most `r` pixels.
/// A pixel's position is its index, so the centre of the first pixel is (0, 0). Nothing if `r` is negative or
/// an argument is not finite.
pub fn fill_circle(mut dst: FrameMut<'_>, cx: f64, cy: f64, r: f64, rgb: [u8; 3]) {
    if !(cx.is_finite() && cy.is_finite() && r.is_finite() && r >= 0.0) {
        return;
    }
    // Conversions from f64 saturate, so that a circle far outside stays outside.
    let top = (cy - r).ceil().max(0.0) as i64;
    let bottom = (cy + r).floor().min(dst.height() as f64) as i64;
    for y in top..=bottom {
        let dy = y as f64 - cy;
        let half = (r * r - dy * dy).max(0.0).sqrt();
        fill_span(&mut dst, y, (cx - half).ceil() as i64, (cx + half).floor() as i64, rgb);
    }
}

/// Fills the rectangle whose first pixel is (`x`, `y`). Nothing if `width` or `height` is not positive.
pub fn fill_rectangle(mut dst: FrameMut<'_>, x: i32, y: i32, width: i32, height: i32, rgb: [u8; 3]) {
    let (x, y) = (i64::from(x), i64::from(y));
    let bottom = (y + i64::from(height)).min(dst.height() as i64);
    for row in y.max(0)..bottom {
        fill_span(&mut dst, row, x, x + i64::from(width) - 1, rgb);
    }
}

/// Draws a line one pixel wide from (`x0`, `y0`) to (`x1`, `y1`), both included: one pixel in each column, or in
/// each row where the line is steeper than a diagonal. Only the part inside the frame costs time.
pub fn draw_line(mut dst: FrameMut<'_>, x0: i32, y0: i32, x1: i32, y1: i32, rgb: [u8; 3]) {
    let (width, height) = (dst.width() as i128, dst.height() as i128);
    let (dx, dy) = (i128::from(x1) - i128::from(x0), i128::from(y1) - i128::from(y0));
    let steep = dy.abs() > dx.abs();
    // `along` runs through the pixels of the longer side, `across` follows from it.
    let (start, end, other, rise, limit) = if steep {
        (i128::from(y0), i128::from(y1), i128::from(x0), dx, height)
    } else {
        (i128::from(x0), i128::from(x1), i128::from(y0), dy, width)
    };
    let (length, sign) = ((end - start).abs(), if end < start { -1 } else { 1 });
    let (low, high) = (start.min(end).max(0), start.max(end).min(limit - 1));
    for along in low..=high {
        let step = (along - start) * sign;
        let across =
            if length == 0 { other } else { other + (2 * rise * step + length).div_euclid(2 * length) };
        let (x, y) = if steep { (across, along) } else { (along, across) };
        if (0..width).contains(&x) && (0..height).contains(&y) {
            dst.set_pixel(x as usize, y as usize, rgb);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::run;

    const WHITE: [u8; 3] = [255; 3];

    /// The pixels that a drawing function sets, over a black frame.
    fn drawn(width: usize, height: usize, draw: impl Fn(FrameMut<'_>)) -> Vec<(i64, i64)> {
        let frame = run(width, height, |mut dst| {
            dst.rows_mut().for_each(|row| row.fill(0));
            draw(dst);
        });
        let all = (0..height as i64).flat_map(|y| (0..width as i64).map(move |x| (x, y)));
        all.filter(|&(x, y)| frame.as_ref().pixel(x as usize, y as usize) == WHITE).collect()
    }

    fn inside(width: usize, height: usize, test: impl Fn(i64, i64) -> bool) -> Vec<(i64, i64)> {
        let all = (0..height as i64).flat_map(|y| (0..width as i64).map(move |x| (x, y)));
        all.filter(|&(x, y)| test(x, y)).collect()
    }

    proptest! {
        #[test]
        fn circles_hold_the_pixels_within_the_radius(
            width in 1usize..40, height in 1usize..40, cx in -20i32..60, cy in -20i32..60, r in 0i32..40,
        ) {
            let actual = drawn(width, height, |dst| fill_circle(dst, cx.into(), cy.into(), r.into(), WHITE));
            let (cx, cy, r) = (i64::from(cx), i64::from(cy), i64::from(r));
            let expected = inside(width, height, |x, y| (x - cx).pow(2) + (y - cy).pow(2) <= r * r);
            prop_assert_eq!(actual, expected);
        }

        #[test]
        fn rectangles_hold_their_pixels(
            width in 1usize..40, height in 1usize..40, x0 in -50i32..50, y0 in -50i32..50, w in -5i32..80,
            h in -5i32..80,
        ) {
            let actual = drawn(width, height, |dst| fill_rectangle(dst, x0, y0, w, h, WHITE));
            let (x0, y0, w, h) = (i64::from(x0), i64::from(y0), i64::from(w), i64::from(h));
            let expected = inside(width, height, |x, y| x >= x0 && x < x0 + w && y >= y0 && y < y0 + h);
            prop_assert_eq!(actual, expected);
        }

        #[test]
        fn lines_stay_within_half_a_pixel_of_the_straight_line(
            x0 in -60i32..100, y0 in -60i32..100, x1 in -60i32..100, y1 in -60i32..100,
        ) {
            let (dx, dy) = (f64::from(x1 - x0), f64::from(y1 - y0));
            let steps = dx.abs().max(dy.abs()).max(1.0);
            let actual = drawn(40, 30, |dst| draw_line(dst, x0, y0, x1, y1, WHITE));
            let mut expected: Vec<(i64, i64)> = (0..=steps as i64)
                .map(|step| {
                    // Halves go up, in the direction of the coordinate.
                    let along = |start: i32, d: f64| {
                        (f64::from(start) + d * step as f64 / steps + 0.5 + 1e-9).floor() as i64
                    };
                    (along(x0, dx), along(y0, dy))
                })
                .filter(|&(x, y)| (0..40).contains(&x) && (0..30).contains(&y))
                .collect();
            expected.sort_by_key(|&(x, y)| (y, x));
            expected.dedup();
            prop_assert_eq!(actual, expected);
        }
    }

    #[test]
    fn extreme_arguments_cost_nothing_and_draw_what_is_inside() {
        let (low, high) = (i32::MIN, i32::MAX);
        assert_eq!(drawn(5, 4, |dst| draw_line(dst, low, 2, high, 2, WHITE)).len(), 5);
        assert_eq!(drawn(5, 4, |dst| fill_rectangle(dst, low, low, high, high, WHITE)).len(), 0);
        assert_eq!(drawn(5, 4, |dst| fill_rectangle(dst, -9, -9, high, high, WHITE)).len(), 20);
        assert_eq!(drawn(5, 4, |dst| fill_circle(dst, 0.0, 0.0, 1e300, WHITE)).len(), 20);
        assert_eq!(drawn(5, 4, |dst| fill_circle(dst, 0.0, 0.0, 1e9, WHITE)).len(), 20);
        for (cx, r) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (1.0, f64::NAN), (1.0, -1.0), (1e30, 5.0)] {
            assert!(drawn(5, 4, |dst| fill_circle(dst, cx, 1.0, r, WHITE)).is_empty());
        }
    }
}
