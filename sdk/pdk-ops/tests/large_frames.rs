//! Frames of 3840x2160: inside the frame, a kernel gives what it gives on a crop.

// The exception for tests covers functions marked as tests, not their helpers.
#![allow(clippy::unwrap_used)]

use pdk_ops::{Frame, FrameBuf, FrameMut, average, blend, color, gaussian, hsv, noise, point, poisson};
use pdk_seed::Key;

const WIDTH: usize = 3840;
const HEIGHT: usize = 2160;
/// Where the crop starts and how large it is; it reaches the lower right corner of the frame.
const CROP: (usize, usize) = (WIDTH - 100, HEIGHT - 80);

fn large() -> FrameBuf {
    let mut bytes = vec![0; WIDTH * HEIGHT * 3];
    Key([6; 32]).sequence().fill(&mut bytes);
    FrameBuf::from_vec(bytes, WIDTH, HEIGHT).unwrap()
}

fn crop(frame: Frame<'_>) -> FrameBuf {
    let start = CROP.1 * frame.stride() + CROP.0 * 3;
    Frame::with_stride(&frame.data()[start..], WIDTH - CROP.0, HEIGHT - CROP.1, frame.stride())
        .unwrap()
        .to_buf()
}

/// Compares the crop of the result with the result on the crop, except within `reach` of the crop's inner edges.
fn same_on_a_crop(reach: usize, mut kernel: impl FnMut(Frame<'_>, FrameMut<'_>)) {
    let src = large();
    let small = crop(src.as_ref());
    let (mut of_large, mut of_small) =
        (FrameBuf::new(WIDTH, HEIGHT), FrameBuf::new(small.width(), small.height()));
    kernel(src.as_ref(), of_large.as_mut());
    kernel(small.as_ref(), of_small.as_mut());
    let of_large = crop(of_large.as_ref());
    for y in reach..small.height() {
        assert_eq!(of_large.as_ref().row(y)[reach * 3..], of_small.as_ref().row(y)[reach * 3..], "row {y}");
    }
}

#[test]
fn deterministic_kernels_reach_the_last_pixel() {
    let mut gaussian = gaussian::Workspace::default();
    same_on_a_crop(20, |src, dst| gaussian::gaussian_blur(src, dst, 41, &mut gaussian));
    let mut averages = average::Workspace::default();
    same_on_a_crop(12, |src, dst| average::disc_blur(src, dst, 12.0, &mut averages));
    same_on_a_crop(9, |src, dst| {
        average::pixel_average(src, dst, &[(-9, 3), (4, -2), (8, 0)], &mut averages)
    });
    same_on_a_crop(0, |src, dst| hsv::scale_hsv(src, dst, 0.7, 1.5));
    same_on_a_crop(0, |src, dst| point::scale_about(src, dst, 127.5, 1.7));
    same_on_a_crop(0, |src, dst| blend::blend_with_grey(src, dst, 0.55));
    same_on_a_crop(0, color::grayscale);
}

#[test]
fn random_kernels_reach_the_last_rows() {
    let src = large();
    let table = poisson::PoissonTable::new(30.0);
    let random = || Key([1; 32]).frame(0);
    type Kernel<'a> = &'a dyn Fn(Frame<'_>, FrameMut<'_>);
    let kernels: [Kernel<'_>; 4] = [
        &|src, dst| noise::gaussian_noise(src, dst, 0.2, &mut random()),
        &|src, dst| noise::speckle_noise(src, dst, 0.2, &mut random()),
        &|src, dst| poisson::poisson_noise(src, dst, &table, &mut random()),
        &|src, dst| noise::impulse_noise(src, dst, 1.0, noise::Impulses::WholePixels, &mut random()),
    ];
    for (i, kernel) in kernels.iter().enumerate() {
        let mut dst = FrameBuf::new(WIDTH, HEIGHT);
        kernel(src.as_ref(), dst.as_mut());
        let (before, after) = (crop(src.as_ref()), crop(dst.as_ref()));
        let last = before.as_ref().row(79).iter().zip(after.as_ref().row(79)).filter(|(a, b)| a != b).count();
        assert!(last > 150, "kernel {i} changed {last} of the last 300 values");
    }
}
