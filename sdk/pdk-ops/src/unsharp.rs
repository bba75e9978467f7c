//! The unsharp mask: twice the image less its Gaussian blur.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::gaussian::sigma_of_kernel;
use crate::simd::vectorised;
use crate::smooth::{self, Kernel, Size, WEIGHT_BITS, smooth};

/// The blur has this many fractional bits after its vertical pass.
const FINER: u32 = 6;
/// The fractional bits of the blur.
const BLUR_BITS: u32 = WEIGHT_BITS + FINER;

/// What [`unsharp_mask`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    size: usize,
    kernel: Kernel,
    smooth: smooth::Workspace,
}

/// `2 * src - blur`, clipped, the fraction dropped. The blur is a Gaussian of `kernel_size` pixels (an even size counts
/// as the next odd one) with the standard deviation [`sigma_of_kernel`], mirrored at the edges without repeating them,
/// to within a hundredth of a grey level. A constant frame stays as it is.
///
/// # Panics
/// If the sizes of the frames differ.
pub fn unsharp_mask(src: Frame<'_>, mut dst: FrameMut<'_>, kernel_size: usize, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "unsharp_mask between frames of different size");
    let size = kernel_size | 1;
    if workspace.size != size {
        workspace.kernel.set_gaussian(size, sigma_of_kernel(size));
        workspace.size = size;
    }
    smooth(
        Size { width: src.width(), height: src.height(), channels: CHANNELS },
        &workspace.kernel,
        FINER,
        |y, start, to| widen(&src.row(y)[start..], to),
        |y, blur| subtract(src.row(y), blur, dst.row_mut(y)),
        &mut workspace.smooth,
    );
}

vectorised! {
    fn widen / widen_avx2 / widen_avx512 (row: &[u8], into: &mut [i16]) {
        for (into, &value) in into.iter_mut().zip(row) {
            *into = i16::from(value);
        }
    }
}

vectorised! {
    fn subtract / subtract_avx2 / subtract_avx512 (row: &[u8], blur: &[i32], out: &mut [u8]) {
        for ((out, &value), &blur) in out.iter_mut().zip(row).zip(blur) {
            let rest = (i32::from(value) << (BLUR_BITS + 1)) - blur;
            *out = (rest >> BLUR_BITS).clamp(0, 255) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::border::reflect;
    use crate::testing::{run_on, samples};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn matches_floating_point(sample in samples(), size in 1usize..120) {
            let src = sample.frame();
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| unsharp_mask(src, dst, size, &mut workspace));
            let radius = size as isize / 2;
            let sigma = sigma_of_kernel(size | 1);
            let weights: Vec<f64> =
                (-radius..=radius).map(|x| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma))).collect();
            let total: f64 = weights.iter().sum();
            let (width, height) = (src.width(), src.height());
            let mut across = vec![[0.0; 3]; width * height];
            for (i, sums) in across.iter_mut().enumerate() {
                for (d, weight) in (-radius..=radius).zip(&weights) {
                    let pixel = src.pixel(reflect((i % width) as isize + d, width), i / width);
                    (0..3).for_each(|c| sums[c] += weight / total * f64::from(pixel[c]));
                }
            }
            for y in 0..height {
                for x in 0..width {
                    let row = |d: isize| &across[reflect(y as isize + d, height) * width + x];
                    let mut blur = [0.0; 3];
                    for (d, weight) in (-radius..=radius).zip(&weights) {
                        blur.iter_mut().zip(row(d)).for_each(|(blur, v)| *blur += weight / total * v);
                    }
                    let pixels = src.pixel(x, y).into_iter().zip(result.as_ref().pixel(x, y));
                    for ((value, actual), blur) in pixels.zip(blur) {
                        let exact = 2.0 * f64::from(value) - blur;
                        let [low, high] = [-0.04, 0.04].map(|e| (exact + e).clamp(0.0, 255.0) as u8);
                        prop_assert!((low..=high).contains(&actual), "{} instead of {}", actual, exact);
                    }
                }
            }
        }
    }

    #[test]
    fn a_constant_frame_stays_constant() {
        for value in [0, 1, 128, 254, 255] {
            let src = crate::FrameBuf::from_vec(vec![value; 50 * 20 * 3], 50, 20).unwrap();
            for size in [1, 3, 35, 113, 200] {
                let mut dst = crate::FrameBuf::new(50, 20);
                unsharp_mask(src.as_ref(), dst.as_mut(), size, &mut Workspace::default());
                assert_eq!(src, dst, "{value} {size}");
            }
        }
    }
}
