//! The level of every frame.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Most levels of a course: those of a day at 100 frames a second, and some.
pub const MOST_FRAMES: usize = 10_000_000;

/// The level of every frame: what a function of time was for each of them. Written as `{"rate": 20, "levels": [0, [2.5, 10]]}`,
/// in which `[level, count]` stands for a level that several frames after each other have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameLevels {
    /// Frames a second.
    pub rate: f64,
    /// The level of each frame, from the start of the scenario; after the end the last one holds.
    #[serde(serialize_with = "write_runs", deserialize_with = "read_runs")]
    pub levels: Vec<f64>,
}

impl FrameLevels {
    /// The level of the frame at a time in seconds; none where there are no levels.
    pub fn at(&self, time: f64) -> Option<f64> {
        // A time before the start becomes 0, one far behind the end the largest number.
        let frame = (time * self.rate).round() as usize;
        self.levels.get(frame).or(self.levels.last()).copied()
    }
}

/// A level of one frame, or of several after each other.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Run {
    One(f64),
    Several(f64, u64),
}

fn write_runs<S: Serializer>(levels: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(levels.chunk_by(|a, b| a == b).map(|run| match run {
        [level] => Run::One(*level),
        _ => Run::Several(run[0], run.len() as u64),
    }))
}

fn read_runs<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let mut levels = Vec::new();
    for run in Vec::<Run>::deserialize(deserializer)? {
        let (level, count) = match run {
            Run::One(level) => (level, 1),
            Run::Several(level, count) => (level, count),
        };
        // Before memory is taken for what a single number asks for.
        let room = MOST_FRAMES - levels.len();
        match usize::try_from(count) {
            Ok(count) if count <= room => levels.resize(levels.len() + count, level),
            _ => return Err(D::Error::custom(format!("there are more than {MOST_FRAMES} levels"))),
        }
    }
    Ok(levels)
}
