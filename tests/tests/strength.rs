//! The strength of every perturbation grows with its intensity, on frames of the embedded simulator and, where there are
//! some, on photographs of real roads. Those whose published levels are out of order say so in their descriptions.

#![allow(clippy::unwrap_used)]

use pdk::chain::{Chain, Spec};
use pdk::picture;
use pdk::preview;
use pdk::registry::{Registry, SearchPath};
use pdk_sdk::describe::{Description, Temporal};
use pdk_sdk::ops::compare::{mean_squared_difference, structural_similarity};
use pdk_sdk::prelude::{Control, FrameBuf, Scenario};
use pdk_tests::real_data;
use serde_json::{Map, Value};

/// Intensities from 0 to 4 in steps of a half.
const STEPS: usize = 8;

/// A step may fall back by this share of the whole range: chance, and levels that cannot be told apart.
const TOLERANCE: f64 = 0.02;

/// What grows otherwise, and why. Each is said in the component's own description as well.
const OUT_OF_ORDER: &[(&str, &str)] = &[
    (
        "canny_edges_mapping",
        "higher thresholds leave fewer edges, and the dimming is the same at every level",
    ),
    ("elastic", "level 0 hardly smooths its displacements, which tears more than levels 1 to 3"),
    ("false_color_filter", "every level is an effect of its own"),
    ("histogram_equalisation", "what a clip limit does to the squared difference depends on the picture"),
    ("rotate_image", "half a turn can be closer to the original than a quarter"),
    (
        "zigzag_mapping",
        "long steps leave the frame sooner, so that level 4 changes fewer pixels than level 3",
    ),
    ("zoom_blur", "levels 1 and 2 have the same reach with other steps"),
];

/// What grows from level to level, but not everywhere between them, and why.
const BETWEEN_LEVELS: &[(&str, &str)] = &[
    ("motion_blur", "a kernel of even size, as at level 0, also shifts the frame by half a pixel"),
    ("sharpen_filter", "what is brightened until it clips loses structure in steps"),
];

/// Moves of the whole picture: the squared difference grows, but structure is lost all at once and comes back by chance.
const MOVES: &[&str] = &["reflection_filter", "scale_image", "shear_image", "translate_image"];

fn frames(registry: &Registry) -> Vec<FrameBuf> {
    let size = [("width", 200), ("height", 150)].map(|(name, size)| (name.to_owned(), Value::from(size)));
    let (mut simulator, _) = registry.simulator("lane", &Map::from_iter(size)).unwrap();
    let mut frames = Vec::new();
    for seed in [1, 2] {
        simulator.reset(&Scenario { index: 0, seed, road: Value::Null, duration: 60.0 }).unwrap();
        let mut frame = FrameBuf::new(200, 150);
        for _ in 0..20 {
            simulator.frame(frame.as_mut()).unwrap();
            simulator.act(Control { steering: 0.0, throttle: 0.3 }).unwrap();
        }
        frames.push(frame);
    }
    for name in ["road/solidYellowLeft.jpg", "road/whiteCarLaneSwitch.jpg"] {
        if let Some(file) = real_data(name) {
            frames.push(picture::to_frame(picture::scaled(&pdk_image::read(&file).unwrap(), 240)).unwrap());
        }
    }
    frames
}

/// Mean squared difference and loss of structural similarity at each intensity, over all frames and, for what moves, some
/// moments.
fn strengths(registry: &Registry, description: &Description, frames: &[FrameBuf]) -> [Vec<f64>; 2] {
    let moments: &[u64] = if description.temporal == Temporal::Dynamic { &[40, 95, 170] } else { &[40] };
    let mut strengths = [Vec::new(), Vec::new()];
    for step in 0..=STEPS {
        let level = 4.0 * step as f64 / STEPS as f64;
        let mut sums = [0.0, 0.0];
        for source in frames {
            let mut chain = Chain::new(registry, &[Spec::new(&description.name, level)], 3, 0).unwrap();
            for &moment in moments {
                let mut target = FrameBuf::new(source.width(), source.height());
                chain.apply(source.as_ref(), target.as_mut(), moment, moment as f64 / 30.0).unwrap();
                sums[0] += mean_squared_difference(source.as_ref(), target.as_ref());
                sums[1] += 1.0 - structural_similarity(source.as_ref(), target.as_ref());
            }
        }
        strengths.iter_mut().zip(sums).for_each(|(strengths, sum)| strengths.push(sum));
    }
    strengths
}

fn grows(values: &[f64], every: usize) -> bool {
    let values: Vec<f64> = values.iter().copied().step_by(every).collect();
    let range = values[values.len() - 1] - values[0];
    range > 0.0 && values.windows(2).all(|pair| pair[1] >= pair[0] - TOLERANCE * range)
}

#[test]
fn strength_grows_with_the_intensity() {
    let registry = Registry::discover(&SearchPath::default()).unwrap();
    let frames = frames(&registry);
    let perturbations = preview::chosen(&registry, &[], true).unwrap();
    assert!(perturbations.len() > 10, "only {} perturbations were found", perturbations.len());
    let mut wrong = Vec::new();
    for description in &perturbations {
        let [squares, structure] = strengths(&registry, description, &frames);
        assert!(squares.iter().any(|&square| square > 0.0), "{} changes nothing", description.name);
        if OUT_OF_ORDER.iter().any(|(name, _)| *name == description.name) {
            continue;
        }
        let every =
            if BETWEEN_LEVELS.iter().any(|(name, _)| *name == description.name) { STEPS / 4 } else { 1 };
        let structure_counts = !MOVES.contains(&description.name.as_str());
        if !grows(&squares, every) || structure_counts && !grows(&structure, every) {
            wrong.push(format!("{}: {squares:.1?} {structure:.3?}", description.name));
        }
    }
    assert!(wrong.is_empty(), "strength does not grow with the intensity:\n{}", wrong.join("\n"));
}
