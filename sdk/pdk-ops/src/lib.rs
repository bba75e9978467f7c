//! Image kernels for pdk: what perturbations are made of.
//!
//! Everything works on 8-bit RGB frames, interleaved, row by row, with an optional stride. A kernel is a
//! function `op(src, dst, parameters)`: it reads `src`, writes all of `dst`, and allocates nothing unless its
//! documentation says that it keeps a workspace.
//!
//! Same input, same bytes: kernels use no operation whose result depends on the CPU, the number of threads or the
//! system's mathematical library. Transcendental functions come from [`libm`], random numbers from [`pdk_seed`].

pub mod affine;
pub mod average;
pub mod blend;
pub mod border;
pub mod canny;
pub mod canvas;
pub mod cells;
pub mod change;
pub mod color;
pub mod compare;
mod dct;
pub mod decal;
pub mod displacement;
pub mod draw;
pub mod edges;
pub mod elastic;
pub mod equalise;
pub mod false_color;
pub mod float;
pub mod float_hsv;
pub mod fog;
mod fourier;
pub mod frame;
pub mod gaussian;
mod halve;
pub mod hsv;
pub mod ice;
pub mod jpeg;
pub mod layer;
pub mod light;
pub mod low_pass;
pub mod mask;
pub mod motion;
pub mod noise;
pub mod overlay;
pub mod perspective;
pub mod phase;
mod planes;
pub mod point;
pub mod poisson;
pub mod posterize;
#[cfg(target_arch = "x86_64")]
pub mod processor;
pub mod resample;
pub mod resize;
pub mod rgbx;
pub mod sample;
pub mod saturation;
pub mod scatter;
pub mod sensor;
pub mod sharpen;
mod simd;
mod small_gaussian;
mod smooth;
mod table;
#[cfg(test)]
mod testing;
pub mod unsharp;
pub mod warp;
pub mod white_balance;
pub mod yuv;
pub mod zoom;

pub use frame::{Frame, FrameBuf, FrameError, FrameMut};
pub use simd::instructions_in_use;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
