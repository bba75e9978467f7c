//! How fast every perturbation and the loop are. Prints the tables; with `--write` puts them into the documents:
//!
//! ```sh
//! cargo build --release && cargo bench -p pdk-tests --bench speed -- --write
//! ```
//!
//! Everything is measured in one run on one thread, with a copy of a frame as the yardstick. Perturbations are loaded from
//! their plugins, as they are in use. Each figure is the median over repeated calls at the slowest of the five levels.
//! Perturbations that draw where things sit once per sequence keep what they drew, which the published tool does not; they
//! are measured with `draws=per_frame` as well, and compared with that too.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::fmt::Write;
use std::time::{Duration, Instant};

use pdk_core::chain::Chain;
use pdk_core::registry::Registry;
use pdk_core::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_model::component::ComponentSpec;
use pdk_model::level::Level;
use pdk_model::perturbation::{AppliedPerturbation, Draws};
use pdk_preview::preview;
use pdk_sdk::prelude::{Control, FrameBuf, Scenario};
use pdk_tests::Pdk;
use pdk_tests::process::json_file;
use serde_json::{Map, Value};

/// Milliseconds a frame of the published tool (PerturbationDrive 1.0), one thread, 320x240, slowest level, on a machine
/// with two cores. Another machine than this one: what counts is the order of magnitude. Overlays took 1.4 to 2.6 (static)
/// and 1.3 to 1.7 (dynamic); the smallest is taken for each.
const PUBLISHED: &[(&str, f64)] = &[
    ("fog_mapping", 296.0),
    ("zoom_blur", 125.0),
    ("phase_scrambling", 22.0),
    ("poisson_noise", 15.0),
    ("frost_filter", 12.8),
    ("snow_filter", 7.7),
    ("object_overlay", 7.3),
    ("splatter_mapping", 6.6),
    ("high_pass_filter", 6.2),
    ("speckle_noise_filter", 5.6),
    ("gaussian_noise", 5.3),
    ("fog_filter", 5.0),
    ("elastic", 4.1),
    ("defocus_blur", 3.9),
    ("glass_blur", 3.0),
    ("static_rain_filter", 1.4),
    ("static_snow_filter", 1.4),
    ("static_sun_filter", 1.4),
    ("static_lightning_filter", 1.4),
    ("static_object_overlay", 1.4),
    ("static_smoke_filter", 1.4),
    ("dynamic_rain_filter", 1.3),
    ("dynamic_snow_filter", 1.3),
    ("dynamic_sun_filter", 1.3),
    ("dynamic_lightning_filter", 1.3),
    ("dynamic_object_overlay", 1.3),
    ("dynamic_smoke_filter", 1.3),
    ("gaussian_blur", 2.3),
    ("motion_blur", 2.1),
    ("low_pass_filter", 1.7),
    ("jpeg_filter", 1.4),
    ("contrast", 1.3),
    ("white_balance_filter", 1.1),
    ("canny_edges_mapping", 0.88),
    ("zigzag_mapping", 0.86),
    ("posterize_filter", 0.63),
    ("dotted_lines_mapping", 0.60),
    ("saturation_filter", 0.5),
    ("saturation_decrease_filter", 0.5),
    ("histogram_equalisation", 0.51),
    ("impulse_noise", 0.50),
    ("increase_brightness", 0.38),
    ("shear_image", 0.35),
    ("rotate_image", 0.35),
    ("translate_image", 0.34),
    ("sharpen_filter", 0.24),
    ("pixelate", 0.21),
    ("false_color_filter", 0.19),
    ("reflection_filter", 0.17),
    ("sample_pairing_filter", 0.14),
    ("scale_image", 0.12),
    ("grayscale_filter", 0.08),
    ("cutout_filter", 0.07),
];

/// A simulator's frame rate: a perturbation sees one frame after the other.
const RATE: f64 = 30.0;

struct Row {
    name: String,
    /// Milliseconds at 320x240 and at 1280x720.
    small: f64,
    large: f64,
    /// Milliseconds at 320x240 with everything drawn anew for every frame, for those that draw once per sequence.
    anew: Option<f64>,
    published: Option<f64>,
}

impl Row {
    /// Milliseconds at 320x240 without anything that was drawn for an earlier frame.
    fn uncached(&self) -> f64 {
        self.anew.unwrap_or(self.small)
    }
}

fn main() {
    let registry = Registry::discover(&SearchPath::default(), Box::new(LuaScripts::default())).unwrap();
    let (small, large) = (rendered(&registry, 320, 240), rendered(&registry, 1280, 720));
    let copy = [&small, &large].map(|frame| {
        let mut target = FrameBuf::new(frame.width(), frame.height());
        median(&mut |_| target.as_mut().copy_from(frame.as_ref()))
    });
    let rows: Vec<Row> = preview::chosen(registry.catalog(), &[], true)
        .unwrap()
        .iter()
        .map(|shown| {
            let description = &shown.description;
            let name = description.name.clone();
            let published = PUBLISHED.iter().find(|(known, _)| *known == name).map(|(_, time)| *time);
            let mut spec = shown.at(0.0);
            let [small_time, large_time] =
                [&small, &large].map(|source| slowest(&registry, spec.clone(), source));
            spec.draws = Some(Draws::PerFrame);
            let anew = (!description.drawn_per_sequence.is_empty()).then(|| slowest(&registry, spec, &small));
            let remark = anew.map_or_else(String::new, |time| format!("{time:>8.3} ms drawn anew"));
            println!("{name:<28} {small_time:>8.3} ms {large_time:>8.3} ms {remark}");
            Row { name, small: small_time, large: large_time, anew, published }
        })
        .collect();
    let (mut summary, table) = report(&rows, copy);
    summary += &closed_loop(&registry);
    println!("\n{summary}");
    // Cargo itself passes `--bench`.
    if std::env::args().any(|argument| argument == "--write") {
        let root = pdk_tests::repository();
        let page = format!(
            "# Speed\n\n*Written by `cargo bench -p pdk-tests --bench speed -- --write`; changes here are lost.*\n\n{summary}\n{table}"
        );
        std::fs::create_dir_all(root.join("docs")).unwrap();
        std::fs::write(root.join("docs/speed.md"), page).unwrap();
        replace_between_marks(&root.join("README.md"), &summary);
    }
}

/// What a frame of the closed loop takes, on frames of 320x160: the simulator alone, and all of it on one thread.
fn closed_loop(registry: &Registry) -> String {
    let (mut simulator, _) = registry.simulator("lane", &Map::new()).unwrap();
    simulator.reset(&scenario(), 0).unwrap();
    let mut frame = FrameBuf::new(320, 160);
    let alone = median(&mut |_| {
        simulator.frame(frame.as_mut()).unwrap();
        simulator.act(Control { steering: 0.0, throttle: 0.0 }).unwrap();
    });
    let mut text = format!(
        "| the embedded simulator alone, 320x160 | {alone:.2}: {:.0} frames a second |\n",
        1e3 / alone
    );
    let folder = pdk_tests::temp();
    for backend in ["tract", "onnxruntime"] {
        let record = folder.path().join(backend);
        let run = Pdk::new(["run", "--out"])
            .arg(&record)
            .arg(pdk_tests::repository().join("scripts/manual.lua"))
            .set("driver", format!(r#"{{"name":"dave2","backend":"{backend}"}}"#))
            .set("chains", "gaussian_noise@2")
            .set("roads", 2)
            .set("images_every", 0)
            .set("workers", 1)
            .run();
        if backend == "onnxruntime" && run.code != Some(0) {
            println!("the loop is measured without ONNX Runtime: {}", run.stderr.trim());
            continue;
        }
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let drive = &json_file(&record.join("performance.json"))["drive"];
        let [frames, real_time] =
            ["frames_per_second", "real_time_factor"].map(|name| drive[name].as_f64().unwrap());
        writeln!(
            text,
            "| simulator, gaussian_noise or none, `dave2` with {backend}, record, 320x160 | {:.2}: {frames:.0} frames a second, \
             {real_time:.0} times real time |",
            1e3 / frames
        )
        .unwrap();
    }
    print!("{text}");
    text
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

/// Milliseconds a frame at the slowest level.
fn slowest(registry: &Registry, mut spec: AppliedPerturbation, source: &FrameBuf) -> f64 {
    let mut target = FrameBuf::new(source.width(), source.height());
    let time_at = |level: u32| {
        spec.level = Level::Constant(f64::from(level));
        let mut chain = Chain::new(registry, std::slice::from_ref(&spec), 0).unwrap();
        median(&mut |call| chain.apply(source.as_ref(), target.as_mut(), call, call as f64 / RATE).unwrap())
    };
    (0..5).map(time_at).fold(0.0, f64::max)
}

/// The median time of a call in milliseconds, after a few calls that fill caches.
fn median(work: &mut dyn FnMut(u64)) -> f64 {
    const WARM_UP: u64 = 3;
    const BUDGET: Duration = Duration::from_millis(60);
    (0..WARM_UP).for_each(&mut *work);
    let started = Instant::now();
    let mut times = Vec::new();
    while times.len() < 7 || (started.elapsed() < BUDGET && times.len() < 2_000) {
        let call = Instant::now();
        work(WARM_UP + times.len() as u64);
        times.push(call.elapsed());
    }
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e3
}

/// Perturbations against the published tool: what they take together, and how many times faster they are.
struct Comparison {
    ours: f64,
    theirs: f64,
    /// The geometric mean.
    faster: f64,
    slower: String,
}

/// Compares pairs of our time and the published one, with the perturbation's name.
fn compare<'a>(pairs: impl Iterator<Item = (&'a str, f64, f64)>) -> Comparison {
    let pairs: Vec<_> = pairs.collect();
    let logarithms: f64 = pairs.iter().map(|(_, ours, theirs)| (theirs / ours).ln()).sum();
    let slower: Vec<_> =
        pairs.iter().filter(|(_, ours, theirs)| ours > theirs).map(|(name, ..)| *name).collect();
    Comparison {
        ours: pairs.iter().map(|(_, ours, _)| ours).sum(),
        theirs: pairs.iter().map(|(_, _, theirs)| theirs).sum(),
        faster: (logarithms / pairs.len() as f64).exp(),
        slower: if slower.is_empty() { "none".to_owned() } else { slower.join(", ") },
    }
}

/// What stands in the README, and the whole table.
fn report(rows: &[Row], copy: [f64; 2]) -> (String, String) {
    let compared: Vec<(&Row, f64)> = rows.iter().filter_map(|row| Some((row, row.published?))).collect();
    let drawing: Vec<&Row> = compared.iter().map(|(row, _)| *row).filter(|row| row.anew.is_some()).collect();
    let as_used = compare(compared.iter().map(|(row, theirs)| (row.name.as_str(), row.small, *theirs)));
    let uncached = compare(compared.iter().map(|(row, theirs)| (row.name.as_str(), row.uncached(), *theirs)));
    let others = compared.iter().filter(|(row, _)| row.anew.is_none());
    let others = compare(others.map(|(row, theirs)| (row.name.as_str(), row.small, *theirs)));
    let largest = |value: fn(&Row) -> f64| rows.iter().max_by(|a, b| value(a).total_cmp(&value(b))).unwrap();
    let (slowest_small, slowest_large) = (largest(|row| row.small), largest(|row| row.large));

    let mut summary =
        String::from("| one thread, slowest level of each | milliseconds a frame |\n| --- | --- |\n");
    let mut line = |what: &str, value: String| writeln!(summary, "| {what} | {value} |").unwrap();
    let (all, few) = (compared.len(), drawing.len());
    for (what, Comparison { ours, theirs, faster, slower }) in [
        (format!("the {all} published perturbations together, 320x240"), as_used),
        (format!("the same, and the {few} that draw once per sequence draw anew for every frame"), uncached),
        (format!("without those {few}"), others),
    ] {
        let slower = if slower == "none" { "none slower".to_owned() } else { format!("slower: {slower}") };
        line(
            &what,
            format!(
                "{ours:.1} (the published tool: {theirs:.0}); geometric mean {faster:.1} times faster, {slower}"
            ),
        );
    }
    line(
        &format!("slowest of all {}, 320x240", rows.len()),
        format!("{:.2} ({})", slowest_small.small, slowest_small.name),
    );
    line(
        &format!("slowest of all {}, 1280x720", rows.len()),
        format!("{:.1} ({})", slowest_large.large, slowest_large.name),
    );
    line("a copy of the frame, 320x240 and 1280x720", format!("{:.4} and {:.3}", copy[0], copy[1]));

    let mut table = format!(
        "\nThe published times were taken on another machine with two cores. All times are of frames after the first few: \
         textures and clips are prepared once and kept.\n\n\
         {} of the published perturbations draw where things sit once per sequence and keep what they drew, where the \
         published tool draws for every frame: {}. The last two columns say what they take where everything is drawn anew \
         for every frame (`draws=per_frame`), and how many times faster than the published tool that is.\n\n\
         | perturbation | 320x240 ms | 1280x720 ms | published 320x240 ms | times faster | drawn anew, 320x240 ms | times faster |\n\
         |---|---:|---:|---:|---:|---:|---:|\n",
        few,
        drawing.iter().map(|row| row.name.as_str()).collect::<Vec<_>>().join(", "),
    );
    for row in rows {
        let ratio =
            |time: f64| row.published.map_or_else(String::new, |theirs| format!("{:.1}", theirs / time));
        let published = row.published.map_or_else(String::new, |time| time.to_string());
        let (anew, anew_ratio) =
            row.anew.map_or_else(Default::default, |time| (format!("{time:.3}"), ratio(time)));
        writeln!(
            table,
            "| {} | {:.3} | {:.2} | {published} | {} | {anew} | {anew_ratio} |",
            row.name,
            row.small,
            row.large,
            ratio(row.small)
        )
        .unwrap();
    }
    (summary, table)
}

/// Puts a text between `<!-- speed -->` and `<!-- end of speed -->`.
fn replace_between_marks(file: &std::path::Path, text: &str) {
    const MARKS: [&str; 2] = ["<!-- speed -->\n", "<!-- end of speed -->"];
    let before = std::fs::read_to_string(file).unwrap();
    let [start, end] =
        MARKS.map(|mark| before.find(mark).unwrap_or_else(|| panic!("{}: no {mark}", file.display())));
    let after = format!("{}{}\n{text}\n{}", &before[..start], MARKS[0], &before[end..]);
    std::fs::write(file, after.replace(&format!("{}\n", MARKS[0]), MARKS[0])).unwrap();
}
