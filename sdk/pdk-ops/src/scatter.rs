//! Pixels that change places with their neighbourhood.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::vectorised;
use pdk_seed::Key;

/// What [`scatter`] keeps between calls: where each pixel comes from, as long as nothing changes.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Width, height, distance and key that `sources` belong to.
    made_for: Option<(usize, usize, f64, Key)>,
    /// For each pixel the number of the pixel whose colour it takes.
    sources: Vec<u32>,
    /// The random bytes of a row.
    bytes: Vec<u8>,
}

/// Gives every pixel the colour of a pixel that is up to `distance` away in each direction; beyond the edges the
/// nearest pixel counts. All whole distances are equally likely; what `distance` has beyond a whole number makes the
/// outermost ones likelier from none to as likely as the others. Draws from the sequence stream of `key`.
///
/// # Panics
/// If the sizes of the frames differ, they have 2^32 pixels or more, or the distance is not within 0..=10000.
pub fn scatter(src: Frame<'_>, mut dst: FrameMut<'_>, distance: f64, key: Key, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "scatter between frames of different size");
    assert!((0.0..=10_000.0).contains(&distance), "scatter takes a distance of 0 to 10000, not {distance}");
    let (width, height) = (src.width(), src.height());
    assert!(u32::try_from(width * height).is_ok(), "scatter takes fewer than 2^32 pixels");
    let wanted = Some((width, height, distance, key));
    if workspace.made_for != wanted {
        draw(width, height, distance, key, workspace);
        workspace.made_for = wanted;
    }
    let sources = workspace.sources.chunks_exact(width);
    match src.contiguous() {
        Some(pixels) => {
            for (row, sources) in dst.rows_mut().zip(sources) {
                for (to, &source) in row.chunks_exact_mut(CHANNELS).zip(sources) {
                    let start = source as usize * CHANNELS;
                    to.copy_from_slice(&pixels[start..start + CHANNELS]);
                }
            }
        }
        None => {
            for (row, sources) in dst.rows_mut().zip(sources) {
                for (to, &source) in row.chunks_exact_mut(CHANNELS).zip(sources) {
                    let source = source as usize;
                    to.copy_from_slice(&src.pixel(source % width, source / width));
                }
            }
        }
    }
}

/// Draws where each pixel comes from: two 16-bit numbers for each, the one for the direction to the right first.
fn draw(width: usize, height: usize, distance: f64, key: Key, workspace: &mut Workspace) {
    let mut random = key.sequence();
    let Workspace { sources, bytes, .. } = workspace;
    sources.resize(width * height, 0);
    bytes.resize(width * 4, 0);
    let (scale, lowest) = ((2.0 * distance + 1.0) as f32 / 65536.0, (-distance - 0.5) as f32);
    for (y, row) in sources.chunks_exact_mut(width).enumerate() {
        random.fill(bytes);
        draw_row(bytes, row, y as i32, height as i32, scale, lowest);
    }
}

vectorised! {
    fn draw_row / draw_row_avx2 (
        bytes: &[u8], sources: &mut [u32], y: i32, height: i32, scale: f32, lowest: f32,
    ) {
        /// Adding this to a number of magnitude below 2^22 leaves it, rounded, in the lower bits.
        const SHIFT: f32 = 12_582_912.0;
        let offset = |number: i32| {
            let place = lowest + (number as f32 + 0.5) * scale;
            (place + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32
        };
        let width = sources.len() as i32;
        for ((x, source), bytes) in (0..).zip(sources).zip(bytes.chunks_exact(4)) {
            let number = i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            let column = (x + offset(number & 0xffff)).max(0).min(width - 1);
            let line = (y + offset(number >> 16 & 0xffff)).max(0).min(height - 1);
            *source = (line as u32).wrapping_mul(width as u32).wrapping_add(column as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{run_on, samples};

    /// How often each offset to the right occurs far from the edges.
    fn offsets(distance: f64) -> Vec<(i32, usize)> {
        let mut workspace = Workspace::default();
        draw(300, 300, distance, Key([3; 32]), &mut workspace);
        let mut counts = std::collections::BTreeMap::new();
        for y in 50..250 {
            for x in 50..250 {
                let column = workspace.sources[y * 300 + x] as i32 % 300;
                *counts.entry(column - x as i32).or_insert(0) += 1;
            }
        }
        counts.into_iter().collect()
    }

    #[test]
    fn whole_distances_are_equally_likely() {
        for distance in [0, 1, 2, 12] {
            let counts = offsets(f64::from(distance));
            assert_eq!(
                counts.iter().map(|c| c.0).collect::<Vec<_>>(),
                (-distance..=distance).collect::<Vec<_>>()
            );
            let expected = 40_000.0 / f64::from(2 * distance + 1);
            // Five standard deviations of a binomial distribution.
            let close = |count: usize| (count as f64 - expected).abs() <= 5.0 * expected.sqrt();
            assert!(counts.iter().all(|c| close(c.1)), "{distance}: {counts:?}");
        }
    }

    #[test]
    fn the_outermost_offsets_grow_with_the_fraction_of_the_distance() {
        let outermost = [1.1, 1.5, 1.9].map(|distance| {
            let counts = offsets(distance);
            assert_eq!(counts.len(), 5, "{counts:?}");
            counts[0].1
        });
        assert!(outermost[0] > 0 && outermost.is_sorted(), "{outermost:?}");
    }

    proptest! {
        #[test]
        fn every_colour_comes_from_within_the_distance(sample in samples(), distance in 0.0..30.0, key: [u8; 32]) {
            let src = sample.frame();
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| scatter(src, dst, distance, Key(key), &mut workspace));
            let reach = distance.ceil() as usize;
            for y in 0..src.height() {
                for x in 0..src.width() {
                    let source = workspace.sources[y * src.width() + x] as usize;
                    let (column, line) = (source % src.width(), source / src.width());
                    prop_assert!(column.abs_diff(x) <= reach && line.abs_diff(y) <= reach);
                    prop_assert_eq!(result.as_ref().pixel(x, y), src.pixel(column, line));
                }
            }
        }

        #[test]
        fn a_workspace_follows_size_distance_and_key(first in samples(), second in samples()) {
            let mut kept = Workspace::default();
            for (sample, distance, key) in [(&first, 3.0, 1), (&second, 3.0, 1), (&second, 4.0, 1), (&second, 4.0, 2)] {
                let result = run_on(sample, |src, dst| scatter(src, dst, distance, Key([key; 32]), &mut kept));
                let mut fresh = Workspace::default();
                let alone = run_on(sample, |src, dst| scatter(src, dst, distance, Key([key; 32]), &mut fresh));
                prop_assert_eq!(result, alone);
            }
        }
    }
}
