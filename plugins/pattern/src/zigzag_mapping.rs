//! Zigzag lines: hairs and cracks. Where the lines run is drawn once per sequence.
//!
//! The offsets across a line add up over its steps, as published, so the pixels lie apart and the strongest lines leave
//! the frame soonest: level 4 changes fewer pixels than level 3.

use pdk_sdk::prelude::*;

use crate::ray::Ray;

/// Draws lines of single black pixels that swing up and down.
pub struct ZigzagMapping;

impl Component for ZigzagMapping {
    fn description() -> Description {
        Description::perturbation(
            "zigzag_mapping",
            "Draws lines of black pixels that swing up and down, at places that stay for a sequence; level 4 changes fewer pixels than level 3, as published",
        )
        .family("pattern")
        .keeps_geometry()
        .grows_with(pdk_sdk::serde_json::json!({"amplitude": 2, "frequency": 1}))
        .mathematics("black at trunc(p_k), p_(k+1) = p_k + direction + (0, amplitude * sin(frequency * k)), until p_k leaves the frame")
        .source("Leonhard, Lambertenghi and Stocco, PerturbationDrive: random lines with a sine added at every step")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .drawn_per_sequence("start and direction of each line")
        .parameter(
            Parameter::by_level(
                "lines",
                [1.0, 2.0, 3.0, 4.0, 6.0],
                "number of lines, rounded to the nearest whole number",
            )
            .range(0.0, 10_000.0),
        )
        .parameter(
            Parameter::by_level("amplitude", [2.0, 4.0, 6.0, 8.0, 12.0], "largest swing of a step")
                .range(0.0, 1000.0)
                .unit("px"),
        )
        .parameter(
            Parameter::by_level("frequency", [1.0, 2.0, 3.0, 4.0, 6.0], "how far the swing's phase moves in a step")
                .range(0.0, 100.0)
                .unit("rad"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for ZigzagMapping {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let (amplitude, frequency) = (cx.number("amplitude"), cx.number("frequency"));
        let (width, height) = (src.width(), src.height());
        let mut random = cx.sequence_random();
        for _ in 0..cx.integer("lines") {
            let mut ray = Ray::draw(&mut random, width, height);
            let mut step = 0.0;
            while let Some((x, y)) = ray.pixel(width, height) {
                dst.set_pixel(x, y, [0; 3]);
                ray.x += ray.dx;
                ray.y += ray.dy + amplitude * libm::sin(frequency * step);
                step += 1.0;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::ZigzagMapping;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ZigzagMapping>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<ZigzagMapping>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ZigzagMapping>(&Value::Null);
    }

    #[test]
    fn a_line_without_swing_is_straight_and_runs_to_the_edge() {
        let src = FrameBuf::from_vec(vec![200; 80 * 60 * 3], 80, 60).unwrap();
        let given = json!({"lines": 1, "amplitude": 0});
        for seed in 0..20 {
            let out = golden::perturb::<ZigzagMapping>(&given, src.as_ref(), 0.0, &Key([seed; 32]), 0);
            let all = (0..60usize).flat_map(|y| (0..80usize).map(move |x| (x, y)));
            let black: Vec<_> = all.filter(|&(x, y)| out.as_ref().pixel(x, y) == [0; 3]).collect();
            assert!(black.iter().any(|&(x, y)| x == 0 || y == 0 || x == 79 || y == 59), "seed {seed}");
            // Every pixel but the ends has a neighbour on the line.
            let lonely = black.iter().filter(|&&(x, y)| {
                black.iter().filter(|&&(p, q)| p.abs_diff(x).max(q.abs_diff(y)) == 1).count() == 0
            });
            assert!(black.len() == 1 || lonely.count() == 0, "seed {seed}");
        }
    }
}
