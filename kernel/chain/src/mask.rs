//! How much of each pixel a perturbation changes, if it is limited to a region.

use image::imageops::{FilterType, resize};
use image::{GrayImage, Luma};
use pdk_model::region::Region;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{Frame, FrameMut};

/// A region made ready for frames of one size.
pub struct Mask {
    region: Region,
    /// The weights in the image of [`Region::Mask`], at its own size.
    image: Option<GrayImage>,
    /// How much of each pixel is changed, 0 to 255, row by row.
    weights: Vec<u8>,
    width: usize,
    height: usize,
    inverted: bool,
}

impl Mask {
    /// Reads what the region needs.
    ///
    /// # Errors
    /// If its image cannot be read.
    pub fn new(region: &Region) -> Result<Self> {
        let image = match region {
            Region::Mask(path) => Some(read_weights(path)?),
            _ => None,
        };
        Ok(Self { region: region.clone(), image, weights: Vec::new(), width: 0, height: 0, inverted: false })
    }

    /// A box in shares of the frame, or everything outside of it.
    pub fn of_box(area: [f64; 4], inverted: bool) -> Self {
        let region = Region::Box(area);
        Self { region, image: None, weights: Vec::new(), width: 0, height: 0, inverted }
    }

    /// How much of each pixel of a frame of this size is changed, 0 to 255, row by row.
    pub fn weights(&mut self, width: usize, height: usize) -> &[u8] {
        self.fit(width, height);
        &self.weights
    }

    fn fit(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) {
            return;
        }
        (self.width, self.height) = (width, height);
        self.weights.clear();
        if let Some(image) = &self.image {
            // Linear between pixels where it grows, a mean over them where it shrinks.
            self.weights = resize(image, width as u32, height as u32, FilterType::Triangle).into_raw();
            return;
        }
        self.weights.reserve(width * height);
        for y in 0..height {
            let v = (y as f64 + 0.5) / height as f64;
            for x in 0..width {
                let u = (x as f64 + 0.5) / width as f64;
                let within = match &self.region {
                    Region::Box([left, top, right, bottom]) => {
                        u >= *left && u < *right && v >= *top && v < *bottom
                    }
                    Region::Polygon(corners) => inside(corners, u, v),
                    Region::Mask(_) => false,
                };
                self.weights.push(u8::from(within != self.inverted) * 255);
            }
        }
    }
}

/// Puts the original back where the weights, 0 to 255, row by row, say so.
pub fn restore(original: Frame<'_>, mut perturbed: FrameMut<'_>, weights: &[u8]) {
    let width = original.width();
    for y in 0..original.height() {
        let weights = &weights[y * width..][..width];
        let (from, to) = (original.row(y), perturbed.row_mut(y));
        for ((weight, from), to) in weights.iter().zip(from.chunks_exact(3)).zip(to.chunks_exact_mut(3)) {
            match weight {
                255 => {}
                0 => to.copy_from_slice(from),
                weight => {
                    for (from, to) in from.iter().zip(to) {
                        let sum = u32::from(*to) * u32::from(*weight)
                            + u32::from(*from) * (255 - u32::from(*weight));
                        *to = ((sum + 127) / 255) as u8;
                    }
                }
            }
        }
    }
}

/// The even-odd rule: a ray to the left crosses an odd number of sides.
fn inside(corners: &[[f64; 2]], x: f64, y: f64) -> bool {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let crossed = sides
        .filter(|([ax, ay], [bx, by])| (ay > &y) != (by > &y) && x > ax + (y - ay) / (by - ay) * (bx - ax));
    crossed.count() % 2 == 1
}

/// The weights that an image file says: brightness times alpha.
fn read_weights(path: &str) -> Result<GrayImage> {
    let (image, alpha) = pdk_image::read_with_alpha(path.as_ref())?;
    Ok(GrayImage::from_fn(image.width() as u32, image.height() as u32, |x, y| {
        let (x, y) = (x as usize, y as usize);
        let [red, green, blue] = image.as_ref().pixel(x, y).map(u32::from);
        let brightness = (red * 299 + green * 587 + blue * 114 + 500) / 1000;
        let alpha = u32::from(alpha[y * image.width() + x]);
        Luma([((brightness * alpha + 127) / 255) as u8])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::FrameBuf;
    use serde_json::{Value, json};

    fn changed(region: Value, width: usize, height: usize) -> Vec<u8> {
        let original = FrameBuf::new(width, height);
        let mut perturbed = original.clone();
        perturbed.as_mut().rows_mut().for_each(|row| row.fill(200));
        let region = Region::from_json(&region).unwrap();
        let mut mask = Mask::new(&region).unwrap();
        restore(original.as_ref(), perturbed.as_mut(), mask.weights(width, height));
        perturbed.data().chunks(3).map(|pixel| pixel[0]).collect()
    }

    #[test]
    fn only_the_region_is_changed() {
        assert_eq!(changed(json!({"box": [0.5, 0.0, 1.0, 0.5]}), 4, 2), [0, 0, 200, 200, 0, 0, 0, 0]);
        let triangle = changed(json!({"polygon": [[0, 0], [0.9, 0], [0, 0.9]]}), 4, 4);
        assert_eq!(triangle[0], 200);
        assert_eq!(triangle[15], 0);
        assert_eq!(triangle.iter().filter(|v| **v == 200).count(), 6);
    }

    #[test]
    fn a_mask_image_blends() {
        let path = std::env::temp_dir().join(format!("pdk-mask-{}.png", std::process::id()));
        let mut mask = FrameBuf::new(3, 1);
        for (x, grey) in [0, 128, 255].into_iter().enumerate() {
            mask.as_mut().set_pixel(x, 0, [grey; 3]);
        }
        pdk_image::write(&path, mask.as_ref()).unwrap();
        assert_eq!(changed(json!({"mask": path}), 3, 1), [0, 100, 200]);
        std::fs::remove_file(path).unwrap();
    }

    /// What a mask with these pixels (one line of grey and alpha) leaves of 200 on a frame of this width.
    fn changed_through(pixels: &[[u8; 2]], width: usize) -> Vec<u8> {
        let path = std::env::temp_dir().join(format!("pdk-mask-{}-{}.png", std::process::id(), pixels.len()));
        let pixel = |x: u32| {
            let [grey, alpha] = pixels[x as usize];
            image::Rgba([grey, grey, grey, alpha])
        };
        image::RgbaImage::from_fn(pixels.len() as u32, 1, |x, _| pixel(x)).save(&path).unwrap();
        let changed = changed(json!({"mask": path}), width, 1);
        std::fs::remove_file(path).unwrap();
        changed
    }

    #[test]
    fn what_is_transparent_in_a_mask_is_not_changed() {
        // A white image with a shape in alpha, as drawing programs write it.
        let shape = [[255, 0], [255, 255], [255, 128], [0, 255], [128, 128]];
        assert_eq!(changed_through(&shape, 5), [0, 200, 100, 0, 50]);
    }

    #[test]
    fn the_edges_of_a_mask_are_smooth_whatever_its_size() {
        let grown = changed_through(&[[0, 255], [255, 255]], 8);
        assert_eq!(grown, [0, 0, 25, 75, 125, 175, 200, 200]);
        // A mask that is finer than the frame is averaged: 16 lines, every second one white.
        let stripes: Vec<_> = (0..16).map(|x| [x % 2 * 255, 255]).collect();
        let shrunk = changed_through(&stripes, 4);
        assert!(shrunk.iter().all(|value| value.abs_diff(100) <= 8), "{shrunk:?}");
    }

    #[test]
    fn an_image_that_is_not_there_is_named() {
        assert!(
            Mask::new(&Region::Mask("/no/such.png".into()))
                .err()
                .unwrap()
                .to_string()
                .contains("/no/such.png")
        );
    }
}
