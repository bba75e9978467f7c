//! libblur.

use kornia_image::ImageSize;
use libblur::{
    BlurImage, BlurImageMut, ConvolutionMode, EdgeMode, EdgeMode2D, FastBlurChannels, GaussianBlurParams,
    KernelShape, Scalar, ThreadingPolicy, filter_2d, gaussian_blur,
};

use crate::task::{Edge, Gaussian, Work};
use crate::{Failed, Frame, Step, unknown};

pub fn step(work: &Work, size: ImageSize) -> Result<Step, Failed> {
    Ok(match *work {
        Work::Gaussian { kernel, edge } => gaussian(kernel, edge)?,
        Work::HighPass(kernel) => {
            let mut blur = gaussian(kernel, Edge::Mirrored)?;
            let mut blurred = Frame::from_size_val(size, 0)?;
            Box::new(move |from, to| {
                blur(from, &mut blurred)?;
                sharpen(from, &blurred, to);
                Ok(())
            })
        }
        Work::Filter { side, ref weights, edge } => {
            let (weights, shape, edge) = (weights.clone(), KernelShape::new(side, side), mode(edge));
            Box::new(move |from, to| {
                let (from, mut to) = (source(from)?, target(to)?);
                filter_2d(&from, &mut to, &weights, shape, edge, Scalar::default(), ThreadingPolicy::Single)?;
                Ok(())
            })
        }
        _ => return Err(unknown()),
    })
}

fn gaussian(kernel: Gaussian, edge: Edge) -> Result<Step, Failed> {
    let kernel = GaussianBlurParams::new(u32::try_from(kernel.size)?, kernel.sigma);
    let edge = mode(edge);
    Ok(Box::new(move |from, to| {
        let (from, mut to) = (source(from)?, target(to)?);
        gaussian_blur(&from, &mut to, kernel, edge, ThreadingPolicy::Single, ConvolutionMode::FixedPoint)?;
        Ok(())
    }))
}

/// Twice the frame less its blur.
pub fn sharpen(frame: &Frame, blurred: &Frame, to: &mut Frame) {
    let pairs = frame.as_slice().iter().zip(blurred.as_slice());
    for (to, (&value, &blurred)) in to.as_slice_mut().iter_mut().zip(pairs) {
        *to =
            value.saturating_add(value.saturating_sub(blurred)).saturating_sub(blurred.saturating_sub(value));
    }
}

fn mode(edge: Edge) -> EdgeMode2D {
    EdgeMode2D::new(match edge {
        Edge::Mirrored => EdgeMode::Reflect101,
        Edge::Nearest => EdgeMode::Clamp,
    })
}

fn source(frame: &Frame) -> Result<BlurImage<'_, u8>, Failed> {
    let (width, height) = (u32::try_from(frame.width())?, u32::try_from(frame.height())?);
    Ok(BlurImage::borrow(frame.as_slice(), width, height, FastBlurChannels::Channels3))
}

fn target(frame: &mut Frame) -> Result<BlurImageMut<'_, u8>, Failed> {
    let (width, height) = (u32::try_from(frame.width())?, u32::try_from(frame.height())?);
    Ok(BlurImageMut::borrow(frame.as_slice_mut(), width, height, FastBlurChannels::Channels3))
}
