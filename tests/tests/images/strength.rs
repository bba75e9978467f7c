//! The strength of every perturbation grows with its intensity, on frames of the embedded simulator and, if there are
//! some, on photographs of real roads. Those whose published levels are out of order say with which settings it grows.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_preview::picture;
use pdk_preview::preview::{self, Shown};
use pdk_sdk::describe::Temporal;
use pdk_sdk::ops::compare::{mean_squared_difference, structural_similarity};
use pdk_sdk::prelude::{Control, FrameBuf, Scenario};
use pdk_tests::real_data;
use serde_json::{Map, Value};

/// What is looked at.
struct Look {
    frames: Vec<FrameBuf>,
    /// The steps in which the intensity goes from 0 to 4.
    steps: usize,
    /// At most this many moments of what moves.
    moments: usize,
}

/// A step may fall back by this share of the whole range: chance, and levels that cannot be told apart.
const TOLERANCE: f64 = 0.02;

/// Structural similarity that rounding alone gains and loses, a frame.
const UNNOTICEABLE: f64 = 0.001;

/// What grows from level to level, but not everywhere between them, and why.
const BETWEEN_LEVELS: &[(&str, &str)] = &[
    (
        "bit_errors",
        "other bits are wrong if there are more, and the first in a slice decides how much of it is lost",
    ),
    ("posterize_filter", "where the steps between few grey values lie decides more than how many there are"),
    ("motion_blur", "a kernel of even size, as at level 0, also shifts the frame by half a pixel"),
    ("sharpen_filter", "what is brightened until it clips loses structure in steps"),
];

/// The family whose levels are severities of a benchmark. They are as published, in an order that people gave them: saturation falls at
/// the first two and rises then, and spatter is of water first and of mud then.
const SEVERITIES: &str = "imagenet_c";

/// Moves of the whole picture: the squared difference grows, but structure is lost all at once and comes back by chance.
const MOVES: &[&str] =
    &["delayed_frames", "reflection_filter", "scale_image", "shear_image", "translate_image"];

fn simulated_frames(registry: &Registry) -> Vec<FrameBuf> {
    let size = [("width", 200), ("height", 150)].map(|(name, size)| (name.to_owned(), Value::from(size)));
    let (mut simulator, _) = registry.simulator("lane", &Map::from_iter(size)).unwrap();
    let mut frames = Vec::new();
    for seed in [1, 2] {
        let [simulated, driver] = ["lane", "lane_keeper"].map(ComponentSpec::new);
        simulator.reset(&Scenario { seed, ..Scenario::new(simulated, driver) }, 0).unwrap();
        let mut frame = FrameBuf::new(200, 150);
        for _ in 0..20 {
            simulator.frame(frame.as_mut()).unwrap();
            simulator.act(Control { steering: 0.0, throttle: 0.3 }).unwrap();
        }
        frames.push(frame);
    }
    frames
}

/// A frame under a perturbation at a level with which it grows.
fn perturbed(registry: &Registry, shown: &Shown, level: f64, source: &FrameBuf, moment: u64) -> FrameBuf {
    let mut spec = shown.at(level);
    spec.parameters.extend(shown.description.grows_with.clone());
    let mut chain = Chain::new(registry, &[spec], 3).unwrap();
    let mut target = FrameBuf::new(source.width(), source.height());
    preview::approach(&mut chain, source, moment).unwrap();
    chain.apply(source.as_ref(), target.as_mut(), &Moment::new(moment, moment as f64 / 30.0)).unwrap();
    target
}

/// Frames at which a perturbation is looked at: some where it moves, and shows then. Lightning does not strike always.
fn moments(registry: &Registry, shown: &Shown, look: &Look) -> Vec<u64> {
    let source = &look.frames[0];
    let shows = |moment: &u64| perturbed(registry, shown, 4.0, source, *moment) != *source;
    match shown.description.temporal {
        Temporal::Static => vec![40],
        Temporal::Dynamic => (40..600).step_by(55).filter(shows).take(look.moments).collect(),
    }
}

/// Mean squared difference and loss of structural similarity at each intensity, over all frames and, for what moves, some
/// moments.
fn strengths(registry: &Registry, shown: &Shown, look: &Look) -> [Vec<f64>; 2] {
    let moments = moments(registry, shown, look);
    let mut strengths = [Vec::new(), Vec::new()];
    for step in 0..=look.steps {
        let level = 4.0 * step as f64 / look.steps as f64;
        let mut sums = [0.0, 0.0];
        for source in &look.frames {
            for &moment in &moments {
                let target = perturbed(registry, shown, level, source, moment);
                sums[0] += mean_squared_difference(source.as_ref(), target.as_ref());
                sums[1] += 1.0 - structural_similarity(source.as_ref(), target.as_ref());
            }
        }
        strengths.iter_mut().zip(sums).for_each(|(strengths, sum)| strengths.push(sum));
    }
    strengths
}

fn grows(values: &[f64], every: usize, unnoticeable: f64) -> bool {
    let values: Vec<f64> = values.iter().copied().step_by(every).collect();
    let range = values[values.len() - 1] - values[0];
    let tolerance = (TOLERANCE * range).max(unnoticeable);
    range > 0.0 && values.windows(2).all(|pair| pair[1] >= pair[0] - tolerance)
}

/// What is wrong with the strength of a perturbation.
fn fault(registry: &Registry, shown: &Shown, look: &Look) -> Option<String> {
    let name = shown.description.name.as_str();
    let [squares, structure] = strengths(registry, shown, look);
    if squares.iter().all(|&square| square == 0.0) {
        return Some(format!("{name} changes nothing"));
    }
    let every = if BETWEEN_LEVELS.iter().any(|(other, _)| *other == name) { look.steps / 4 } else { 1 };
    let unnoticeable = UNNOTICEABLE * look.frames.len() as f64;
    let squares_grow = grows(&squares, every, 0.0);
    let structure_falls = MOVES.contains(&name) || grows(&structure, every, unnoticeable);
    (!squares_grow || !structure_falls).then(|| format!("{name}: {squares:.1?} {structure:.3?}"))
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn strength_grows_from_level_to_level() {
    let registry = registry();
    let frames = simulated_frames(&registry);
    check(&registry, &Look { frames, steps: 4, moments: 1 });
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn strength_grows_between_levels_and_on_photographs() {
    let registry = registry();
    let mut frames = simulated_frames(&registry);
    for name in ["road/solidYellowLeft.jpg", "road/whiteCarLaneSwitch.jpg"] {
        if let Some(file) = real_data(name) {
            frames.push(picture::to_frame(picture::scaled(&pdk_image::read(&file).unwrap(), 240)).unwrap());
        }
    }
    check(&registry, &Look { frames, steps: 8, moments: 3 });
}

fn registry() -> Registry {
    pdk_tests::registry(&SearchPath::default())
}

/// Checks all perturbations.
fn check(registry: &Registry, look: &Look) {
    let mut perturbations = preview::chosen(registry.catalog(), &[], true).unwrap();
    perturbations.retain(|shown| shown.description.family != SEVERITIES);
    assert!(perturbations.len() > 10, "only {} perturbations were found", perturbations.len());
    let next = AtomicUsize::new(0);
    let wrong = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, Into::into) {
            scope.spawn(|| {
                while let Some(shown) = perturbations.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let fault = fault(registry, shown, look);
                    wrong.lock().unwrap().extend(fault);
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "strength does not grow with the intensity:\n{}", wrong.join("\n"));
}
