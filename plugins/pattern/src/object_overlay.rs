//! Object overlay: something foreign in the middle of the view. It is the project's own logo, as the published tool shows
//! its own.
//!
//! The published size exchanges the roles of width and height: the logo becomes as wide as a share of the frame's height,
//! and as high as the frame's width asks for, so that it is too flat (160x38 where 160x83 was meant). The variant
//! `published` keeps that, and `corrected` makes it as high as that share of the frame's height and keeps its aspect.

use pdk_sdk::prelude::*;

use crate::logo::{ASPECT, Logo};

/// The height of the published logo, which the published size depends on.
const PUBLISHED_HEIGHT: f64 = 1330.0;

/// Lays a logo over the middle of the frame.
pub struct ObjectOverlay {
    logo: Logo,
}

impl Component for ObjectOverlay {
    fn description() -> Description {
        Description::perturbation("object_overlay", "Lays the project's logo over the middle of the frame")
            .family("pattern")
            .keeps_geometry()
            .mathematics("published: width = H / c, height = W * width / 1330; corrected: height = H / c, width = height * 2560 / 1330")
            .divergence("The logo is the project's own, with smooth letters, and at least one pixel large; the published tool fails on small frames.")
            .divergence("Only with `variant=corrected`: the logo keeps its aspect; the published size exchanges the roles of width and height.")
            .source("Leonhard, Lambertenghi and Stocco, PerturbationDrive: an opaque logo in the middle")
            .parameter(
                Parameter::by_level(
                    "divisor",
                    [10.0, 5.0, 3.0, 2.0, 1.5],
                    "c: the frame's height over the logo's size, which the variant says more of",
                )
                .range(0.5, 10_000.0),
            )
            .parameter(Parameter::choice(
                "variant",
                &["published", "corrected"],
                "published: the width is 1 / c of the frame's height, and the logo is too flat; corrected: its height is, in the right aspect, but no wider than the frame",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { logo: Logo::default() })
    }
}

/// The logo's size in pixels, at least 1x1.
fn size(frame_width: usize, frame_height: usize, divisor: f64, published: bool) -> (usize, usize) {
    let (frame_width, share) = (frame_width as f64, frame_height as f64 / divisor);
    let (width, height) = if published {
        let width = share.floor();
        (width, frame_width * width / PUBLISHED_HEIGHT)
    } else {
        let width = (share * ASPECT).min(frame_width);
        (width, width / ASPECT)
    };
    // Twice the frame is more than can be seen, and keeps extreme parameters from costing memory.
    let most = 2.0 * frame_width.max(frame_height as f64);
    (width.clamp(1.0, most) as usize, height.clamp(1.0, most) as usize)
}

impl Perturbation for ObjectOverlay {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let (width, height) = (src.width(), src.height());
        let (wide, high) = size(width, height, cx.number("divisor"), cx.integer("variant") == 0);
        self.logo.draw(wide, high);
        // If the logo is larger than the frame, it starts inside the logo.
        let (skip_x, skip_y) = ((wide / 2).saturating_sub(width / 2), (high / 2).saturating_sub(height / 2));
        let (left, top) = ((width / 2).saturating_sub(wide / 2), (height / 2).saturating_sub(high / 2));
        for y in top..height.min(top + high - skip_y) {
            let row = dst.row_mut(y)[left * 3..].chunks_exact_mut(3);
            for ((opaque, colour), pixel) in self.logo.row(y - top + skip_y).skip(skip_x).zip(row) {
                if opaque {
                    pixel.copy_from_slice(colour);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::{ObjectOverlay, size};
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ObjectOverlay>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ObjectOverlay>(&Value::Null);
        golden::writes_exactly_the_frame::<ObjectOverlay>(&json!({"variant": "corrected"}));
        golden::writes_exactly_the_frame::<ObjectOverlay>(&json!({"divisor": 0.5, "variant": "corrected"}));
    }

    #[test]
    fn sizes_are_the_published_ones() {
        for (divisor, expected) in
            [(10.0, (24, 5)), (5.0, (48, 11)), (3.0, (80, 19)), (2.0, (120, 28)), (1.5, (160, 38))]
        {
            assert_eq!(size(320, 240, divisor, true), expected);
        }
        assert_eq!(size(8, 8, 10.0, true), (1, 1));
    }

    #[test]
    fn corrected_sizes_keep_the_aspect_and_stay_within_the_frame() {
        assert_eq!(size(320, 240, 2.0, false), (230, 120));
        let (width, height) = size(100, 240, 1.5, false);
        assert_eq!((width, height), (100, 51));
    }

    /// The first and last changed column and row.
    fn changed(given: &Value, intensity: f64, width: usize, height: usize) -> [usize; 4] {
        let src = FrameBuf::from_vec(vec![99; width * height * 3], width, height).unwrap();
        let out = golden::perturb::<ObjectOverlay>(given, src.as_ref(), intensity, &Key::default(), 0);
        let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let hit: Vec<_> = all.filter(|&(x, y)| out.as_ref().pixel(x, y) != [99; 3]).collect();
        let (xs, ys) = (hit.iter().map(|p| p.0), hit.iter().map(|p| p.1));
        [xs.clone().min().unwrap(), xs.max().unwrap(), ys.clone().min().unwrap(), ys.max().unwrap()]
    }

    #[test]
    fn the_logo_lies_in_the_middle() {
        // 160x38 from (160 - 80, 120 - 19).
        assert_eq!(changed(&Value::Null, 4.0, 320, 240), [80, 239, 101, 138]);
        assert_eq!(changed(&json!({"variant": "corrected"}), 3.0, 320, 240), [45, 274, 60, 179]);
        // Larger than the frame: all of the frame's middle is covered.
        assert_eq!(changed(&json!({"divisor": 0.5}), 0.0, 40, 60), [0, 39, 29, 31]);
    }
}
