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
/// A pixel's position is its index, so the centre of the first pixel is (0, 0). Nothing where `r` is negative or
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

/// Fills the rectangle whose first pixel is (`x`, `y`). Nothing where `width` or `height` is not positive.
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
