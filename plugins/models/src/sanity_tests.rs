//! A sanity check of the methods: a map that stays what it is when the network's weights are mixed up shows edges of the frame, and not what
//! the network looks at (Adebayo et al., "Sanity Checks for Saliency Maps", 2018).

use std::path::Path;

use pdk_onnx::model;
use pdk_sdk::prelude::*;
use pdk_sdk::seed::{Key, key};
use pdk_sdk::serde_json::{Value, json};
use tempfile::NamedTempFile;

use crate::saliency::eigen_cam::EigenCam;
use crate::saliency::expected_gradients::ExpectedGradients;
use crate::saliency::grad_cam::GradCam;
use crate::saliency::grad_cam_plus_plus::GradCamPlusPlus;
use crate::saliency::grad_cam_published::PublishedGradCam;
use crate::saliency::gradient::Gradient;
use crate::saliency::hirescam::HiResCam;
use crate::saliency::integrated_gradients::IntegratedGradients;
use crate::saliency::occlusion::Occlusion;
use crate::saliency::rise::Rise;
use crate::saliency::score_cam::ScoreCam;
use crate::saliency::smooth_grad::SmoothGrad;

const NETWORKS: [&str; 3] = ["dave2", "dave2_augmented", "dave2_tub"];

fn at_root(path: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// The network of this name with the weights of each of its tensors in another order.
fn mixed(name: &str, seed: u64) -> NamedTempFile {
    let mut network = model::read(&at_root(&format!("scripts/models/{name}.onnx"))).unwrap();
    let mut random = key(seed, "mixed weights", 0).sequence();
    let mut count = 0;
    for tensor in network.graph.iter_mut().flat_map(|graph| &mut graph.initializer) {
        let mut values: Vec<[u8; 4]> =
            tensor.raw_data.chunks_exact(4).map(|value| value.try_into().unwrap()).collect();
        for at in (1..values.len()).rev() {
            values.swap(at, random.below(at as u32 + 1) as usize);
        }
        count += usize::from(values.len() > 20);
        tensor.raw_data = values.concat();
    }
    assert!(count > 8, "{count} tensors were mixed up");
    let file = NamedTempFile::with_suffix(".onnx").unwrap();
    std::fs::write(file.path(), model::encode(&network)).unwrap();
    file
}

/// The places of the values in their order; equal ones share the mean of theirs.
fn ranks(values: &[f32]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    for group in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let first = order.partition_point(|at| values[*at] < values[group[0]]);
        group.iter().for_each(|at| ranks[*at] = first as f64 + (group.len() - 1) as f64 / 2.0);
    }
    ranks
}

/// Spearman's correlation; none if one of the maps is the same everywhere.
fn correlation(one: &[f32], other: &[f32]) -> Option<f64> {
    let (one, other) = (ranks(one), ranks(other));
    let mean = (one.len() - 1) as f64 / 2.0;
    let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum() };
    let size = (sum(&one, &one) * sum(&other, &other)).sqrt();
    (size > 0.0).then(|| sum(&one, &other) / size)
}

fn map<M: Component + Saliency>(model: &Path, frame: &FrameBuf, more: &Value) -> Vec<f32> {
    let mut given = more.clone();
    let own = json!({
        "model": model, "size": "layer", "resize": "linear", "color": "rgb", "scale": "0..255", "engine": "pdk",
        "inputs": {"image": "image", "speed": "speed"}, "steering": {"output": "control", "index": 0},
        "throttle": {"output": "control", "index": 1},
    });
    given.as_object_mut().unwrap().extend(own.as_object().unwrap().clone());
    let config = Config::check(&M::description(), given.as_object().unwrap()).unwrap();
    let mut method = M::new(&config).unwrap();
    let [width, height] = method.map_size(frame.width(), frame.height()).unwrap();
    let mut values = vec![0.0; width * height];
    let key = Key([7; 32]);
    let out = HeatmapMut::new(&mut values, width, height).unwrap();
    method.map(frame.as_ref(), &MapContext::new(0, 0.0, &key), out).unwrap();
    values
}

/// The mean correlation of a method's maps of the networks with those of the mixed ones, over frames and networks.
fn kept<M: Component + Saliency>(step: usize, more: Value) -> f64 {
    let frames: Vec<_> = (0..20)
        .step_by(step)
        .map(|at| pdk_image::read(&at_root(&format!("docs/examples/recording/frames/{at:04}.jpg"))).unwrap())
        .collect();
    let mut found = Vec::new();
    for (seed, name) in NETWORKS.iter().enumerate() {
        let own = at_root(&format!("scripts/models/{name}.onnx"));
        let mixed = mixed(name, seed as u64);
        for frame in &frames {
            let maps = [own.as_path(), mixed.path()].map(|model| map::<M>(model, frame, &more));
            found.extend(correlation(&maps[0], &maps[1]));
        }
    }
    assert!(!found.is_empty(), "no pair of maps can be compared");
    let mean = found.iter().sum::<f64>() / found.len() as f64;
    println!("{} {more}: {mean:+.2} over {} maps", M::description().name, found.len());
    mean
}

fn check(step: usize) {
    let pictures = at_root("docs/examples/recording/frames");
    let default = kept::<HiResCam>(step, json!({}));
    let others = [
        kept::<GradCam>(step, json!({})),
        kept::<GradCamPlusPlus>(step, json!({})),
        kept::<PublishedGradCam>(step, json!({})),
        kept::<Gradient>(step, json!({})),
        kept::<SmoothGrad>(step, json!({})),
        kept::<SmoothGrad>(step, json!({"statistic": "square"})),
        kept::<SmoothGrad>(step, json!({"statistic": "variance"})),
        kept::<IntegratedGradients>(step, json!({"steps": 16})),
        kept::<ExpectedGradients>(step, json!({"samples": 16, "pictures": pictures})),
        kept::<EigenCam>(step, json!({})),
        kept::<ScoreCam>(step, json!({})),
        kept::<Occlusion>(step, json!({})),
        kept::<Rise>(step, json!({"samples": 200})),
    ];
    assert!(default.abs() < 0.4 && others.iter().all(|kept| kept.abs() < 0.8), "{default} {others:?}");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn maps_depend_on_the_weights_of_the_network() {
    check(20);
}

#[test]
#[ignore = "the figures of docs/saliency.md, on more frames"]
fn figures_of_how_maps_depend_on_weights() {
    check(5);
}
