//! What a forward pass of a network takes on each engine, in milliseconds: the built-in networks, or the files that are named.
//!
//! ```sh
//! cargo build --release && cargo bench --bench networks [-- /path/to/FILE.onnx ...]
//! ```
//!
//! ONNX Runtime is measured if it is installed. Each number is the median over frames of 320x240, with the preparation of the frame for the
//! network, which is the same for both. Engines take turns, so that what else the machine does falls on both.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::{Duration, Instant};

use pdk_components::search_path::SearchPath;
use pdk_sdk::prelude::*;
use pdk_tests::pictures;
use serde_json::{Map, Value, json};

/// A turn takes about so long, and at least this many frames.
const TURN: Duration = Duration::from_millis(700);
const LEAST: u64 = 2;
const TURNS: usize = 3;

fn main() {
    let search = SearchPath::default();
    let registry = pdk_tests::registry(&search);
    let frame = FrameBuf::from_vec(pictures::road(320, 240, 1).into_raw(), 320, 240).unwrap();
    let named: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument.ends_with(".onnx")).collect();
    let models = pdk_tests::repository().join("scripts/models");
    let files = match named.is_empty() {
        false => named,
        true => ["dave2", "dave2_quantised", "dave2_temporal", "transformer"]
            .map(|name| models.join(name).with_extension("onnx").display().to_string())
            .to_vec(),
    };
    for file in files {
        let name = Path::new(&file).file_stem().unwrap().to_string_lossy().into_owned();
        let mut engines = Vec::new();
        for engine in ["pdk", "onnxruntime"] {
            let given = json!({"model": file, "engine": engine, "scale": "0..1"});
            let given: Map<String, Value> = given.as_object().unwrap().clone();
            match registry.predictor("network", &given) {
                Ok((predictor, _)) => engines.push((engine, predictor, Vec::new())),
                Err(error) => println!("{name} on {engine}: not measured, because {error}"),
            }
        }
        for _ in 0..TURNS {
            for (_, predictor, taken) in &mut engines {
                let began = Instant::now();
                for number in 0u64.. {
                    let start = Instant::now();
                    let cx = DriveContext { frame_index: number, time: 0.0, speed: 8.0 };
                    predictor.predict(frame.as_ref(), &cx).unwrap();
                    // The first prepares memory.
                    if number > 0 {
                        taken.push(start.elapsed().as_secs_f64() * 1e3);
                    }
                    if number >= LEAST && began.elapsed() > TURN {
                        break;
                    }
                }
            }
        }
        let medians: Vec<(&str, f64)> = engines
            .iter_mut()
            .map(|(engine, _, taken)| {
                taken.sort_by(f64::total_cmp);
                (*engine, taken[taken.len() / 2])
            })
            .collect();
        let texts: Vec<String> =
            medians.iter().map(|(engine, took)| format!("{engine} {took:.2} ms")).collect();
        let ratio = match medians.as_slice() {
            [(_, pdk), (_, other)] => format!(", {:.2} times as long on pdk", pdk / other),
            _ => String::new(),
        };
        if !texts.is_empty() {
            println!("{name}: {}{ratio}", texts.join(", "));
        }
    }
}
