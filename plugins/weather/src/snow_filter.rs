//! Snow: flakes in the air.
//!
//! The texture is drawn here: flakes at three depths, the near ones large and out of focus, all of them streaked by
//! their fall, in a bright haze. It is the same one for every key, made once for each frame size.
//!
//! The published code adds its texture without weighting it by the texture's own alpha. Its picture is opaque, so the
//! whole frame is blended with it. The variant `published` does that, and `corrected` lets the scene through between
//! the flakes as far as the haze does.

use std::f64::consts::PI;

use pdk_sdk::ops::canvas::{Canvas, Texel, ahead};
use pdk_sdk::prelude::*;

use crate::texture::{Texture, describe};

/// The texture is drawn from the sequence stream of this key.
const KEY: Key = Key(*b"snow flakes at several distances");
/// Flakes fall at this angle to the right of vertical, give or take the second number.
const SLANT: [f64; 2] = [0.22, 0.12];

/// Flakes at one depth. Lengths are in hundredths of the diagonal.
struct Depth {
    count: usize,
    radius: [f64; 2],
    streak: [f64; 2],
    opacity: [f64; 2],
}

/// From far to near.
const DEPTHS: [Depth; 3] = [
    Depth { count: 1500, radius: [0.12, 0.26], streak: [0.05, 0.3], opacity: [0.35, 0.8] },
    Depth { count: 420, radius: [0.26, 0.62], streak: [0.1, 0.8], opacity: [0.5, 0.95] },
    Depth { count: 46, radius: [0.9, 2.4], streak: [0.5, 2.2], opacity: [0.3, 0.6] },
];

/// Lays falling snow over the frame.
pub struct SnowFilter {
    texture: Texture,
}

impl Component for SnowFilter {
    fn description() -> Description {
        let description = Description::perturbation(
            "snow_filter",
            "Lays a texture of falling snow over the frame, the same one always, and lowers saturation",
        )
        .keeps_geometry()
        .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019), with a drawn texture");
        describe(description, [0.15, 0.22, 0.3, 0.45, 0.6])
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { texture: Texture::new(draw) })
    }
}

impl Perturbation for SnowFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.texture.apply(src, dst, cx);
        Ok(())
    }
}

fn draw(width: usize, height: usize) -> Vec<Texel> {
    let mut random = KEY.sequence();
    let mut flakes = Canvas::new(width, height);
    let unit = flakes.unit();
    for depth in DEPTHS {
        for _ in 0..depth.count {
            let mut between = |[low, high]: [f64; 2]| random.uniform(low, high);
            let centre = [between([0.0, width as f64]), between([0.0, height as f64])];
            let angle = PI / 2.0 - SLANT[0] + between([-SLANT[1], SLANT[1]]);
            let end = ahead(centre, angle, between(depth.streak) * unit);
            flakes.stroke(centre, end, between(depth.radius) * unit, between(depth.opacity));
        }
    }
    let haze = Canvas::clouds(width, height, 30.0 * unit, 4, &mut random);
    let texel = |i: usize| {
        let (flake, haze) = (flakes.shades[i], haze.shades[i] - 0.5);
        // The sky scatters more light than the ground.
        let height = 0.5 - (i / width) as f64 / height as f64;
        let air = 0.58 + 0.2 * haze + 0.08 * height;
        let shade = air + (0.98 - air) * flake;
        let tint = 0.015 * (1.0 - flake);
        Texel { rgb: [shade - tint, shade, shade + tint], cover: 1.0 - (0.65 - 0.3 * haze) * (1.0 - flake) }
    };
    (0..width * height).map(texel).collect()
}

#[cfg(test)]
mod tests {
    use super::{SnowFilter, draw};
    use crate::texture::tests::{lays_a_texture_over, means};

    #[test]
    fn lays_snow_over_the_frame() {
        lays_a_texture_over::<SnowFilter>(draw);
    }

    #[test]
    fn flakes_cover_a_part_of_the_frame_at_any_resolution() {
        let shares = [(160, 120), (320, 240), (640, 480)].map(|(width, height)| {
            let texels = draw(width, height);
            let white = texels.iter().filter(|texel| texel.rgb[1] > 0.8).count();
            white as f64 / texels.len() as f64
        });
        assert!(shares.iter().all(|share| (0.02..0.2).contains(share)), "{shares:?}");
    }

    #[test]
    fn snow_falls_on_all_parts_alike() {
        let quarter =
            |right: bool, low: bool| means(draw, 320, 240, |x, y| (x >= 160) == right && (y >= 120) == low).1;
        let covers = [quarter(false, false), quarter(true, false), quarter(false, true), quarter(true, true)];
        let mean = covers.iter().sum::<f64>() / 4.0;
        assert!(covers.iter().all(|cover| (cover - mean).abs() < 0.08), "{covers:?}");
    }
}
