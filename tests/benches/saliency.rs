//! What a saliency map costs, beside the forward pass of its network, in milliseconds: for each method, engine and network.
//!
//! ```sh
//! cargo build --release && cargo bench --bench saliency [-- --model FILE.onnx]
//! ```
//!
//! ONNX Runtime is measured if it is installed, `dave2` always, and the network that `--model` names. Each number is the median
//! over maps of the same frame; a method runs the network as often as its defaults say.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::time::{Duration, Instant};

use pdk_components::search_path::SearchPath;
use pdk_sdk::describe::Kind;
use pdk_sdk::prelude::*;
use pdk_tests::pictures;
use serde_json::{Map, Value};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 160;
/// A measurement takes about so long, and at least this many maps.
const PATIENCE: Duration = Duration::from_secs(2);
const LEAST: usize = 5;

/// The median duration of a call in milliseconds.
fn milliseconds(mut call: impl FnMut(u64)) -> f64 {
    // The first call prepares memory.
    call(0);
    let began = Instant::now();
    let mut taken = Vec::new();
    while taken.len() < LEAST || began.elapsed() < PATIENCE {
        let start = Instant::now();
        call(taken.len() as u64 + 1);
        taken.push(start.elapsed().as_secs_f64() * 1e3);
    }
    taken.sort_by(f64::total_cmp);
    taken[taken.len() / 2]
}

fn main() {
    let search = SearchPath::default();
    let registry = pdk_tests::registry(&search);
    let picture = pictures::road(WIDTH, HEIGHT, 1);
    let frame = FrameBuf::from_vec(picture.into_raw(), WIDTH as usize, HEIGHT as usize).unwrap();
    let methods: Vec<String> =
        registry.catalog().of_kind(Kind::Saliency).map(|entry| entry.description.name.clone()).collect();

    let arguments: Vec<String> = std::env::args().collect();
    let named = arguments.iter().position(|argument| argument == "--model").map(|at| &arguments[at + 1]);
    let networks = [Some("dave2"), named.map(String::as_str)];
    for network in networks.into_iter().flatten() {
        for engine in ["pdk", "onnxruntime"] {
            let values: Map<String, Value> =
                [("model".to_owned(), network.into()), ("engine".to_owned(), engine.into())]
                    .into_iter()
                    .collect();
            // A network that is part of pdk is a driver by its own name.
            let driver = match network {
                "dave2" => {
                    registry.driver("dave2", &[("engine".to_owned(), engine.into())].into_iter().collect())
                }
                _ => registry.driver("onnx", &values),
            };
            let mut driver = match driver {
                Ok((driver, _)) => driver,
                Err(error) => {
                    println!("{network} on {engine}: not measured, because {error}");
                    continue;
                }
            };
            let forward = milliseconds(|frame_index| {
                let cx = DriveContext { frame_index, time: 0.0, speed: 8.0 };
                driver.drive(frame.as_ref(), &cx).unwrap();
            });
            println!("{network} on {engine}: a forward pass takes {forward:.2} ms at {WIDTH}x{HEIGHT}");
            for name in &methods {
                let mut values = values.clone();
                if name == "expected-gradients" {
                    let pictures = pdk_tests::repository().join("docs/examples/recording/frames");
                    values.insert("pictures".to_owned(), pictures.to_str().unwrap().into());
                }
                let (mut method, _) = registry.saliency(name, &values).unwrap();
                let key = Key([1; 32]);
                let [width, height] = method.map_size(WIDTH as usize, HEIGHT as usize).unwrap();
                let mut map = vec![0.0; width * height];
                let took = milliseconds(|frame_index| {
                    let cx = MapContext::new(frame_index, 0.0, &key);
                    method
                        .map(frame.as_ref(), &cx, HeatmapMut::new(&mut map, width, height).unwrap())
                        .unwrap();
                });
                println!("  {name:<20} {took:>8.2} ms, {:>7.1} times the forward pass", took / forward);
            }
        }
    }
}
