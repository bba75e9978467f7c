//! Labels in pictures.

use std::sync::OnceLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont};
use image::{Rgb, RgbImage};

/// Height of a line of text in pixels.
pub const LINE_HEIGHT: u32 = 20;

/// Height of the letters in pixels.
const SIZE: f32 = 15.0;

/// Draws a line of black text whose box starts at (x, y). What reaches over the edge is left out.
pub fn draw(image: &mut RgbImage, x: u32, y: u32, text: &str) {
    draw_in(image, x, y, text, Rgb([0; 3]));
}

/// Draws a line of text in a color.
pub fn draw_in(image: &mut RgbImage, x: u32, y: u32, text: &str, ink: Rgb<u8>) {
    static FONT: OnceLock<Option<FontRef<'static>>> = OnceLock::new();
    // The font is part of the program, so it is one.
    let Some(font) = FONT.get_or_init(|| FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT).ok())
    else {
        return;
    };
    let scaled = font.as_scaled(PxScale::from(SIZE));
    let baseline = y as f32 + (LINE_HEIGHT as f32 - SIZE) / 2.0 + scaled.ascent();
    let mut pen = x as f32;
    let mut last = None;
    for letter in text.chars() {
        let id = scaled.glyph_id(letter);
        pen += last.map_or(0.0, |last| scaled.kern(last, id));
        let glyph = id.with_scale_and_position(PxScale::from(SIZE), ab_glyph::point(pen, baseline));
        if let Some(outline) = font.outline_glyph(glyph) {
            let bounds = outline.px_bounds();
            outline.draw(|dx, dy, coverage| {
                let (px, py) = (bounds.min.x + dx as f32, bounds.min.y + dy as f32);
                if px >= 0.0
                    && py >= 0.0
                    && let Some(pixel) = image.get_pixel_mut_checked(px as u32, py as u32)
                {
                    for (value, ink) in pixel.0.iter_mut().zip(ink.0) {
                        let (paper, ink) = (f32::from(*value), f32::from(ink));
                        *value = (paper * (1.0 - coverage) + ink * coverage) as u8;
                    }
                }
            });
        }
        pen += scaled.h_advance(id);
        last = Some(id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_darkens_its_line_only() {
        let mut image = RgbImage::from_pixel(80, 60, Rgb([255; 3]));
        draw(&mut image, 4, 20, "gaussian");
        let dark = |y: u32| (0..80).any(|x| image.get_pixel(x, y)[0] < 100);
        assert!((20..40).any(dark));
        assert!(!(0..20).any(dark) && !(41..60).any(dark));
        // Does nothing if there is no room.
        draw(&mut image, 70, 55, "over the edge");
    }
}
