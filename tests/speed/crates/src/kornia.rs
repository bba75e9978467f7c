//! kornia-rs. Its functions for bytes, except for hue, saturation and value, which it has for floats only; its Gaussian blur for floats
//! takes what lies beyond the edges for black, which is another picture. What lies between two of its functions is a plain loop.

use kornia_image::{Image, ImageSize};
use kornia_imgproc::canny::canny;
use kornia_imgproc::clahe::clahe;
use kornia_imgproc::color::{gray_from_rgb_u8, hsv_from_rgb_f32, rgb_from_gray, rgb_from_hsv_f32};
use kornia_imgproc::filter::gaussian_blur_u8;
use kornia_imgproc::interpolation::InterpolationMode;
use kornia_imgproc::resize::resize_fast_rgb_aa;
use kornia_imgproc::warp::warp_affine_u8;

use crate::blur::sharpen;
use crate::resize::stack;
use crate::task::{Change, Gaussian, Work};
use crate::{Failed, Frame, Step, unknown};

/// A channel in bytes.
type Plane = Image<u8, 1>;

pub fn step(work: &Work, size: ImageSize) -> Result<Step, Failed> {
    let frame = |[width, height]: [usize; 2]| Frame::from_size_val(ImageSize { width, height }, 0);
    Ok(match *work {
        // It repeats the last pixel, whatever the edge is.
        Work::Gaussian { kernel, .. } => Box::new(move |from, to| blur(from, to, kernel)),
        Work::HighPass(kernel) => {
            let mut blurred = Frame::from_size_val(size, 0)?;
            Box::new(move |from, to| {
                blur(from, &mut blurred, kernel)?;
                sharpen(from, &blurred, to);
                Ok(())
            })
        }
        Work::LowPass(kernel) => in_value(size, move |from, to| blur(from, to, kernel))?,
        Work::Equalise(limit) => in_value(size, move |from, to| Ok(clahe(from, to, limit, (TILES, TILES))?))?,
        Work::Pixelate(small) => {
            let mut small = frame(small)?;
            Box::new(move |from, to| {
                resize(from, &mut small)?;
                resize(&small, to)
            })
        }
        Work::Centre(inner) => {
            let mut small = frame(inner)?;
            Box::new(move |from, to| {
                resize(from, &mut small)?;
                centre(&small, to);
                Ok(())
            })
        }
        Work::Reflect(rows) => {
            let mut stacked = frame([size.width, size.height + rows])?;
            Box::new(move |from, to| {
                stack(from, rows, stacked.as_slice_mut());
                resize(&stacked, to)
            })
        }
        Work::Warp(matrix) => Box::new(move |from, to| Ok(warp_affine_u8(from, to, &matrix)?)),
        Work::Hsv { saturation, value } => {
            let mut hsv = Hsv::new(size)?;
            Box::new(move |from, to| {
                hsv.read(from)?;
                for pixel in hsv.pixels() {
                    pixel[1] = saturation.of(pixel[1]);
                    pixel[2] = value.of(pixel[2]);
                }
                hsv.write(to)
            })
        }
        Work::Grey(weight) => {
            let mut grey = Plane::from_size_val(size, 0)?;
            let weight = share(weight);
            let kept = 256 - weight;
            Box::new(move |from, to| {
                gray_from_rgb_u8(from, &mut grey)?;
                rgb_from_gray(&grey, to)?;
                for (to, &from) in to.as_slice_mut().iter_mut().zip(from.as_slice()) {
                    *to = rounded(u16::from(from) * kept + u16::from(*to) * weight);
                }
                Ok(())
            })
        }
        Work::Edges { low, high, weight } => {
            let (mut grey, mut edges) = (Plane::from_size_val(size, 0)?, Plane::from_size_val(size, 0)?);
            let weight = share(weight);
            let kept = 256 - weight;
            Box::new(move |from, to| {
                gray_from_rgb_u8(from, &mut grey)?;
                canny(&grey, &mut edges, low, high, false)?;
                let pixels = from.as_slice().as_chunks::<3>().0.iter().zip(edges.as_slice());
                for (to, (from, &edge)) in to.as_slice_mut().as_chunks_mut::<3>().0.iter_mut().zip(pixels) {
                    let [red, green, blue] = from.map(|value| u16::from(value) * kept);
                    *to = [red + u16::from(edge) * weight, green, blue].map(rounded);
                }
                Ok(())
            })
        }
        Work::Filter { .. } | Work::Blocks(_) => return Err(unknown()),
    })
}

/// Tiles of an equalisation across and down.
const TILES: usize = 8;

fn blur<const C: usize>(from: &Image<u8, C>, to: &mut Image<u8, C>, kernel: Gaussian) -> Result<(), Failed> {
    #[allow(clippy::cast_possible_truncation)] // It takes singles.
    let sigma = kernel.sigma as f32;
    Ok(gaussian_blur_u8(from, to, (kernel.size, kernel.size), (sigma, sigma))?)
}

/// Interpolates linearly, without averaging.
fn resize(from: &Frame, to: &mut Frame) -> Result<(), Failed> {
    Ok(resize_fast_rgb_aa(from, to, InterpolationMode::Bilinear, false)?)
}

/// Puts a picture in the middle of black.
fn centre(small: &Frame, to: &mut Frame) {
    let (left, top) = ((to.width() - small.width()) / 2, (to.height() - small.height()) / 2);
    let (inner, stride) = (3 * small.width(), 3 * to.width());
    to.as_slice_mut().fill(0);
    let rows = to.as_slice_mut().chunks_exact_mut(stride).skip(top);
    for (to, from) in rows.zip(small.as_slice().chunks_exact(inner)) {
        to[3 * left..][..inner].copy_from_slice(from);
    }
}

/// Changes the value of hue, saturation and value, in bytes.
fn in_value(
    size: ImageSize,
    mut change: impl FnMut(&Plane, &mut Plane) -> Result<(), Failed> + 'static,
) -> Result<Step, Failed> {
    let mut hsv = Hsv::new(size)?;
    let (mut value, mut changed) = (Plane::from_size_val(size, 0)?, Plane::from_size_val(size, 0)?);
    Ok(Box::new(move |from, to| {
        for (to, &[red, green, blue]) in value.as_slice_mut().iter_mut().zip(from.as_slice().as_chunks().0) {
            *to = red.max(green).max(blue);
        }
        change(&value, &mut changed)?;
        hsv.read(from)?;
        for (pixel, &value) in hsv.pixels().iter_mut().zip(changed.as_slice()) {
            pixel[2] = f32::from(value);
        }
        hsv.write(to)
    }))
}

/// Hue, saturation and value, each from 0 to 255.
struct Hsv {
    rgb: Image<f32, 3>,
    hsv: Image<f32, 3>,
}

impl Hsv {
    fn new(size: ImageSize) -> Result<Self, Failed> {
        Ok(Self { rgb: Image::from_size_val(size, 0.0)?, hsv: Image::from_size_val(size, 0.0)? })
    }

    fn read(&mut self, from: &Frame) -> Result<(), Failed> {
        for (to, &from) in self.rgb.as_slice_mut().iter_mut().zip(from.as_slice()) {
            *to = f32::from(from);
        }
        Ok(hsv_from_rgb_f32(&self.rgb, &mut self.hsv)?)
    }

    fn pixels(&mut self) -> &mut [[f32; 3]] {
        self.hsv.as_slice_mut().as_chunks_mut().0
    }

    fn write(&mut self, to: &mut Frame) -> Result<(), Failed> {
        rgb_from_hsv_f32(&self.hsv, &mut self.rgb)?;
        for (to, &from) in to.as_slice_mut().iter_mut().zip(self.rgb.as_slice()) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // From 0 to 255.
            let byte = (from + 0.5) as u8;
            *to = byte;
        }
        Ok(())
    }
}

impl Change {
    fn of(self, value: f32) -> f32 {
        (self.factor * value + 255.0 * self.added).clamp(0.0, 255.0)
    }
}

/// A weight in parts of 256.
fn share(weight: f32) -> u16 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // From 0 to 256.
    let share = (256.0 * weight).round() as u16;
    share
}

/// The nearest byte of a sum of bytes whose weights come to no more than 256.
fn rounded(sum: u16) -> u8 {
    #[allow(clippy::cast_possible_truncation)] // No more than 255.
    let byte = ((sum + (1 << 7)) >> 8) as u8;
    byte
}
