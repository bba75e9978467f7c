//! Drives that fail for a cause that is known: the driver `planted` leaves the road once it has seen a box black in some frames, and the
//! perturbation `blackout` makes all frames black.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::process::pipeline;
use crate::random::Random;
use crate::{Pdk, test_library};

/// Pixels of the camera.
const WIDTH: u32 = 160;
/// See [`WIDTH`].
const HEIGHT: u32 = 120;

/// Causes lie in the first frames of drives that take about a hundred if they do not fail: in this many.
const FRAMES: u32 = 60;

/// The part of a drive that has to be black.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cause {
    /// The frames.
    pub frames: Range<u32>,
    /// The columns of pixels.
    pub columns: Range<u32>,
    /// The rows of pixels.
    pub rows: Range<u32>,
}

impl Cause {
    /// Causes of 1 to 20 frames, drawn at random. The sides of their boxes are between these shares of the width and of the height.
    pub fn drawn(count: usize, seed: u64, [least, most]: [f64; 2]) -> Vec<Self> {
        let mut random = Random::new(seed);
        let mut range = |least: u32, most: u32, all: u32| {
            let length = least + random.below((most - least) as usize + 1) as u32;
            let start = random.below((all - length) as usize + 1) as u32;
            start..start + length
        };
        let share = |share: f64, all: u32| (share * f64::from(all)) as u32;
        let mut cause = || Self {
            frames: range(1, 20, FRAMES),
            columns: range(share(least, WIDTH), share(most, WIDTH), WIDTH),
            rows: range(share(least, HEIGHT), share(most, HEIGHT), HEIGHT),
        };
        (0..count).map(|_| cause()).collect()
    }

    /// A part that `pdk why --json` has found.
    pub fn found(part: &Value) -> Self {
        let frame = |place: usize| part["frames"][place].as_u64().unwrap() as u32;
        let side = |place: usize, pixels: u32| match &part["box"] {
            Value::Null => [0, 0, pixels, pixels][place],
            // The pixels whose centres lie in it.
            sides => (sides[place].as_f64().unwrap() * f64::from(pixels) - 0.5).ceil() as u32,
        };
        Self {
            frames: frame(0)..frame(1) + 1,
            columns: side(0, WIDTH)..side(2, WIDTH),
            rows: side(1, HEIGHT)..side(3, HEIGHT),
        }
    }

    /// Pixels in all frames.
    fn size(&self) -> f64 {
        [&self.frames, &self.columns, &self.rows].iter().map(|range| range.len() as f64).product()
    }

    /// What lies in both.
    fn both(&self, other: &Self) -> Self {
        let both = |a: &Range<u32>, b: &Range<u32>| {
            let start = a.start.max(b.start);
            start..a.end.min(b.end).max(start)
        };
        Self {
            frames: both(&self.frames, &other.frames),
            columns: both(&self.columns, &other.columns),
            rows: both(&self.rows, &other.rows),
        }
    }

    /// Intersection over union.
    pub fn overlap(&self, other: &Self) -> f64 {
        let both = self.both(other).size();
        both / (self.size() + other.size() - both)
    }

    /// Whether it is one cell of the grid of `pdk why` in one frame.
    pub fn is_a_cell(&self) -> bool {
        let cell = |pixels: u32| pixels.div_ceil(64) as usize;
        self.frames.len() == 1 && self.columns.len() <= cell(WIDTH) && self.rows.len() <= cell(HEIGHT)
    }

    /// Whether they have a pixel in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.both(other).size() > 0.0
    }
}

/// Drives that fail for these causes, and returns the record.
pub fn record(folder: &Path, causes: &[Cause]) -> PathBuf {
    let mut scenarios = String::new();
    for Cause { frames, columns, rows } in causes {
        writeln!(
            scenarios,
            "{{ road = {{ angles = {{ 0, 0, 0, 0, 0, 0, 0, 0 }}, segment = 10 }}, perturbations = {{ {{ name = 'blackout' }} }}, driver = {{ name = 'planted', first = {}, last = {}, left = {}, top = {}, right = {}, bottom = {} }} }},",
            frames.start,
            frames.end - 1,
            columns.start,
            rows.start,
            columns.end,
            rows.end
        )
        .unwrap();
    }
    let source = format!(
        "pdk.drive({{ simulator = {{ name = 'lane', width = {WIDTH}, height = {HEIGHT}, rate = 10 }}, driver = 'planted', duration = 20, \
         images_every = 0, scenarios = {{ {scenarios} }} }})"
    );
    let out = folder.join("record");
    Pdk::new(["run", "--plugins"])
        .arg(test_library("planted"))
        .arg("--out")
        .arg(&out)
        .arg(pipeline(folder, &source))
        .succeed();
    out
}

/// What `pdk why --json` prints about one of the drives.
pub fn why(record: &Path, folder: &Path, scenario: usize) -> Value {
    Pdk::new(["why", "--json", "--plugins"])
        .arg(test_library("planted"))
        .arg(record)
        .args(["--scenario", &scenario.to_string(), "--out"])
        .arg(folder.join("why"))
        .succeed()
        .json()
}
