//! Tests of the methods on small networks whose answer is known, and on the real one if it is at hand.

use std::time::Instant;

use pdk_onnx::testing::{Setting, Sketch};
use pdk_onnx::{Tensor, model};
use pdk_sdk::prelude::*;
use pdk_sdk::saliency;
use pdk_sdk::seed::Key;
use pdk_sdk::serde_json::{Value, json};
use tempfile::NamedTempFile;

use crate::fixture;
use crate::gradient_tests::engines;
use crate::saliency::eigen_cam::EigenCam;
use crate::saliency::expected_gradients::ExpectedGradients;
use crate::saliency::grad_cam::GradCam;
use crate::saliency::grad_cam_plus_plus::GradCamPlusPlus;
use crate::saliency::grad_cam_published::PublishedGradCam;
use crate::saliency::gradient::Gradient;
use crate::saliency::hirescam::HiResCam;
use crate::saliency::integrated_gradients::{Integrated, IntegratedGradients};
use crate::saliency::method::Method;
use crate::saliency::occlusion::Occlusion;
use crate::saliency::rise::Rise;
use crate::saliency::score_cam::ScoreCam;
use crate::saliency::smooth_grad::SmoothGrad;
use crate::saliency::viewer::Viewer;

/// A network that sees brightness in the right half of an image of 32 x 16 and nothing else: a convolution of 4 x 4 with
/// stride 4, a ReLU, and weights of the cells. `sign` is the sign of those.
fn right_half(sign: f64) -> NamedTempFile {
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 16, 32]);
    let filter = s.weights("filter", Tensor::floats(&[1, 3, 4, 4], vec![1.0 / 48.0 / 255.0; 48]));
    s.node("Conv", &["image", &filter], "features", &[("strides", Setting::Ints(&[4, 4]))]);
    s.node("Relu", &["features"], "seen", &[]);
    s.node("Flatten", &["seen"], "flat", &[]);
    let weights = (0..32).map(|cell| if cell % 8 >= 4 { sign / 16.0 } else { 0.0 }).collect();
    let weights = s.weights("weights", Tensor::floats(&[32, 1], weights));
    s.node("MatMul", &["flat", &weights], "steering", &[]);
    save(&s)
}

fn save(sketch: &Sketch) -> NamedTempFile {
    let file = NamedTempFile::with_suffix(".onnx").unwrap();
    std::fs::write(file.path(), model::encode(&sketch.model(&["steering"]))).unwrap();
    file
}

fn config<M: Component>(file: &NamedTempFile, mut more: Value) -> Result<Config> {
    let given = more.as_object_mut().unwrap();
    given.insert("model".into(), file.path().to_str().unwrap().into());
    Config::check(&M::description(), given)
}

fn open<M: Component>(file: &NamedTempFile, more: Value) -> Result<M> {
    M::new(&config::<M>(file, more)?)
}

fn error(found: Result<()>) -> String {
    found.unwrap_err().to_string()
}

fn bright(width: usize, height: usize) -> FrameBuf {
    let pixels = (0..width * height * 3).map(|i| 150 + (i * 31 % 101) as u8).collect();
    FrameBuf::from_vec(pixels, width, height).unwrap()
}

fn map<M: Saliency>(method: &mut M, frame: &FrameBuf) -> Vec<f32> {
    let [width, height] = method.map_size(frame.width(), frame.height()).unwrap();
    let mut values = vec![f32::NAN; width * height];
    let key = Key([7; 32]);
    let cx = MapContext::new(3, 0.1, &key);
    method.map(frame.as_ref(), &cx, HeatmapMut::new(&mut values, width, height).unwrap()).unwrap();
    values
}

/// The mean of a map over the left and the right quarter of a frame.
fn sides(values: &[f32], width: usize) -> (f32, f32) {
    let mean = |columns: std::ops::Range<usize>| {
        let picked: Vec<f32> = values
            .iter()
            .enumerate()
            .filter(|(at, _)| columns.contains(&(at % width)))
            .map(|(_, v)| *v)
            .collect();
        picked.iter().sum::<f32>() / picked.len() as f32
    };
    (mean(0..width / 4), mean(width - width / 4..width))
}

/// Checks that a method finds the right half, on frames of the model's size and of another one, on every engine.
fn finds<M: Component + Saliency + 'static>(more: Value) {
    let name = M::description().name;
    for engine in engines() {
        let mut more = more.clone();
        more["engine"] = engine.into();
        let file = right_half(1.0);
        for (width, height) in [(32, 16), (64, 48)] {
            let values = map(&mut open::<M>(&file, more.clone()).unwrap(), &bright(width, height));
            let (left, right) = sides(&values, width);
            assert!(right > 0.5 && right > 2.0 * left, "{name} on {engine}: left {left}, right {right}");
        }
        let config = config::<M>(&file, more.clone()).unwrap();
        let checked =
            saliency::check(&M::description(), &config, &mut |config| Ok(Box::new(M::new(config)?)));
        checked.unwrap_or_else(|error| panic!("{name} on {engine}: {error}"));
    }
}

#[test]
fn every_method_but_eigen_cam_finds_what_the_network_looks_at() {
    finds::<Gradient>(json!({}));
    finds::<SmoothGrad>(json!({"samples": 4}));
    finds::<SmoothGrad>(json!({"samples": 4, "statistic": "square"}));
    finds::<IntegratedGradients>(json!({"steps": 4, "fill": "black"}));
    let pictures = pictures(&[[0; 3]]);
    finds::<ExpectedGradients>(json!({"samples": 4, "pictures": pictures.path()}));
    finds::<HiResCam>(json!({}));
    finds::<Occlusion>(json!({"patch": 0.25, "fill": "black"}));
    finds::<Rise>(json!({"samples": 300, "fill": "black"}));
}

/// A folder with pictures of these colours, and with a file that is none.
fn pictures(colors: &[[u8; 3]]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (at, color) in colors.iter().enumerate() {
        let picture = image::RgbImage::from_pixel(64, 48, image::Rgb(*color));
        picture.save(folder.path().join(format!("{at}.png"))).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "none").unwrap();
    folder
}

/// A network that is not linear: the hyperbolic tangent of what two filters see in an image of 16 x 8.
fn bent() -> NamedTempFile {
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 8, 16]);
    let filter = (0..96).map(|at| (f64::from(at * 37 % 19) - 7.0) / 9.0 / 255.0).collect();
    let filter = s.weights("filter", Tensor::floats(&[2, 3, 4, 4], filter));
    s.node("Conv", &["image", &filter], "features", &[("strides", Setting::Ints(&[4, 4]))]);
    s.node("Flatten", &["features"], "flat", &[]);
    let weights = (0..32).map(|at| f64::from(at % 5) / 160.0).collect();
    let weights = s.weights("weights", Tensor::floats(&[16, 2], weights));
    s.node("MatMul", &["flat", &weights], "sum", &[]);
    s.node("Tanh", &["sum"], "steering", &[]);
    save(&s)
}

#[test]
fn integrated_gradients_add_up_to_the_difference_of_the_outputs() {
    let file = bent();
    let frame = bright(16, 8);
    let mut black = FrameBuf::new(16, 8);
    black.as_mut().rows_mut().for_each(|row| row.fill(0));
    for engine in engines() {
        let config =
            config::<IntegratedGradients>(&file, json!({"fill": "black", "steps": 200, "engine": engine}))
                .unwrap();
        let mut viewer = Viewer::open(&config).unwrap();
        let mut method = Integrated::new(&mut viewer, &config).unwrap();
        let key = Key([7; 32]);
        let grid = method.grid(&mut viewer, frame.as_ref(), &MapContext::new(0, 0.0, &key)).unwrap();
        let difference = viewer.answer(frame.as_ref()).unwrap() - viewer.answer(black.as_ref()).unwrap();
        let sum: f64 = grid.values.iter().sum();
        assert!(difference.abs() > 0.5, "{difference} would be easy");
        assert!((sum - difference).abs() < 1e-4, "{engine}: {sum} {difference}");
    }
}

#[test]
fn expected_gradients_of_one_picture_are_integrated_gradients_from_it() {
    let file = bent();
    let frame = bright(16, 8);
    let black = pictures(&[[0; 3]]);
    let given = json!({"samples": 4000, "sign": "signed", "pictures": black.path()});
    let expected = map(&mut open::<ExpectedGradients>(&file, given).unwrap(), &frame);
    let given = json!({"steps": 200, "sign": "signed", "fill": "black"});
    let integrated = map(&mut open::<IntegratedGradients>(&file, given).unwrap(), &frame);
    let farthest = expected.iter().zip(&integrated).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(farthest < 0.03, "{farthest}");
    // Compared with a brighter picture, what is dark contributes, and the other way.
    let white = pictures(&[[255; 3]]);
    let given = json!({"samples": 400, "sign": "signed", "pictures": white.path()});
    let other = map(&mut open::<ExpectedGradients>(&file, given).unwrap(), &frame);
    assert!(other.iter().zip(&integrated).any(|(a, b)| (a - b).abs() > 0.1));

    let empty = tempfile::tempdir().unwrap();
    for (folder, expected) in
        [(empty.path().to_owned(), "has no pictures"), (empty.path().join("none"), "cannot read the folder")]
    {
        let error = open::<ExpectedGradients>(&file, json!({"pictures": folder})).err().unwrap().to_string();
        assert!(error.contains(expected) && error.contains("`pictures`"), "{error}");
    }
}

#[test]
fn the_variance_of_gradients_is_zero_where_a_network_is_linear() {
    let (linear, frame) = (right_half(1.0), bright(32, 16));
    let of = |file: &NamedTempFile, statistic: &str, frame: &FrameBuf| {
        map(&mut open::<SmoothGrad>(file, json!({"samples": 8, "statistic": statistic})).unwrap(), frame)
    };
    // Its ReLU is far from 0 on a bright frame.
    assert!(of(&linear, "variance", &frame).iter().all(|value| *value == 0.0));
    assert_eq!(of(&linear, "square", &frame).iter().filter(|value| **value == 1.0).count(), 256);
    assert!(of(&bent(), "variance", &bright(16, 8)).contains(&1.0));
}

#[test]
fn the_map_of_a_network_that_sees_a_part_of_the_frame_lies_over_that_part() {
    let file = right_half(1.0);
    let region = json!({"patch": 0.25, "fill": "black", "region": [0.0, 0.5, 1.0, 1.0], "size": "layer"});
    for (values, method) in [
        (map(&mut open::<Occlusion>(&file, region).unwrap(), &bright(64, 48)), "occlusion"),
        (
            map(&mut open::<HiResCam>(&file, json!({"crop": {"top": 24}})).unwrap(), &bright(64, 48)),
            "hirescam",
        ),
    ] {
        assert_eq!(values.len(), 64 * 48, "{method}: a map of cells would lie over the whole frame");
        let (above, below) = values.split_at(24 * 64);
        assert!(above.iter().all(|value| *value == 0.0), "{method}");
        let (left, right) = sides(below, 64);
        assert!(right > 0.5 && right > 2.0 * left, "{method}: left {left}, right {right}");
    }
}

#[test]
fn bins_have_no_gradient_and_are_explained_without_one() {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/networks/categorical.onnx");
    let with = |more: Value| {
        let mut given = json!({"model": model});
        given.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        given
    };
    let config = Config::check(&Gradient::description(), with(json!({})).as_object().unwrap()).unwrap();
    let error = Gradient::new(&config).err().unwrap().to_string();
    assert!(
        error.contains("its output `angle_out` holds bins, and the choice of one has no gradient"),
        "{error}"
    );
    let given = with(
        json!({"patch": 0.3, "steering": {"output": "angle_out", "bins": {"from": -1, "to": 1, "count": 15}, "decode": "mean"}}),
    );
    let config = Config::check(&Occlusion::description(), given.as_object().unwrap()).unwrap();
    let values = map(&mut Occlusion::new(&config).unwrap(), &bright(80, 60));
    assert!(values.contains(&1.0));
}

#[test]
fn methods_that_weigh_whole_channels_show_where_those_are_active() {
    // One channel that is active everywhere: there is nothing to tell its halves apart.
    let file = right_half(1.0);
    for values in [
        map(&mut open::<GradCam>(&file, json!({})).unwrap(), &bright(32, 16)),
        map(&mut open::<GradCamPlusPlus>(&file, json!({})).unwrap(), &bright(32, 16)),
        map(&mut open::<EigenCam>(&file, json!({})).unwrap(), &bright(32, 16)),
    ] {
        let (left, right) = sides(&values, 32);
        assert!((left - right).abs() < 0.1 && left > 0.9, "{left} {right}");
    }
}

#[test]
fn the_throttle_is_explained_on_demand_and_the_published_method_explains_the_sum() {
    // One channel sees red and steers, the other one sees green and gives the throttle.
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 16, 32]);
    let colors =
        (0..96).map(|at| if at / 16 == 0 || at / 16 == 4 { 1.0 / 16.0 / 255.0 } else { 0.0 }).collect();
    let filter = s.weights("filter", Tensor::floats(&[2, 3, 4, 4], colors));
    s.node("Conv", &["image", &filter], "features", &[("strides", Setting::Ints(&[4, 4]))]);
    s.node("Relu", &["features"], "seen", &[]);
    s.node("Flatten", &["seen"], "flat", &[]);
    let weights = (0..128).map(|at| if at / 64 == at % 2 { 1.0 / 32.0 } else { 0.0 }).collect();
    let weights = s.weights("weights", Tensor::floats(&[64, 2], weights));
    s.node("MatMul", &["flat", &weights], "steering", &[]);
    let file = save(&s);
    let mut frame = FrameBuf::new(32, 16);
    for y in 0..16 {
        (0..8).for_each(|x| frame.as_mut().set_pixel(x, y, [200, 0, 0]));
        (24..32).for_each(|x| frame.as_mut().set_pixel(x, y, [0, 200, 0]));
    }
    let sides_of = |values: Vec<f32>| {
        let (left, right) = sides(&values, 32);
        (left > 0.8, right > 0.8, left < 0.1, right < 0.1)
    };
    let explained =
        |what: &str| sides_of(map(&mut open::<GradCam>(&file, json!({"explain": what})).unwrap(), &frame));
    assert_eq!(explained("steering"), (true, false, false, true));
    assert_eq!(explained("throttle"), (false, true, true, false));
    let published = map(&mut open::<PublishedGradCam>(&file, json!({})).unwrap(), &frame);
    assert_eq!(sides_of(published), (true, true, false, false));
    assert!(open::<PublishedGradCam>(&file, json!({"explain": "steering"})).is_err());
}

/// A network that does not drive: a score for the left half of a picture and one for the right half, and for each of four candidates where it is and
/// two scores, as detectors give them.
fn detector() -> NamedTempFile {
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 16, 32]);
    let filter = s.weights("filter", Tensor::floats(&[1, 3, 4, 4], vec![1.0 / 48.0; 48]));
    s.node("Conv", &["image", &filter], "seen", &[("strides", Setting::Ints(&[4, 4]))]);
    s.node("Flatten", &["seen"], "flat", &[]);
    // Cells are 4 rows of 8; a half has 16.
    let halves = (0..64).map(|at| f64::from(u8::from(at / 2 % 8 / 4 == at % 2)) / 16.0).collect();
    let halves = s.weights("halves", Tensor::floats(&[32, 2], halves));
    s.node("MatMul", &["flat", &halves], "scores", &[]);
    // Candidates are the quarters of the width; the score of class 1 is the brightness there, that of class 0 its opposite.
    let candidate = |at: usize| match (at % 24 / 4, at % 4, at / 24 % 8 / 2) {
        (4, own, quarter) if own == quarter => -1.0 / 8.0,
        (5, own, quarter) if own == quarter => 1.0 / 8.0,
        _ => 0.0,
    };
    let candidates =
        s.weights("candidates", Tensor::floats(&[32, 24], (0..32 * 24).map(candidate).collect()));
    s.node("MatMul", &["flat", &candidates], "rows", &[]);
    let shape = s.ints(&[1, 6, 4]);
    s.node("Reshape", &["rows", &shape], "boxes", &[]);
    let file = NamedTempFile::with_suffix(".onnx").unwrap();
    std::fs::write(file.path(), model::encode(&s.model(&["scores", "boxes"]))).unwrap();
    file
}

#[test]
fn classes_and_boxes_of_networks_that_do_not_drive_can_be_explained() {
    let file = detector();
    let mut frame = FrameBuf::new(32, 16);
    for y in 0..16 {
        for x in 0..32 {
            // Brightest in the third quarter.
            let value = [40, 80, 200, 120][x / 8];
            frame.as_mut().set_pixel(x, y, [value; 3]);
        }
    }
    // Which quarters of a map hold nearly all of it.
    let quarters = |values: Vec<f32>| -> Vec<usize> {
        let sum: f32 = values.iter().sum();
        let of = |quarter: usize| {
            let inside = values.iter().enumerate().filter(|(at, _)| at % 32 / 8 == quarter);
            inside.map(|(_, value)| value).sum::<f32>() / sum
        };
        (0..4).filter(|quarter| of(*quarter) > 0.1).collect()
    };
    for (explain, expected) in [
        ("scores[0]", vec![0, 1]),
        ("scores[1]", vec![2, 3]),
        ("max(scores)", vec![2, 3]),
        ("boxes[0,5,1]", vec![1]),
        ("boxes[0,5,*]", vec![2]),
    ] {
        for engine in engines() {
            let given = json!({"explain": explain, "engine": engine});
            let gradient = quarters(map(&mut open::<Gradient>(&file, given.clone()).unwrap(), &frame));
            assert_eq!(gradient, expected, "gradient of {explain} on {engine}");
            let covered = json!({"explain": explain, "engine": engine, "fill": "black"});
            let covered = quarters(map(&mut open::<Occlusion>(&file, covered).unwrap(), &frame));
            // A patch covers parts of what lies beside it.
            assert!(expected.iter().all(|quarter| covered.contains(quarter)), "{explain}: {covered:?}");
        }
    }
    // Without a name, and with names that mean nothing.
    let steering = error(open::<HiResCam>(&file, json!({})).map(drop));
    assert!(
        steering.ends_with("if the network does not drive, name the number to explain with `explain`"),
        "{steering}"
    );
    for (explain, part) in [
        ("score[0]", "explain: `score[0]`: there is no value `score`"),
        ("scores", "explain: `scores` has 2 numbers"),
        ("boxes[0,6,0]", "explain: `boxes` has the shape (1, 6, 4)"),
        ("squared_error(scores)", "explain: `squared_error(scores)` is a loss, which needs a target"),
    ] {
        let found = error(open::<HiResCam>(&file, json!({"explain": explain})).map(drop));
        assert!(found.contains(part), "{explain}: {found}");
    }
}

#[test]
fn the_sign_says_what_lowers_the_output() {
    let frame = bright(32, 16);
    let file = right_half(-1.0);
    let sides_of =
        |sign: &str| sides(&map(&mut open::<HiResCam>(&file, json!({"sign": sign})).unwrap(), &frame), 32);
    assert!(sides_of("absolute").1 > 0.9);
    assert_eq!(sides_of("positive"), (0.0, 0.0));
    let (left, right) = sides_of("signed");
    assert!((left - 0.5).abs() < 1e-6 && right < 0.05, "{left} {right}");
}

#[test]
fn one_value_for_each_cell_is_given_where_that_is_asked_for() {
    let file = right_half(1.0);
    let mut method = open::<HiResCam>(&file, json!({"size": "layer"})).unwrap();
    assert_eq!(method.map_size(320, 160).unwrap(), [8, 4]);
    let values = map(&mut method, &bright(320, 160));
    assert!(values.iter().enumerate().all(|(cell, value)| (*value > 0.8) == (cell % 8 >= 4)), "{values:?}");
    // A frame with fewer pixels than the layer has cells has a value for each pixel.
    assert_eq!(method.map_size(4, 4).unwrap(), [4, 4]);
    assert_eq!(map(&mut method, &bright(4, 4)).len(), 16);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_real_network_is_explained_by_every_method_in_little_time() {
    let Some(path) = fixture::shared("tub_pilot.onnx") else { return };
    let given = |more: Value| {
        let mut more = more;
        more["model"] = path.to_str().unwrap().into();
        more
    };
    let frame = bright(160, 120);
    fn time<M: Component + Saliency + 'static>(frame: &FrameBuf, given: Value) {
        let description = M::description();
        let config = Config::check(&description, given.as_object().unwrap()).unwrap();
        let mut method = M::new(&config).unwrap();
        let first = map(&mut method, frame);
        let start = Instant::now();
        let repeats = 5;
        for _ in 0..repeats {
            assert_eq!(map(&mut method, frame), first);
        }
        println!(
            "{}: {:.2} ms a map",
            description.name,
            start.elapsed().as_secs_f64() * 1e3 / f64::from(repeats)
        );
        assert!(first.iter().all(|value| (0.0..=1.0).contains(value)));
    }
    for engine in engines() {
        println!("on {engine}:");
        let given = || given(json!({"engine": engine}));
        time::<GradCam>(&frame, given());
        time::<GradCamPlusPlus>(&frame, given());
        time::<HiResCam>(&frame, given());
        time::<PublishedGradCam>(&frame, given());
        time::<Gradient>(&frame, given());
        time::<SmoothGrad>(&frame, given());
        time::<IntegratedGradients>(&frame, given());
        time::<EigenCam>(&frame, given());
        time::<ScoreCam>(&frame, given());
        time::<Occlusion>(&frame, given());
        time::<Rise>(&frame, given());
    }
}

#[test]
fn hirescam_is_the_same_before_and_behind_the_activation_function() {
    let Some(path) = fixture::shared("tub_pilot.onnx") else { return };
    let frame = bright(160, 120);
    for engine in engines() {
        let maps = [true, false].map(|activation| {
            let given = json!({"model": path.to_str().unwrap(), "engine": engine, "activation": activation, "layer": "conv2d_4"});
            let config = Config::check(&HiResCam::description(), given.as_object().unwrap()).unwrap();
            map(&mut HiResCam::new(&config).unwrap(), &frame)
        });
        let largest = maps[0].iter().zip(&maps[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest < 1e-5, "{engine}: {largest}");
    }
}

#[test]
fn what_cannot_be_explained_is_a_sentence() {
    let file = right_half(1.0);
    let place = format!("model `{}`: ", file.path().display());
    let layer = error(open::<HiResCam>(&file, json!({"layer": "conv_7"})).map(drop));
    assert_eq!(
        layer,
        format!(
            "{place}it has no layer `conv_7` whose cells have a place on the image; its convolutions are `conv_0`"
        )
    );
    let output = error(open::<GradCam>(&file, json!({"steering": "speed"})).map(drop));
    assert_eq!(
        output,
        format!(
            "{place}the parameters: `steering` names the output `speed`, which the network does not have; there is only `steering`"
        )
    );
    let throttle = error(open::<GradCam>(&file, json!({"explain": "throttle"})).map(drop));
    assert_eq!(
        throttle,
        format!("{place}it gives no throttle, so only its steering can be explained; leave `explain` out")
    );

    // Without a convolution.
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 4, 4]);
    let weights = s.drawn(&[48, 1], -0.01, 0.01);
    s.node("Flatten", &["image"], "flat", &[]);
    s.node("MatMul", &["flat", &weights], "steering", &[]);
    let dense = save(&s);
    let none = error(open::<GradCam>(&dense, json!({})).map(drop));
    assert!(none.contains("it has no convolution whose cells have a place on the image"), "{none}");
    assert!(open::<Gradient>(&dense, json!({})).is_ok());

    // An operator without a gradient, behind which other methods still work.
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 4, 4]);
    let (filter, weights) = (s.drawn(&[2, 3, 3, 3], -0.01, 0.01), s.drawn(&[2, 1], -0.01, 0.01));
    s.node("Conv", &["image", &filter], "seen", &[]);
    s.node("GlobalLpPool", &["seen"], "pooled", &[]);
    s.node("Flatten", &["pooled"], "flat", &[]);
    s.node("MatMul", &["flat", &weights], "steering", &[]);
    let pooled = save(&s);
    let lacking = error(open::<GradCam>(&pooled, json!({})).map(drop));
    assert!(
        lacking.contains("GlobalLpPool")
            && lacking.ends_with("eigen-cam, score-cam, rise and occlusion work without one"),
        "{lacking}"
    );
    assert!(open::<EigenCam>(&pooled, json!({})).is_ok() && open::<ScoreCam>(&pooled, json!({})).is_ok());
    assert!(
        open::<Rise>(&pooled, json!({"samples": 3})).is_ok() && open::<Occlusion>(&pooled, json!({})).is_ok()
    );

    // An output that no change of the layer moves.
    let mut s = Sketch::new(13);
    s.input("image", &[1, 3, 4, 4]);
    let filter = s.drawn(&[1, 3, 4, 4], -0.01, 0.01);
    s.node("Conv", &["image", &filter], "seen", &[]);
    s.node("Floor", &["seen"], "steps", &[]);
    s.node("Flatten", &["steps"], "steering", &[]);
    let flat = error(open::<Gradient>(&save(&s), json!({})).map(drop));
    assert!(
        flat.contains("`steering` does not change with `image`: its gradient is zero everywhere"),
        "{flat}"
    );
}
