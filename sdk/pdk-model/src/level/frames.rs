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
    /// The level of the frame at a time in seconds; none if there are no levels.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn a_time_has_the_level_of_its_frame() {
        let frames = FrameLevels { rate: 20.0, levels: vec![0.0, 1.0, 2.0, 3.0] };
        for (time, level) in
            [(-1.0, 0.0), (0.0, 0.0), (0.05, 1.0), (0.1, 2.0), (0.151, 3.0), (9.0, 3.0), (1e300, 3.0)]
        {
            assert_eq!(frames.at(time), Some(level), "{time}");
        }
        assert_eq!(FrameLevels { rate: 20.0, levels: Vec::new() }.at(0.0), None);
        // Times are quotients, which need not be exact.
        let frames = FrameLevels { rate: 30.0, levels: (0..2000).map(f64::from).collect() };
        for frame in 0..2000 {
            assert_eq!(frames.at(f64::from(frame) / 30.0), Some(f64::from(frame)));
        }
    }

    #[test]
    fn runs_of_equal_levels_are_short() {
        let levels = [vec![0.0; 600], vec![2.5], vec![4.0; 2]].concat();
        let frames = FrameLevels { rate: 20.0, levels };
        let written = serde_json::to_value(&frames).unwrap();
        assert_eq!(written, json!({"rate": 20.0, "levels": [[0.0, 600], 2.5, [4.0, 2]]}));
    }

    #[test]
    fn a_count_cannot_take_all_memory() {
        for levels in [json!([[1, u64::MAX]]), json!([[1, 9_999_999], [2, 2]])] {
            let error = serde_json::from_value::<FrameLevels>(json!({"rate": 1, "levels": levels}));
            assert!(error.unwrap_err().to_string().contains("more than 10000000 levels"));
        }
    }

    proptest! {
        #[test]
        fn levels_are_read_back_as_they_were(
            rate in 0.1..1000.0,
            runs in prop::collection::vec((0.0..=4.0, 1usize..5), 0..20),
        ) {
            let levels: Vec<f64> = runs.iter().flat_map(|(level, count)| vec![*level; *count]).collect();
            let frames = FrameLevels { rate, levels };
            let text = serde_json::to_string(&frames).unwrap();
            prop_assert_eq!(serde_json::from_str::<FrameLevels>(&text).unwrap(), frames);
        }
    }
}
