//! Frames of odd sizes and strides for the tests of kernels, and checks that every kernel has to pass.

use proptest::prelude::*;

use crate::frame::{CHANNELS, Frame, FrameBuf, FrameMut};
use crate::simd::with_each;

/// A frame with gaps between its rows.
#[derive(Debug, Clone)]
pub struct Sample {
    bytes: Vec<u8>,
    width: usize,
    height: usize,
    stride: usize,
}

impl Sample {
    pub fn frame(&self) -> Frame<'_> {
        Frame::with_stride(&self.bytes, self.width, self.height, self.stride).unwrap()
    }
}

/// Frames of random size up to 70x20, random stride and random content: noise, or few values with hard edges.
pub fn samples() -> impl Strategy<Value = Sample> {
    (1usize..70, 1usize..20, 0usize..8, any::<bool>()).prop_flat_map(|(width, height, gap, hard)| {
        let stride = width * CHANNELS + gap;
        let value = any::<u8>().prop_map(move |v| if hard { (v & 1) * 255 } else { v });
        prop::collection::vec(value, stride * height).prop_map(move |bytes| Sample {
            bytes,
            width,
            height,
            stride,
        })
    })
}

/// Two frames of the same size and different stride.
pub fn pairs() -> impl Strategy<Value = (Sample, Sample)> {
    samples().prop_map(|first| {
        let mut second = first.clone();
        second.bytes.reverse();
        second.stride = second.width * CHANNELS;
        (first, second)
    })
}

/// Runs a kernel into a frame with gaps and into one without, with each set of instructions, and
/// into destinations with different old content. All results have to agree, and nothing beside the frame may change.
pub fn run(width: usize, height: usize, mut kernel: impl FnMut(FrameMut<'_>)) -> FrameBuf {
    let mut expected = FrameBuf::new(width, height);
    kernel(expected.as_mut());
    with_each(|instructions| {
        for (gap, filler) in [(0, 0xa5), (5, 0x5a), (5, 0xa5)] {
            let stride = width * CHANNELS + gap;
            let mut bytes = vec![filler; stride * height];
            kernel(FrameMut::with_stride(&mut bytes, width, height, stride).unwrap());
            let result = Frame::with_stride(&bytes, width, height, stride).unwrap();
            assert_eq!(result.to_buf().data(), expected.data(), "{instructions:?}, gap {gap}");
            for row in bytes.chunks(stride) {
                assert!(row[width * CHANNELS..].iter().all(|&v| v == filler), "wrote beside the frame");
            }
        }
    });
    expected
}

/// As [`run`], for a kernel with a source of the same size.
pub fn run_on(sample: &Sample, mut kernel: impl FnMut(Frame<'_>, FrameMut<'_>)) -> FrameBuf {
    run(sample.width, sample.height, |dst| kernel(sample.frame(), dst))
}

/// Computes a frame pixel by pixel, the plain way.
pub fn plain(src: Frame<'_>, mut pixel: impl FnMut(usize, usize) -> [u8; 3]) -> FrameBuf {
    let mut out = FrameBuf::new(src.width(), src.height());
    for y in 0..src.height() {
        for x in 0..src.width() {
            let value = pixel(x, y);
            out.as_mut().set_pixel(x, y, value);
        }
    }
    out
}
