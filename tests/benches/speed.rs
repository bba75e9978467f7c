//! How fast every perturbation and the loop are. Prints what it measures; `tests/speed/compare.py` runs it beside other libraries
//! and writes the tables from both:
//!
//! ```sh
//! cargo build --release                        # the plugins, which the benchmark loads and does not build
//! cargo bench --bench speed                    # everything, for people
//! cargo bench --bench speed -- --only loop     # the loop alone
//! cargo bench --bench speed -- --only contrast --sizes 320x240 --json FILE --frames FOLDER
//! ```
//!
//! Everything is measured in one run on one thread, in processor time of that thread, with a copy of a frame as the yardstick.
//! Perturbations are loaded from their plugins, as they are in use. Each figure is the median over repeated calls. Perturbations
//! that draw where things sit once per sequence keep what they drew, which the published tool does not; they are measured with
//! `draws=per_frame` as well.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_model::level::Level;
use pdk_model::perturbation::{AppliedPerturbation, Draws};
use pdk_preview::preview;
use pdk_sdk::prelude::{Control, FrameBuf, Scenario};
use pdk_tests::Pdk;
use pdk_tests::process::json_file;
use serde_json::{Map, Value, json};

/// A simulator's frame rate: a perturbation sees one frame after the other.
const RATE: f64 = 30.0;

/// What is asked for.
struct Options {
    /// Perturbations; none for all.
    only: Vec<String>,
    sizes: Vec<(usize, usize)>,
    /// Where the figures go.
    json: Option<PathBuf>,
    /// Where the frames go that are perturbed.
    frames: Option<PathBuf>,
}

impl Options {
    fn read() -> Self {
        let mut options =
            Self { only: Vec::new(), sizes: vec![(320, 240), (1280, 720)], json: None, frames: None };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().unwrap_or_else(|| panic!("{argument} needs a value"));
            let list = |text: String| text.split(',').map(str::to_owned).collect::<Vec<_>>();
            match argument.as_str() {
                // Cargo itself passes it.
                "--bench" => {}
                "--only" => options.only = list(value()),
                "--sizes" => options.sizes = list(value()).iter().map(|size| size_of(size)).collect(),
                "--json" => options.json = Some(value().into()),
                "--frames" => options.frames = Some(value().into()),
                other => panic!("there is no option {other}; there are --only, --sizes, --json and --frames"),
            }
        }
        options
    }
}

fn size_of(text: &str) -> (usize, usize) {
    let parse = || Some((text.split_once('x')?.0.parse().ok()?, text.split_once('x')?.1.parse().ok()?));
    parse().unwrap_or_else(|| panic!("{text} is not a size such as 320x240"))
}

fn main() {
    let options = Options::read();
    let registry = pdk_tests::registry(&SearchPath::default());
    let (mut cells, mut copies) = (Vec::new(), Map::new());
    for &(width, height) in &options.sizes {
        let size = format!("{width}x{height}");
        let source = rendered(&registry, width, height);
        if let Some(folder) = &options.frames {
            std::fs::create_dir_all(folder).unwrap();
            pdk_image::write(&folder.join(format!("{size}.png")), source.as_ref()).unwrap();
        }
        let mut target = FrameBuf::new(width, height);
        let copy = median(&mut |_| target.as_mut().copy_from(source.as_ref()));
        println!("{:<28} {size:>9} {copy:>8.4} ms", "a copy of the frame");
        copies.insert(size.clone(), copy.into());
        for shown in preview::chosen(registry.catalog(), &[], true).unwrap() {
            let description = &shown.description;
            if !options.only.is_empty() && !options.only.contains(&description.name) {
                continue;
            }
            let mut spec = shown.at(0.0);
            for level in 0..5 {
                let ms = time_at(&registry, &mut spec, level, &source);
                let anew = (!description.drawn_per_sequence.is_empty()).then(|| {
                    spec.draws = Some(Draws::PerFrame);
                    let ms = time_at(&registry, &mut spec, level, &source);
                    spec.draws = None;
                    ms
                });
                let remark = anew.map_or_else(String::new, |time| format!("{time:>8.3} ms drawn anew"));
                println!("{:<28} {size:>9} level {level} {ms:>8.3} ms {remark}", description.name);
                cells.push(json!({
                    "perturbation": description.name, "size": size, "level": level, "ms": ms, "drawn_anew_ms": anew,
                }));
            }
        }
    }
    let wants_loop = options.only.is_empty() || options.only.iter().any(|only| only == "loop");
    let closed_loop = if wants_loop { closed_loop(&registry) } else { Vec::new() };
    if let Some(file) = &options.json {
        let figures = json!({ "copy_ms": copies, "cells": cells, "loop": closed_loop });
        std::fs::write(file, serde_json::to_vec_pretty(&figures).unwrap()).unwrap();
    }
}

/// What a frame of the closed loop takes, on frames of 320x160: the simulator alone, and all of it on one thread, by the clock.
fn closed_loop(registry: &Registry) -> Vec<Value> {
    let mut rows = Vec::new();
    for conditions in ["easy", "standard", "hard"] {
        let given = Map::from_iter([("conditions".to_owned(), Value::from(conditions))]);
        let (mut simulator, _) = registry.simulator("lane", &given).unwrap();
        simulator.reset(&scenario(), 0).unwrap();
        let mut frame = FrameBuf::new(320, 160);
        let alone = median(&mut |_| {
            simulator.frame(frame.as_mut()).unwrap();
            simulator.act(Control { steering: 0.0, throttle: 0.0 }).unwrap();
        });
        rows.push(json!({
            "what": format!("the embedded simulator alone, conditions {conditions}, 320x160"),
            "ms": alone, "frames_per_second": 1e3 / alone,
        }));
    }
    let folder = pdk_tests::temp();
    for engine in ["pdk", "onnxruntime"] {
        let record = folder.path().join(engine);
        let run = Pdk::new(["run", "--out"])
            .arg(&record)
            .arg(pdk_tests::repository().join("scripts/manual.lua"))
            .set("driver", format!(r#"{{"name":"dave2","engine":"{engine}"}}"#))
            .set("chains", "gaussian_noise@2")
            .set("roads", 2)
            .set("images_every", 0)
            .set("workers", 1)
            .run();
        if engine == "onnxruntime" && run.code != Some(0) {
            println!("the loop is measured without ONNX Runtime: {}", run.stderr.trim());
            continue;
        }
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let drive = &json_file(&record.join("performance.json"))["drive"];
        let [frames, real_time] =
            ["frames_per_second", "real_time_factor"].map(|name| drive[name].as_f64().unwrap());
        rows.push(json!({
            "what": format!("simulator, gaussian_noise or none, `dave2` with {engine}, record, 320x160"),
            "ms": 1e3 / frames, "frames_per_second": frames, "real_time_factor": real_time,
        }));
    }
    for row in &rows {
        println!("{}: {:.2} ms", row["what"].as_str().unwrap(), row["ms"].as_f64().unwrap());
    }
    rows
}

/// The scenario that is rendered.
fn scenario() -> Scenario {
    let [simulator, driver] = ["lane", "dave2"].map(ComponentSpec::new);
    Scenario { seed: 1, ..Scenario::new(simulator, driver) }
}

/// A frame of the embedded simulator.
fn rendered(registry: &Registry, width: usize, height: usize) -> FrameBuf {
    let size =
        [("width", width), ("height", height)].map(|(name, size)| (name.to_owned(), Value::from(size)));
    let (mut simulator, _) = registry.simulator("lane", &Map::from_iter(size)).unwrap();
    simulator.reset(&scenario(), 0).unwrap();
    let mut frame = FrameBuf::new(width, height);
    for _ in 0..30 {
        simulator.frame(frame.as_mut()).unwrap();
        simulator.act(Control { steering: 0.0, throttle: 0.2 }).unwrap();
    }
    frame
}

/// Milliseconds a frame at a level.
fn time_at(registry: &Registry, spec: &mut AppliedPerturbation, level: u32, source: &FrameBuf) -> f64 {
    let mut target = FrameBuf::new(source.width(), source.height());
    spec.level = Level::Constant(f64::from(level));
    let mut chain = Chain::new(registry, std::slice::from_ref(spec), 0).unwrap();
    median(&mut |call| {
        chain.apply(source.as_ref(), target.as_mut(), &Moment::new(call, call as f64 / RATE)).unwrap()
    })
}

/// The median processor time of a call in milliseconds, after a few calls that fill caches.
fn median(work: &mut dyn FnMut(u64)) -> f64 {
    const WARM_UP: u64 = 3;
    const BUDGET: f64 = 0.06;
    (0..WARM_UP).for_each(&mut *work);
    let started = thread_time();
    let mut times = Vec::new();
    while times.len() < 7 || (thread_time() - started < BUDGET && times.len() < 2_000) {
        let call = thread_time();
        work(WARM_UP + times.len() as u64);
        times.push(thread_time() - call);
    }
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2] * 1e3
}

/// Seconds of processor time that this thread has had.
fn thread_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
