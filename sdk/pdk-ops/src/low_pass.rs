//! A low-pass filter on brightness: hue and saturation stay sharp.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::gaussian::{self, gaussian_blur_plane};
use crate::hsv::{block_to_hsv, block_to_rgb};
use crate::planes::{BLOCK, BLOCK_BYTES, put_together, take_apart};
use crate::simd::vectorised;

/// What [`low_pass`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    hue: Vec<u8>,
    saturation: Vec<u8>,
    value: Vec<u8>,
    smooth: Vec<u8>,
    gaussian: gaussian::Workspace,
}

/// Blurs the value of hue, saturation and value with the Gaussian kernel of [`gaussian_blur_plane`], `kernel_size`
/// pixels wide (an even size counts as the next odd one).
///
/// # Panics
/// If the sizes of the frames differ.
pub fn low_pass(src: Frame<'_>, mut dst: FrameMut<'_>, kernel_size: usize, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "low_pass between frames of different size");
    let Workspace { hue, saturation, value, smooth, gaussian } = workspace;
    let width = src.width();
    for plane in [&mut *hue, &mut *saturation, &mut *value, &mut *smooth] {
        plane.resize(width * src.height(), 0);
    }
    let rows = hue.chunks_exact_mut(width).zip(saturation.chunks_exact_mut(width));
    for ((row, (hue, saturation)), value) in src.rows().zip(rows).zip(value.chunks_exact_mut(width)) {
        split_row(row, hue, saturation, value);
    }
    gaussian_blur_plane(value, smooth, width, kernel_size, gaussian);
    let rows = hue.chunks_exact(width).zip(saturation.chunks_exact(width));
    for ((row, (hue, saturation)), value) in dst.rows_mut().zip(rows).zip(smooth.chunks_exact(width)) {
        join_row(hue, saturation, value, row);
    }
}

vectorised! {
    fn split_row / split_row_avx2 / split_row_avx512 (
        from: &[u8], hue: &mut [u8], saturation: &mut [u8], value: &mut [u8],
    ) {
        let rows = hue.chunks_mut(BLOCK).zip(saturation.chunks_mut(BLOCK)).zip(value.chunks_mut(BLOCK));
        for (from, ((hue, saturation), value)) in from.chunks(BLOCK_BYTES).zip(rows) {
            let mut planes = take_apart(from);
            block_to_hsv(&mut planes);
            for (row, plane) in [hue, saturation, value].into_iter().zip(&planes) {
                row.copy_from_slice(&plane[..row.len()]);
            }
        }
    }
}

vectorised! {
    fn join_row / join_row_avx2 / join_row_avx512 (hue: &[u8], saturation: &[u8], value: &[u8], to: &mut [u8]) {
        let rows = hue.chunks(BLOCK).zip(saturation.chunks(BLOCK)).zip(value.chunks(BLOCK));
        for (to, ((hue, saturation), value)) in to.chunks_mut(BLOCK_BYTES).zip(rows) {
            let mut planes = [[0; BLOCK]; CHANNELS];
            for (row, plane) in [hue, saturation, value].into_iter().zip(&mut planes) {
                plane[..row.len()].copy_from_slice(row);
            }
            block_to_rgb(&mut planes);
            put_together(&planes, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::hsv::{hsv_to_rgb, rgb_to_hsv};
    use crate::testing::{plain, run_on, samples};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn matches_the_plain_version(sample in samples(), size in 1usize..45) {
            let src = sample.frame();
            let values: Vec<u8> = src.rows().flat_map(|row| row.chunks(3).map(|p| p[0].max(p[1]).max(p[2]))).collect();
            let mut smooth = vec![0; values.len()];
            gaussian_blur_plane(&values, &mut smooth, src.width(), size, &mut gaussian::Workspace::default());
            let expected = plain(src, |x, y| {
                let [h, s, _] = rgb_to_hsv(src.pixel(x, y));
                hsv_to_rgb([h, s, smooth[y * src.width() + x]])
            });
            let mut workspace = Workspace::default();
            prop_assert_eq!(run_on(&sample, |src, dst| low_pass(src, dst, size, &mut workspace)), expected);
        }
    }
}
