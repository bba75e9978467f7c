//! Tests against the reference outputs of the published tool, shared by the plugin crates (`#[path]`).
//!
//! A small set of the deterministic ones is part of the repository: `tests/golden`. A larger one, with real images and with
//! statistics of the random ones, lies in the folder that `PDK_TEST_DATA` names, or else in `shared` beside the repository;
//! where it is missing, the tests say so.

// Every crate uses a part of this file. Its pictures may differ in a last digit from system to system.
#![allow(dead_code, clippy::disallowed_methods)]

use std::path::PathBuf;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, from_str};
use pdk_sdk::testing::Trial;

const IMAGES: [&str; 3] = ["road", "track", "cat_odd"];

/// Applies a perturbation with the parameters `given` by the user.
pub fn perturb<P: Component + Perturbation>(
    given: &Value,
    src: Frame<'_>,
    intensity: f64,
    key: &Key,
    frame_index: u64,
) -> FrameBuf {
    let mut dst = FrameBuf::new(src.width(), src.height());
    perturb_into::<P>(given, src, dst.as_mut(), intensity, key, frame_index);
    dst
}

/// As [`perturb`], into a frame that exists.
pub fn perturb_into<P: Component + Perturbation>(
    given: &Value,
    src: Frame<'_>,
    dst: FrameMut<'_>,
    intensity: f64,
    key: &Key,
    frame_index: u64,
) {
    let mut trial = Trial::<P>::new(given, intensity, *key).unwrap();
    let (instance, cx) = trial.at(frame_index, 0.0);
    instance.apply(src, dst, &cx).unwrap();
}

/// The folder with the large set of reference outputs, if there is one.
fn folder() -> Option<PathBuf> {
    let data = std::env::var_os("PDK_TEST_DATA")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let folder = data.join("golden");
    if folder.join("index.json").is_file() {
        return Some(folder);
    }
    eprintln!(
        "skipped: no large set of reference outputs in {}; PDK_TEST_DATA can name the folder",
        folder.display()
    );
    None
}

fn read_image(path: PathBuf) -> FrameBuf {
    pdk_image::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn index(folder: &std::path::Path) -> Value {
    from_str(&std::fs::read_to_string(folder.join("index.json")).unwrap()).unwrap()
}

/// Checks a deterministic perturbation against the small set, and against the large one if there is one: on all images and
/// levels 99.9 % of the values within one grey level of the reference, and the mean absolute difference below `mean_limit`.
pub fn matches_outputs<P: Component + Perturbation>(mean_limit: f64) {
    matches_small_set::<P>(mean_limit);
    let Some(folder) = folder() else { return };
    let name = P::description().name;
    let statistics = index(&folder);
    for image in IMAGES {
        let src = read_image(folder.join(format!("inputs/{image}.png")));
        for level in 0..5 {
            let expected = read_image(folder.join(format!("outputs/{name}/{image}_{level}.png")));
            is_close::<P>(image, &src, &expected, level, mean_limit);
            // The statistics of the reference itself check the functions that the random perturbations are judged by.
            let recorded = &statistics["deterministic"][&name][level.to_string()][image];
            let measured = measure(&src, &expected);
            for statistic in ["mse", "ssim", "mean_abs_diff"] {
                let (recorded, measured) =
                    (recorded[statistic].as_f64().unwrap(), measured.get(statistic)[0]);
                assert!((recorded - measured).abs() < 2e-5, "{statistic}: {recorded}, here {measured}");
            }
        }
    }
}

/// The part of [`matches_outputs`] that needs nothing but the repository: a crop of a frame of the embedded simulator, and the
/// outputs for it, one level under the other.
fn matches_small_set<P: Component + Perturbation>(mean_limit: f64) {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden");
    let src = read_image(folder.join("lane.png"));
    let outputs = read_image(folder.join(format!("outputs/{}.png", P::description().name)));
    let size = src.data().len();
    assert_eq!((outputs.width(), outputs.height()), (src.width(), 5 * src.height()));
    for (level, expected) in (0..5).zip(outputs.data().chunks(size)) {
        let expected = FrameBuf::from_vec(expected.to_vec(), src.width(), src.height()).unwrap();
        is_close::<P>("lane", &src, &expected, level, mean_limit);
    }
}

fn is_close<P: Component + Perturbation>(
    image: &str,
    src: &FrameBuf,
    expected: &FrameBuf,
    level: u32,
    mean_limit: f64,
) {
    let name = P::description().name;
    let actual = perturb::<P>(&Value::Null, src.as_ref(), f64::from(level), &Key::default(), 0);
    let differences: Vec<u8> =
        expected.data().iter().zip(actual.data()).map(|(a, b)| a.abs_diff(*b)).collect();
    let count = differences.len() as f64;
    let close = differences.iter().filter(|&&d| d <= 1).count() as f64 / count;
    let mean = differences.iter().map(|&d| f64::from(d)).sum::<f64>() / count;
    println!("{name} {image} {level}: {:.3} % within 1, mean {mean:.4}", 100.0 * close);
    assert!(close >= 0.999 && mean < mean_limit, "{name} on {image} at level {level}: {close}, {mean}");
}

/// Checks a random perturbation on all images and levels: every statistic of its output within four standard
/// deviations of the mean of the reference, or within the range of the reference widened by a tenth.
pub fn matches_statistics<P: Component + Perturbation>() {
    let Some(folder) = folder() else { return };
    let name = P::description().name;
    let reference = index(&folder);
    for image in IMAGES {
        let src = read_image(folder.join(format!("inputs/{image}.png")));
        for level in 0..5u32 {
            let recorded = &reference["stochastic"][&name][level.to_string()][image];
            for seed in 0..3 {
                let output = perturb::<P>(
                    &Value::Null,
                    src.as_ref(),
                    f64::from(level),
                    &Key([seed + 1; 32]),
                    u64::from(seed),
                );
                let measured = measure(&src, &output);
                let recorded = recorded.as_object().unwrap();
                assert!(recorded.len() >= 7, "{name}: statistics are missing");
                for (statistic, recorded) in recorded {
                    let place = format!("{name} on {image} at level {level}, seed {seed}: {statistic}");
                    for (channel, value) in measured.get(statistic).iter().enumerate() {
                        let of = |field: &str| match &recorded[field] {
                            Value::Array(channels) => channels[channel].as_f64().unwrap(),
                            number => number.as_f64().unwrap(),
                        };
                        // Recorded numbers are rounded to five decimals.
                        let margin = 1e-5;
                        let widened = 0.1 * (of("max") - of("min")) + margin;
                        let near = (value - of("mean")).abs() <= 4.0 * of("sd") + margin;
                        let in_range = (of("min") - widened..=of("max") + widened).contains(value);
                        assert!(near || in_range, "{place} is {value}, recorded {recorded}");
                    }
                }
            }
        }
    }
}

/// What is measured of an output.
struct Statistics {
    mean: Vec<f64>,
    std: Vec<f64>,
    mse: f64,
    ssim: f64,
    mean_abs_diff: f64,
    diff_mean: f64,
    frac_changed: f64,
}

impl Statistics {
    fn get(&self, name: &str) -> Vec<f64> {
        match name {
            "mean" => self.mean.clone(),
            "std" => self.std.clone(),
            "mse" => vec![self.mse],
            "ssim" => vec![self.ssim],
            "mean_abs_diff" => vec![self.mean_abs_diff],
            "diff_mean" => vec![self.diff_mean],
            "frac_changed" => vec![self.frac_changed],
            other => panic!("unknown statistic {other}"),
        }
    }
}

fn measure(src: &FrameBuf, output: &FrameBuf) -> Statistics {
    let pixels = (src.width() * src.height()) as f64;
    let pairs = || src.data().iter().zip(output.data()).map(|(&a, &b)| (f64::from(a), f64::from(b)));
    let per_value = |sum: f64| sum / (pixels * 3.0);
    let channel = |c: usize| output.data().iter().skip(c).step_by(3).map(|&v| f64::from(v));
    let mean: Vec<f64> = (0..3).map(|c| channel(c).sum::<f64>() / pixels).collect();
    let variance = |c: usize| channel(c).map(|v| (v - mean[c]).powi(2)).sum::<f64>() / pixels;
    let changed = src.data().chunks(3).zip(output.data().chunks(3)).filter(|(a, b)| a != b).count();
    Statistics {
        std: (0..3).map(|c| variance(c).sqrt()).collect(),
        mse: per_value(pairs().map(|(a, b)| (a - b).powi(2)).sum()),
        ssim: pdk_sdk::ops::compare::structural_similarity(src.as_ref(), output.as_ref()),
        mean_abs_diff: per_value(pairs().map(|(a, b)| (a - b).abs()).sum()),
        diff_mean: per_value(pairs().map(|(a, b)| b - a).sum()),
        frac_changed: changed as f64 / pixels,
        mean,
    }
}

/// Checks that all of the destination is written and nothing beside it, at odd sizes and strides, that the result does
/// not depend on strides, and that the same key gives the same bytes.
pub fn writes_exactly_the_frame<P: Component + Perturbation>(given: &Value) {
    for (width, height) in [(1, 1), (1, 7), (5, 1), (2, 2), (31, 17), (64, 48), (161, 97)] {
        let mut random = Key([9; 32]).sequence();
        let (src_stride, dst_stride) = (width * 3 + 5, width * 3 + 2);
        let mut bytes = vec![0; src_stride * height];
        random.fill(&mut bytes);
        let src = Frame::with_stride(&bytes, width, height, src_stride).unwrap();
        let tight = src.to_buf();
        for intensity in [0.0, 0.7, 2.0, 3.5, 4.0] {
            let key = Key([4; 32]);
            let expected = perturb::<P>(given, tight.as_ref(), intensity, &key, 3);
            for filler in [0x5a, 0xa5] {
                let mut out = vec![filler; dst_stride * height];
                let dst = FrameMut::with_stride(&mut out, width, height, dst_stride).unwrap();
                perturb_into::<P>(given, src, dst, intensity, &key, 3);
                let result = Frame::with_stride(&out, width, height, dst_stride).unwrap();
                assert_eq!(result.to_buf(), expected, "{width}x{height} at {intensity}");
                for row in out.chunks(dst_stride) {
                    assert!(
                        row[width * 3..].iter().all(|&v| v == filler),
                        "wrote beside a {width}x{height} frame"
                    );
                }
            }
        }
    }
}

/// Checks that noise is drawn anew for every frame, and is the same for the same frame.
pub fn draws_anew_for_every_frame<P: Component + Perturbation>() {
    let src = FrameBuf::from_vec(vec![120; 64 * 48 * 3], 64, 48).unwrap();
    let frame = |index| perturb::<P>(&Value::Null, src.as_ref(), 2.0, &Key([5; 32]), index);
    assert_eq!(frame(7), frame(7));
    assert_ne!(frame(7), frame(8));
}

/// A picture whose neighbouring pixels belong together at every scale, as those of a road do: a sum of smooth waves.
fn scene(width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    let mut random = Key([2; 32]).sequence();
    let waves: Vec<[f64; 6]> = (0..24)
        .map(|i| {
            let frequency = 0.01 * f64::from(1 + i).powf(1.3);
            let angle = random.uniform(0.0, 6.3);
            let [r, g, b] = [(); 3].map(|()| random.uniform(10.0, 50.0) / f64::from(1 + i).sqrt());
            [frequency * angle.cos(), frequency * angle.sin(), random.uniform(0.0, 6.3), r, g, b]
        })
        .collect();
    for y in 0..height {
        for x in 0..width {
            let channel = |c: usize| {
                let wave = |w: &[f64; 6]| w[3 + c] * (w[0] * x as f64 + w[1] * y as f64 + w[2]).sin();
                (127.5 + waves.iter().map(wave).sum::<f64>()) as u8
            };
            frame.as_mut().set_pixel(x, y, [channel(0), channel(1), channel(2)]);
        }
    }
    frame
}

/// The intensities from one to another in steps of a quarter.
pub fn quarters(from: f64, to: f64) -> Vec<f64> {
    (0..=((to - from) * 4.0) as usize).map(|i| from + i as f64 / 4.0).collect()
}

/// Checks that the mean squared difference grows over the given intensities and, where `structure` is set, the loss of
/// structural similarity too. A step may fall back by a hundredth of the whole range. Moves of the whole picture lose
/// nearly all similarity at once, and a little of it comes back by chance.
pub fn strength_grows<P: Component + Perturbation>(given: &Value, intensities: &[f64], structure: bool) {
    let src = scene(160, 120);
    let strength = intensities.iter().map(|&intensity| {
        let output = perturb::<P>(given, src.as_ref(), intensity, &Key([6; 32]), 1);
        let measured = measure(&src, &output);
        (measured.mse, 1.0 - measured.ssim)
    });
    let (differences, losses): (Vec<f64>, Vec<f64>) = strength.unzip();
    for (values, checked) in [(differences, true), (losses, structure)] {
        let range = values[values.len() - 1] - values[0];
        let grows = values.windows(2).all(|pair| pair[1] > pair[0] - 0.01 * range);
        assert!(range > 0.0 && (grows || !checked), "{}: {values:.4?}", P::description().name);
    }
}
