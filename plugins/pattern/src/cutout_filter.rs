//! Cutout: parts of the frame are missing, as when something sticks to the windscreen or blocks of a transmission are
//! lost. Where the rectangles sit is drawn once per sequence.

use pdk_sdk::ops::draw::fill_rectangle;
use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;

/// Blackens rectangles.
pub struct CutoutFilter;

impl Component for CutoutFilter {
    fn description() -> Description {
        Description::perturbation(
            "cutout_filter",
            "Blackens rectangles, at places that stay for a sequence",
        )
        .family("pattern")
        .keeps_geometry()
        .source("DeVries and Taylor, Improved regularization of convolutional neural networks with cutout (2017)")
        .mathematics("black in rectangles whose sides are uniform in 5 %..20 % of the frame's")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .drawn_per_sequence("size and place of each rectangle")
        .parameter(
            Parameter::by_level(
                "rectangles",
                [1.0, 2.0, 4.0, 6.0, 10.0],
                "number of rectangles, rounded to the nearest whole number; their sides are 5 % to 20 % of the frame's",
            )
            .range(0.0, 10_000.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

/// A side of a rectangle: from 5 % of `length` to below 20 %, in whole pixels; 0 where the frame is too small for any.
fn side(random: &mut Random, length: usize) -> i32 {
    let (low, high) = (length / 20, length / 5);
    low as i32 + random.below((high - low) as u32) as i32
}

/// The first pixel of a side, so that it lies inside; the published draw leaves out the last such place.
fn start(random: &mut Random, length: usize, side: i32) -> i32 {
    random.below((length as i32 - side).max(0) as u32) as i32
}

impl Perturbation for CutoutFilter {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let mut random = cx.sequence_random();
        let (width, height) = (src.width(), src.height());
        for _ in 0..cx.integer("rectangles") {
            let (high, wide) = (side(&mut random, height), side(&mut random, width));
            let (y, x) = (start(&mut random, height, high), start(&mut random, width, wide));
            fill_rectangle(dst.reborrow(), x, y, wide, high, [0; 3]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::CutoutFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<CutoutFilter>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<CutoutFilter>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<CutoutFilter>(&Value::Null);
    }

    #[test]
    fn a_rectangle_has_sides_from_a_twentieth_to_a_fifth() {
        let src = FrameBuf::from_vec(vec![200; 200 * 100 * 3], 200, 100).unwrap();
        for seed in 0..50 {
            let given = json!({"rectangles": 1});
            let out = golden::perturb::<CutoutFilter>(&given, src.as_ref(), 0.0, &Key([seed; 32]), 0);
            let black = |x: usize, y: usize| out.as_ref().pixel(x, y) == [0; 3];
            let wide = (0..200).filter(|&x| (0..100).any(|y| black(x, y))).count();
            let high = (0..100).filter(|&y| (0..200).any(|x| black(x, y))).count();
            assert!((10..40).contains(&wide) && (5..20).contains(&high), "{wide}x{high}");
            let area = (0..200).map(|x| (0..100).filter(|&y| black(x, y)).count()).sum::<usize>();
            assert_eq!(area, wide * high);
        }
    }

    #[test]
    fn rectangles_stay_for_a_sequence_and_are_joined_by_more() {
        let src = FrameBuf::from_vec(vec![200; 160 * 120 * 3], 160, 120).unwrap();
        let at = |intensity, frame| {
            golden::perturb::<CutoutFilter>(&Value::Null, src.as_ref(), intensity, &Key([5; 32]), frame)
        };
        assert_eq!(at(2.0, 0), at(2.0, 1));
        for step in 1..=40 {
            let (weaker, stronger) = (at(f64::from(step - 1) / 10.0, 0), at(f64::from(step) / 10.0, 0));
            assert!(weaker.data().iter().zip(stronger.data()).all(|(w, s)| s <= w), "step {step}");
        }
    }
}
