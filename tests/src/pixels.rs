//! What a perturbation changed in the pixels of a recorded scenario.

use std::ops::Range;
use std::path::Path;

use image::{GrayImage, Luma};
use pdk_record::trace::reader::{Entry, TraceReader};
use pdk_record::trace::step::ImageTopic;

/// By how much the brightest change of each pixel's channels is, in the first recorded frame of a trace.
///
/// # Panics
/// If the trace cannot be read, or has no images.
pub fn changes(trace: &Path) -> GrayImage {
    let frame = |topic| {
        let mut images = TraceReader::open(trace).unwrap().filter_map(|entry| match entry.unwrap() {
            Entry::Image(image) if image.topic == topic => Some(image.decode().unwrap()),
            _ => None,
        });
        images.next().unwrap()
    };
    let [raw, perturbed] = [ImageTopic::Raw, ImageTopic::Perturbed].map(frame);
    let (width, height) = (raw.width() as u32, raw.height() as u32);
    GrayImage::from_fn(width, height, |x, y| {
        let [a, b] = [&raw, &perturbed].map(|frame| frame.as_ref().pixel(x as usize, y as usize));
        Luma([a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max().unwrap()])
    })
}

/// The share of the pixels in some rows that were changed by more than the JPEG images of traces are apart anyway.
pub fn changed(changes: &GrayImage, rows: Range<u32>) -> f64 {
    let pixels = rows.len() as u32 * changes.width();
    let changed = changes.enumerate_pixels().filter(|(_, y, change)| rows.contains(y) && change[0] > 40);
    changed.count() as f64 / f64::from(pixels)
}
