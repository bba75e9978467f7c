//! A texture laid over every frame, as frost on the windscreen and snow in the air are.

use pdk_sdk::ops::canvas::Texel;
use pdk_sdk::ops::hsv::scale_hsv;
use pdk_sdk::ops::layer::lay_over;
use pdk_sdk::prelude::*;

/// Saturation is multiplied by this after the texture has been laid over.
const SATURATION: f64 = 0.8;

/// Draws a texture of a width and a height: one texel for each pixel, row by row.
pub type Draw = fn(usize, usize) -> Vec<Texel>;

/// The parameters that frost and snow share.
pub fn describe(description: Description, opacities: [f64; 5]) -> Description {
    description
        .family("weather")
        .mathematics("(1 - a t) v + a texture, then S x 0.8 in HSV")
        .divergence("The texture is the project's own, drawn from a fixed key.")
        .divergence("The way back from HSV rounds everywhere; the published one truncates in blocks of 32 pixels, which darkens by up to a level.")
        .divergence("Only with `variant=corrected`: the texture is weighted by its own alpha.")
        .parameter(
            Parameter::by_level("opacity", opacities, "opacity of the texture where it covers what is behind it")
                .range(0.0, 1.0),
        )
        .parameter(Parameter::choice(
            "variant",
            &["published", "corrected"],
            "published: the texture is opaque, so the whole frame is blended with it; corrected: it covers as much as there is of it",
        ))
}

/// A texture for the latest frame size.
pub struct Texture {
    draw: Draw,
    /// Width, height and whether the texture is opaque.
    made_for: Option<(usize, usize, bool)>,
    /// Colours, multiplied by the cover.
    colour: FrameBuf,
    cover: FrameBuf,
    covered: FrameBuf,
}

impl Texture {
    pub fn new(draw: Draw) -> Self {
        Self {
            draw,
            made_for: None,
            colour: FrameBuf::default(),
            cover: FrameBuf::default(),
            covered: FrameBuf::default(),
        }
    }

    /// Lays the texture over `src` and takes a fifth of the saturation.
    pub fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) {
        let wanted = Some((src.width(), src.height(), cx.integer("variant") == 0));
        if self.made_for != wanted {
            self.make(src.width(), src.height(), cx.integer("variant") == 0);
            self.made_for = wanted;
        }
        let opacity = cx.number("opacity");
        lay_over(src, self.colour.as_ref(), self.cover.as_ref(), opacity, self.covered.as_mut());
        scale_hsv(self.covered.as_ref(), dst, SATURATION, 1.0);
    }

    fn make(&mut self, width: usize, height: usize, opaque: bool) {
        for frame in [&mut self.colour, &mut self.cover, &mut self.covered] {
            frame.resize(width, height);
        }
        let byte = |shade: f64| (shade.clamp(0.0, 1.0) * 255.0).round() as u8;
        for (i, texel) in (self.draw)(width, height).into_iter().enumerate() {
            let cover = if opaque { 1.0 } else { texel.cover.clamp(0.0, 1.0) };
            let (x, y) = (i % width, i / width);
            self.colour.as_mut().set_pixel(x, y, texel.rgb.map(|shade| byte(shade.clamp(0.0, 1.0) * cover)));
            self.cover.as_mut().set_pixel(x, y, [byte(cover); 3]);
        }
    }
}

#[cfg(test)]
pub mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::json;

    use super::{Draw, SATURATION};
    use crate::golden;

    /// The mean of a texture's brightness, and of its cover, over the pixels for which `wanted` holds.
    pub fn means(
        draw: Draw,
        width: usize,
        height: usize,
        wanted: impl Fn(usize, usize) -> bool,
    ) -> (f64, f64) {
        let (mut shade, mut cover, mut count) = (0.0, 0.0, 0.0);
        for (i, texel) in draw(width, height).iter().enumerate() {
            if wanted(i % width, i / width) {
                shade += texel.rgb.iter().sum::<f64>() / 3.0;
                cover += texel.cover;
                count += 1.0;
            }
        }
        (shade / count, cover / count)
    }

    /// What every perturbation with a texture has to hold.
    pub fn lays_a_texture_over<P: Component + Perturbation + 'static>(draw: Draw) {
        pdk_sdk::testing::perturbation::<P>();
        golden::writes_exactly_the_frame::<P>(&json!({}));
        golden::writes_exactly_the_frame::<P>(&json!({"variant": "corrected"}));
        let src = pdk_sdk::testing::sample_frame(90, 60);
        for variant in ["published", "corrected"] {
            let given = json!({"variant": variant});
            let at = |level: f64, key, index| {
                golden::perturb::<P>(&given, src.as_ref(), level, &Key([key; 32]), index)
            };
            // The texture is the same one everywhere.
            assert_eq!(at(2.0, 1, 0), at(2.0, 2, 7));
            let strength = |level: f64| {
                let out = at(level, 0, 0);
                src.data()
                    .iter()
                    .zip(out.data())
                    .map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2))
                    .sum::<f64>()
            };
            let strengths: Vec<f64> = (0..=16).map(|step| strength(f64::from(step) / 4.0)).collect();
            assert!(strengths.is_sorted(), "{variant}: {strengths:?}");
        }
        matches_the_plain_version::<P>(draw);
    }

    /// The published arithmetic in double precision.
    fn matches_the_plain_version<P: Component + Perturbation>(draw: Draw) {
        let src = pdk_sdk::testing::sample_frame(90, 60);
        let opacity = 0.37;
        for (variant, opaque) in [("published", true), ("corrected", false)] {
            let given = json!({"variant": variant, "opacity": opacity});
            let out = golden::perturb::<P>(&given, src.as_ref(), 0.0, &Key::default(), 0);
            let mut total = 0.0;
            for (i, texel) in draw(90, 60).iter().enumerate() {
                let cover = if opaque { 1.0 } else { texel.cover.clamp(0.0, 1.0) };
                let before = src.as_ref().pixel(i % 90, i / 90);
                let blended: Vec<f64> = (0..3)
                    .map(|c| {
                        (1.0 - opacity * cover) * f64::from(before[c])
                            + opacity * cover * 255.0 * texel.rgb[c].clamp(0.0, 1.0)
                    })
                    .collect();
                let value = blended.iter().copied().fold(0.0, f64::max);
                for (actual, blended) in out.as_ref().pixel(i % 90, i / 90).into_iter().zip(blended) {
                    // Less saturation moves every channel towards the largest one.
                    let off = (f64::from(actual) - (value - (value - blended) * SATURATION)).abs();
                    // A level each for the texture's bytes and the fraction that is dropped; the rest is for hue and
                    // saturation in bytes.
                    assert!(off <= 5.0, "{variant}: {off}");
                    total += off;
                }
            }
            let mean = total / (90.0 * 60.0 * 3.0);
            assert!(mean < 1.2, "{variant}: {mean}");
        }
    }
}
