//! `fast_image_resize`.

use fast_image_resize::images::{CroppedImageMut, Image, ImageRef};
use fast_image_resize::{FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer};
use kornia_image::ImageSize;

use crate::task::Work;
use crate::{Failed, Frame, Step, unknown};

pub fn step(work: &Work, size: ImageSize) -> Result<Step, Failed> {
    let options = |algorithm| ResizeOptions::new().resize_alg(algorithm);
    // As OpenCV interpolates: without averaging.
    let linear = options(ResizeAlg::Interpolation(FilterType::Bilinear));
    let mut resizer = Resizer::new();
    Ok(match *work {
        Work::Pixelate(small) => by_way_of(small, linear, linear)?,
        Work::Blocks(small) => {
            by_way_of(small, options(ResizeAlg::Convolution(FilterType::Box)), options(ResizeAlg::Nearest))?
        }
        Work::Centre(inner) => {
            let [left, top] = [(size.width - inner[0]) / 2, (size.height - inner[1]) / 2].map(u32::try_from);
            let (left, top, [width, height]) = (left?, top?, narrow(inner)?);
            Box::new(move |from, to| {
                to.as_slice_mut().fill(0);
                let mut to = target(to)?;
                let mut middle = CroppedImageMut::new(&mut to, left, top, width, height)?;
                Ok(resizer.resize(&source(from)?, &mut middle, &linear)?)
            })
        }
        Work::Reflect(rows) => {
            let [width, height] = narrow([size.width, size.height + rows])?;
            let mut stacked = Image::new(width, height, PixelType::U8x3);
            Box::new(move |from, to| {
                stack(from, rows, stacked.buffer_mut());
                Ok(resizer.resize(&stacked, &mut target(to)?, &linear)?)
            })
        }
        _ => return Err(unknown()),
    })
}

/// Resizes to a size and back.
fn by_way_of(small: [usize; 2], down: ResizeOptions, up: ResizeOptions) -> Result<Step, Failed> {
    let [width, height] = narrow(small)?;
    let (mut resizer, mut small) = (Resizer::new(), Image::new(width, height, PixelType::U8x3));
    Ok(Box::new(move |from, to| {
        resizer.resize(&source(from)?, &mut small, &down)?;
        Ok(resizer.resize(&small, &mut target(to)?, &up)?)
    }))
}

/// Writes the frame, and this many of its last rows upside down under it.
pub fn stack(frame: &Frame, rows: usize, to: &mut [u8]) {
    let (stride, frame) = (3 * frame.width(), frame.as_slice());
    let (above, below) = to.split_at_mut(frame.len());
    above.copy_from_slice(frame);
    for (to, from) in below.chunks_exact_mut(stride).zip(frame.chunks_exact(stride).rev().take(rows)) {
        to.copy_from_slice(from);
    }
}

fn source(frame: &Frame) -> Result<ImageRef<'_>, Failed> {
    let [width, height] = narrow([frame.width(), frame.height()])?;
    Ok(ImageRef::new(width, height, frame.as_slice(), PixelType::U8x3)?)
}

fn target(frame: &mut Frame) -> Result<Image<'_>, Failed> {
    let [width, height] = narrow([frame.width(), frame.height()])?;
    Ok(Image::from_slice_u8(width, height, frame.as_slice_mut(), PixelType::U8x3)?)
}

fn narrow([width, height]: [usize; 2]) -> Result<[u32; 2], Failed> {
    Ok([u32::try_from(width)?, u32::try_from(height)?])
}
