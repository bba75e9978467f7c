//! Tests of attacks: on networks whose gradient is known, and on those that are part of this plugin.

use pdk_onnx::testing::{Setting, Sketch};
use pdk_onnx::{Tensor, model};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};
use pdk_sdk::testing::Trial;
use tempfile::NamedTempFile;

use crate::attack::expectation::Expectation;
use crate::attack::network::Attacked;
use crate::gradient_tests::engines;
use crate::perturbation::fgsm::Fgsm;
use crate::perturbation::pgd::Pgd;
use crate::perturbation::square_attack::SquareAttack;

/// A network that gives the weighted sum of an image of 6 x 4; weights fall from 1 in the first place to -1 in the last.
fn sum() -> NamedTempFile {
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 4, 6]);
    s.node("Flatten", &["image"], "flat", &[]);
    let weights = s.weights("weights", Tensor::floats(&[72, 1], (0..72).map(weight).collect()));
    s.node("MatMul", &["flat", &weights], "steering", &[]);
    save(&s)
}

/// The weight of a number of the image, channel by channel.
fn weight(at: usize) -> f64 {
    (35.5 - at as f64) / 35.5 / 10_000.0
}

/// The weight of a byte of a frame.
fn weight_of_byte(at: usize) -> f64 {
    weight(at % 3 * 24 + at / 3)
}

/// A network of which a choice among bins steers.
fn bins() -> NamedTempFile {
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 4, 6]);
    s.node("Flatten", &["image"], "flat", &[]);
    let weights = s.weights(
        "weights",
        Tensor::floats(&[72, 3], (0..216).map(|at| weight(at / 3) * (at % 3) as f64).collect()),
    );
    s.node("MatMul", &["flat", &weights], "logits", &[]);
    s.node("Softmax", &["logits"], "steering", &[("axis", Setting::Int(1))]);
    save(&s)
}

fn save(sketch: &Sketch) -> NamedTempFile {
    let file = NamedTempFile::with_suffix(".onnx").unwrap();
    std::fs::write(file.path(), model::encode(&sketch.model(&["steering"]))).unwrap();
    file
}

fn open<P: Component + Perturbation>(file: &NamedTempFile, mut more: Value, level: f64) -> Result<Trial<P>> {
    more["model"] = file.path().to_str().unwrap().into();
    Trial::new(&more, level, Key([1; 32]))
}

fn attacked<P: Component + Perturbation>(
    file: &NamedTempFile,
    more: Value,
    level: f64,
    frame: &FrameBuf,
) -> FrameBuf {
    open::<P>(file, more, level).unwrap().frame(frame, 0, 0.0).unwrap()
}

/// A frame with bytes at both ends and in between.
fn frame(width: usize, height: usize) -> FrameBuf {
    FrameBuf::from_vec((0..width * height * 3).map(|at| (at * 37 % 256) as u8).collect(), width, height)
        .unwrap()
}

/// What the network gives for a frame of its own size.
fn steering(frame: &FrameBuf) -> f64 {
    frame.data().iter().enumerate().map(|(at, byte)| f64::from(*byte) * weight_of_byte(at)).sum()
}

#[test]
fn one_step_changes_each_byte_by_the_sign_of_its_slope() {
    let (file, before) = (sum(), frame(6, 4));
    for engine in engines() {
        for (goal, side) in [("left", -1.0), ("right", 1.0)] {
            let found = attacked::<Fgsm>(&file, json!({"goal": goal, "engine": engine}), 2.0, &before);
            for (at, (from, to)) in before.data().iter().zip(found.data()).enumerate() {
                let expected =
                    (f64::from(*from) + side * 4.0 * weight_of_byte(at).signum()).clamp(0.0, 255.0);
                assert_eq!(f64::from(*to), expected, "{goal} {at} on {engine}");
            }
        }
    }
    // Away is the side that gets further, which bytes at the ends of their range decide.
    let [left, right, away] = ["left", "right", "away"]
        .map(|goal| steering(&attacked::<Fgsm>(&file, json!({"goal": goal}), 4.0, &before)));
    let before = steering(&before);
    assert_eq!((away - before).abs(), (left - before).abs().max((right - before).abs()));
}

/// The mean steering of `dave2` over changes of a frame that no attack has seen.
fn under_changes(frame: &FrameBuf) -> f64 {
    let given = json!({"model": "dave2", "expectation": "changes", "changes": 40});
    let config = Config::check(&Pgd::description(), given.as_object().unwrap()).unwrap();
    let mut seen = Expectation::of(&config, Attacked::open(&config, true).unwrap());
    seen.start(frame.width(), frame.height(), None, &mut Key([77; 32]).frame(5));
    seen.steering(frame.as_ref()).unwrap()
}

#[test]
fn an_attack_over_drawn_changes_survives_changes_that_it_has_not_seen() {
    let mut road = FrameBuf::new(200, 66);
    let shade = |x: usize, y: usize| (60 + y * 2 + if x > 90 + y { 50 } else { 0 }) as u8;
    for y in 0..66 {
        (0..200).for_each(|x| road.as_mut().set_pixel(x, y, [shade(x, y), shade(x, y), 90]));
    }
    let attacked = |draws: i64| {
        let mut given = json!({"model": "dave2", "goal": "left", "steps": 6});
        if draws > 0 {
            (given["expectation"], given["changes"]) = ("changes".into(), draws.into());
        }
        Trial::<Pgd>::new(&given, 3.0, Key([1; 32])).unwrap().frame(&road, 0, 0.0).unwrap()
    };
    let [plain, robust] = [0, 8].map(|draws| under_changes(&attacked(draws)));
    let untouched = under_changes(&road);
    println!("{untouched} {plain} {robust}");
    assert!(robust < plain && plain < untouched, "{robust} {plain} {untouched}");
    assert_eq!(attacked(3), attacked(3));
}

#[test]
fn several_steps_get_as_far_as_one_on_a_sum_and_stay_within_the_ball() {
    let (file, before) = (sum(), frame(6, 4));
    let one = attacked::<Fgsm>(&file, json!({"goal": "left"}), 3.0, &before);
    for start in [true, false] {
        assert_eq!(
            attacked::<Pgd>(&file, json!({"goal": "left", "random_start": start}), 3.0, &before),
            one,
            "{start}"
        );
    }
    let round = attacked::<Pgd>(&file, json!({"goal": "left", "norm": "l2"}), 3.0, &before);
    let squares: f64 =
        round.data().iter().zip(before.data()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
    let size = (squares / 72.0).sqrt();
    assert!(size <= 8.0 && size > 7.5, "{size}");
    // The ball of this norm encloses the other one.
    assert!(steering(&round) < steering(&one), "{} {}", steering(&round), steering(&one));
    // A change of less than one grey level changes nothing.
    assert_eq!(attacked::<Pgd>(&file, json!({"epsilon": 0.9}), 3.0, &before), before);
}

#[test]
fn a_target_is_approached_from_both_sides() {
    let (file, before) = (sum(), frame(6, 4));
    let from = steering(&before);
    for by in [-0.012, 0.012] {
        let given = json!({"goal": "target", "target": from + by, "step": 0.1});
        let found = steering(&attacked::<Pgd>(&file, given, 3.0, &before));
        assert!((found - from - by).abs() < 0.004, "{from} by {by}: {found}");
    }
}

#[test]
fn pixels_that_the_network_does_not_see_stay_and_squares_need_no_gradient() {
    let (file, before) = (sum(), frame(12, 10));
    let crop = json!({"crop": {"top": 2}, "goal": "left", "resize": "area"});
    let found = attacked::<Fgsm>(&file, crop, 4.0, &before);
    for y in 0..10 {
        assert_eq!(found.as_ref().row(y) == before.as_ref().row(y), y < 2, "{y}");
    }
    let described = json!({"steering": {"bins": {"from": -1, "to": 1, "count": 3}}});
    let error = open::<Fgsm>(&bins(), described.clone(), 2.0).err().unwrap().to_string();
    assert!(error.contains("holds bins") && error.contains("square_attack"), "{error}");
    attacked::<SquareAttack>(&bins(), described, 2.0, &before);
}

#[test]
fn squares_get_further_with_more_queries_and_stay_within_the_ball() {
    let (file, before) = (sum(), frame(6, 4));
    let far = |queries: u64| {
        let found =
            attacked::<SquareAttack>(&file, json!({"goal": "left", "queries": queries}), 3.0, &before);
        assert!(found.data().iter().zip(before.data()).all(|(a, b)| a.abs_diff(*b) <= 8));
        steering(&before) - steering(&found)
    };
    let all = [1, 20, 400].map(far);
    assert!(all[0] >= 0.0 && all[1] > all[0] && all[2] > all[1], "{all:?}");
    let best = steering(&before) - steering(&attacked::<Fgsm>(&file, json!({"goal": "left"}), 3.0, &before));
    assert!(all[2] > 0.6 * best && all[2] <= best, "{all:?} {best}");
}

/// A road under a sky.
fn road() -> FrameBuf {
    let mut frame = FrameBuf::new(320, 160);
    for (x, y) in (0..320 * 160).map(|at| (at % 320, at / 320)) {
        let side = (x as f64 - 160.0).abs() / (y as f64 - 45.0).max(1.0);
        let color = match (y < 50, side) {
            (true, _) => [110, 160, 215],
            (_, side) if (0.95..1.05).contains(&side) => [225, 225, 220],
            (_, side) if side < 0.95 => [80, 80, 84],
            _ => [80, 120, 50],
        };
        frame.as_mut().set_pixel(x, y, color.map(|value| value + ((x * 31 + y * 17) % 13) as u8));
    }
    frame
}

#[test]
fn the_networks_of_this_plugin_are_steered_and_more_so_by_more_steps_and_levels() {
    let before = road();
    let steered = |frame: &FrameBuf| {
        let config =
            Config::check(&Fgsm::description(), json!({"model": "dave2"}).as_object().unwrap()).unwrap();
        let mut network = crate::attack::network::Attacked::open(&config, false).unwrap();
        network.steering(frame.as_ref()).unwrap()
    };
    let made = |given: Value, level| {
        Trial::<Pgd>::new(&given, level, Key([1; 32])).unwrap().frame(&before, 5, 0.0).unwrap()
    };
    let from = steered(&before);
    let left =
        [0.0, 1.0, 2.0, 3.0].map(|level| steered(&made(json!({"model": "dave2", "goal": "left"}), level)));
    println!("dave2: {from}, to the left {left:?}");
    assert!(left[0] < from && left.windows(2).all(|pair| pair[1] < pair[0]), "{from} {left:?}");
    let one = Trial::<Fgsm>::new(&json!({"model": "dave2", "goal": "left"}), 2.0, Key([1; 32]))
        .unwrap()
        .frame(&before, 5, 0.0);
    assert!(left[2] < steered(&one.unwrap()), "several steps are stronger than one");
    // The same key gives the same bytes, and another frame another start.
    let given = json!({"model": "dave2", "goal": "left"});
    assert_eq!(made(given.clone(), 1.0), made(given.clone(), 1.0));
    let other = Trial::<Pgd>::new(&given, 1.0, Key([1; 32])).unwrap().frame(&before, 6, 0.0).unwrap();
    assert!(other != made(given, 1.0));
}

#[test]
fn rules() {
    for given in [json!({"model": "dave2"}), json!({"model": "dave2_temporal"})] {
        let before = road();
        for level in [0.0, 4.0] {
            let found =
                Trial::<Fgsm>::new(&given, level, Key([1; 32])).unwrap().frame(&before, 0, 0.0).unwrap();
            let most = found.data().iter().zip(before.data()).map(|(a, b)| a.abs_diff(*b)).max();
            assert_eq!(most, Some(if level == 0.0 { 1 } else { 16 }), "{given}");
        }
    }
    pdk_sdk::testing::perturbation::<Fgsm>();
    pdk_sdk::testing::perturbation::<Pgd>();
    pdk_sdk::testing::perturbation::<SquareAttack>();
}
