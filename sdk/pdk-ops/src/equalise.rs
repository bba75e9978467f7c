//! Contrast-limited adaptive histogram equalisation (CLAHE) of the brightness.
//!
//! The frame is divided into 8x8 tiles. Each has a curve that equalises its own histogram, no steeper than a limit
//! allows; a pixel's new value is interpolated between the curves of the four tiles whose centres surround it.
//! Zuiderveld, "Contrast limited adaptive histogram equalization" (1994).

use crate::border::reflect;
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::hsv::{block_to_hsv, block_to_rgb};
use crate::planes::{BLOCK, BLOCK_BYTES, put_together, take_apart};
use crate::simd::{round_inside_byte, round_to_byte, vectorised};

/// Tiles in each direction.
const TILES: usize = 8;

/// Cells between tile centres in each direction, those outside the outermost centres included.
const CELLS: usize = TILES + 1;

/// What [`equalise_value`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// The values of the frame, in rows of the padded width.
    values: Vec<u8>,
    /// The curve of each tile, row by row.
    curves: Vec<[u8; 256]>,
    /// For each cell the curves of the four tiles about it, one in each byte: top left (lowest), top right, bottom left,
    /// bottom right.
    cells: Vec<[u32; 256]>,
    /// How far each column lies from the tile centres on its left, in tiles.
    shares: Vec<f32>,
    /// The curves' values for the pixels of a row.
    found: Vec<u32>,
    /// New values of a row.
    new_values: Vec<u8>,
}

/// The size that a side of `len` pixels is padded to. `other` is the other side: where either is not a multiple of the
/// number of tiles, both are padded, as published.
fn padded(len: usize, other: usize) -> usize {
    if len.is_multiple_of(TILES) && other.is_multiple_of(TILES) { len } else { len + TILES - len % TILES }
}

/// Equalises the value in HSV; hue and saturation keep the steps of 8-bit HSV. `limit` is the largest share that a value
/// may have in a tile's histogram, as a multiple of its share in a flat one; what exceeds it is spread over all values.
///
/// # Panics
/// If the sizes differ.
pub fn equalise_value(src: Frame<'_>, mut dst: FrameMut<'_>, limit: f64, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "equalisation between frames of different size");
    let (width, height) = (src.width(), src.height());
    let (full_width, full_height) = (padded(width, height), padded(height, width));
    let (tile_width, tile_height) = (full_width / TILES, full_height / TILES);
    let Workspace { values, curves, cells, shares, found, new_values } = workspace;

    values.resize(full_width * height, 0);
    for (y, row) in values.chunks_exact_mut(full_width).enumerate() {
        row_values(src.row(y), &mut row[..width]);
        for x in width..full_width {
            row[x] = row[reflect(x as isize, width)];
        }
    }

    curves.resize(TILES * TILES, [0; 256]);
    for (tile, curve) in curves.iter_mut().enumerate() {
        let (left, top) = (tile % TILES * tile_width, tile / TILES * tile_height);
        let rows = (top..top + tile_height).map(|y| {
            let start = reflect(y as isize, height) * full_width + left;
            &values[start..start + tile_width]
        });
        *curve = curve_of(histogram(rows), tile_width * tile_height, limit);
    }
    gather_cells(curves, cells);

    shares.clear();
    shares.extend((0..width).map(|x| cell_and_share(x, tile_width).1));
    found.resize(width, 0);
    new_values.resize(width.next_multiple_of(BLOCK), 0);
    for y in 0..height {
        let row = &values[y * full_width..][..width];
        let (cell_row, down) = cell_and_share(y, tile_height);
        let mut start = 0;
        for (column, cell) in cells[cell_row * CELLS..][..CELLS].iter().enumerate() {
            // The cell ends at the first column that lies at or beyond the next tile centre.
            let end = ((2 * column + 1) * tile_width).div_ceil(2).min(width);
            for (found, &value) in found[start..end].iter_mut().zip(&row[start..end]) {
                *found = cell[usize::from(value)];
            }
            start = end;
        }
        interpolate(found, shares, down, &mut new_values[..width]);
        replace_values(src.row(y), dst.row_mut(y), new_values);
    }
}

/// The cell, from 0, in which a row or column lies, and how far it lies from the cell's lower end, in tiles.
fn cell_and_share(position: usize, tile: usize) -> (usize, f32) {
    let centre = position as f32 / tile as f32 - 0.5;
    // No smaller than a half, so that dropping the fraction is rounding down.
    let cell = (centre + 1.0) as usize;
    (cell, centre - (cell as f32 - 1.0))
}

/// How often each value occurs.
fn histogram<'a>(rows: impl Iterator<Item = &'a [u8]>) -> [u32; 256] {
    // Neighbouring pixels are often equal; several tables keep them from waiting for each other.
    let mut tables = [[0u32; 256]; 4];
    for row in rows {
        let quads = row.chunks_exact(4);
        for &value in quads.remainder() {
            tables[0][usize::from(value)] += 1;
        }
        for quad in quads {
            tables[0][usize::from(quad[0])] += 1;
            tables[1][usize::from(quad[1])] += 1;
            tables[2][usize::from(quad[2])] += 1;
            tables[3][usize::from(quad[3])] += 1;
        }
    }
    let [a, b, c, d] = &tables;
    std::array::from_fn(|value| a[value] + b[value] + c[value] + d[value])
}

/// The curve that equalises a histogram of `area` pixels under the limit.
fn curve_of(mut histogram: [u32; 256], area: usize, limit: f64) -> [u8; 256] {
    let most = ((limit * area as f64 / 256.0) as u32).max(1);
    let excess: u32 = histogram.iter().map(|&count| count.saturating_sub(most)).sum();
    let (share, rest) = (excess / 256, excess as usize % 256);
    histogram.iter_mut().for_each(|count| *count = (*count).min(most) + share);
    if let Some(spacing) = 256usize.checked_div(rest) {
        histogram.iter_mut().step_by(spacing).take(rest).for_each(|count| *count += 1);
    }
    let scale = 255.0 / area as f32;
    let mut sum = 0;
    histogram.map(|count| {
        sum += count;
        round_to_byte(sum as f32 * scale)
    })
}

/// Puts the four curves about each cell together. Beyond the outermost tile centres the outermost curves go on.
fn gather_cells(curves: &[[u8; 256]], cells: &mut Vec<[u32; 256]>) {
    cells.resize(CELLS * CELLS, [0; 256]);
    for (index, cell) in cells.iter_mut().enumerate() {
        let (column, row) = (index % CELLS, index / CELLS);
        let (left, right) = (column.saturating_sub(1), column.min(TILES - 1));
        let (top, bottom) = (row.saturating_sub(1), row.min(TILES - 1));
        let [a, b, c, d] = [(top, left), (top, right), (bottom, left), (bottom, right)]
            .map(|(row, column)| &curves[row * TILES + column]);
        for (value, entry) in cell.iter_mut().enumerate() {
            *entry = u32::from_le_bytes([a[value], b[value], c[value], d[value]]);
        }
    }
}

vectorised! {
    fn row_values / row_values_avx2 / row_values_avx512 (from: &[u8], values: &mut [u8]) {
        for (value, pixel) in values.iter_mut().zip(from.chunks_exact(CHANNELS)) {
            *value = pixel[0].max(pixel[1]).max(pixel[2]);
        }
    }
}

vectorised! {
    fn interpolate / interpolate_avx2 / interpolate_avx512 (
        found: &[u32], shares: &[f32], down: f32, values: &mut [u8],
    ) {
        for ((value, &found), &right) in values.iter_mut().zip(found).zip(shares) {
            let corner = |byte: u32| (found >> (8 * byte) & 255) as i32 as f32;
            let top = corner(0) * (1.0 - right) + corner(1) * right;
            let bottom = corner(2) * (1.0 - right) + corner(3) * right;
            *value = round_inside_byte(top * (1.0 - down) + bottom * down);
        }
    }
}

vectorised! {
    fn replace_values / replace_values_avx2 / replace_values_avx512 (
        from: &[u8], to: &mut [u8], values: &[u8],
    ) {
        let blocks = from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES));
        for ((from, to), values) in blocks.zip(values.as_chunks().0) {
            let mut planes = take_apart(from);
            block_to_hsv(&mut planes);
            planes[2] = *values;
            block_to_rgb(&mut planes);
            put_together(&planes, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::hsv::{hsv_to_rgb, rgb_to_hsv};
    use crate::testing::{plain, run_on, samples};

    /// The whole method pixel by pixel, with the same two roundings in single precision.
    fn plain_equalise(src: Frame<'_>, limit: f64) -> FrameBuf {
        let (width, height) = (src.width(), src.height());
        let whole = width % 8 == 0 && height % 8 == 0;
        let pad = |len: usize| if whole { len } else { (len / 8 + 1) * 8 };
        let (wide, high) = (pad(width), pad(height));
        let value = |x: usize, y: usize| rgb_to_hsv(src.pixel(x, y))[2];
        let value_padded =
            |x: usize, y: usize| value(reflect(x as isize, width), reflect(y as isize, height));
        let (tile_wide, tile_high) = (wide / 8, high / 8);
        let curve = |tile_x: usize, tile_y: usize| {
            let mut counts = vec![0usize; 256];
            for y in 0..tile_high {
                for x in 0..tile_wide {
                    counts[usize::from(value_padded(tile_x * tile_wide + x, tile_y * tile_high + y))] += 1;
                }
            }
            let area = tile_wide * tile_high;
            let most = ((limit * area as f64 / 256.0) as usize).max(1);
            let mut excess = 0;
            for count in &mut counts {
                while *count > most {
                    *count -= 1;
                    excess += 1;
                }
            }
            (0..excess / 256 * 256).for_each(|i| counts[i % 256] += 1);
            let rest = excess % 256;
            (0..rest).for_each(|i| counts[i * (256 / rest).max(1)] += 1);
            let mut sum = 0;
            counts
                .iter()
                .map(|c| {
                    sum += c;
                    (sum as f32 * (255.0 / area as f32)).round_ties_even()
                })
                .collect::<Vec<f32>>()
        };
        let curves: Vec<Vec<f32>> = (0..64).map(|tile| curve(tile % 8, tile / 8)).collect();
        plain(src, |x, y| {
            let place = |p: usize, tile: usize| {
                let centre = p as f32 / tile as f32 - 0.5;
                let low = centre.floor();
                (low.max(0.0) as usize, (low + 1.0).min(7.0) as usize, centre - low)
            };
            let (left, right, across) = place(x, tile_wide);
            let (top, bottom, down) = place(y, tile_high);
            let [hue, saturation, value] = rgb_to_hsv(src.pixel(x, y));
            let at = |tile_x: usize, tile_y: usize| curves[tile_y * 8 + tile_x][usize::from(value)];
            let upper = at(left, top) * (1.0 - across) + at(right, top) * across;
            let lower = at(left, bottom) * (1.0 - across) + at(right, bottom) * across;
            hsv_to_rgb([hue, saturation, (upper * (1.0 - down) + lower * down).round_ties_even() as u8])
        })
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), limit in 0.0..20.0) {
            let mut workspace = Workspace::default();
            let actual = run_on(&sample, |src, dst| equalise_value(src, dst, limit, &mut workspace));
            prop_assert_eq!(actual, plain_equalise(sample.frame(), limit));
        }
    }

    #[test]
    fn matches_the_plain_version_on_larger_frames_with_one_workspace() {
        let mut workspace = Workspace::default();
        let mut random = pdk_seed::Key([1; 32]).sequence();
        for (width, height) in [(160, 120), (161, 97), (64, 64), (97, 200), (320, 9)] {
            let mut pixels = vec![0; width * height * 3];
            random.fill(&mut pixels);
            pixels.iter_mut().enumerate().for_each(|(i, v)| *v = *v / 4 + (i / 900 % 150) as u8);
            let src = FrameBuf::from_vec(pixels, width, height).unwrap();
            let mut dst = FrameBuf::new(width, height);
            for limit in [1.0, 3.0, 10.0] {
                equalise_value(src.as_ref(), dst.as_mut(), limit, &mut workspace);
                assert_eq!(dst, plain_equalise(src.as_ref(), limit), "{width}x{height}");
            }
        }
    }
}
