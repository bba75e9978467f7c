//! Blocks of recordings, from which a suite draws instead of roads.
//!
//! Frames resemble their neighbours, so a frame is not an observation. A block is: frames that follow each other, which both drivers see
//! under the same perturbation with the same luck. A block is a scenario like any other. The reader of the recording takes the place of
//! the simulator, and the stretch of the recording that of the road.

use std::collections::BTreeMap;

use pdk_components::catalog::Catalog;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::Scenario;
use pdk_pipeline::readers;
use pdk_sdk::describe::{Kind, ParameterType};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed::Random;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::stretch::{Recording, Stretch};
use crate::suite::Suite;

/// A block that can be drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Its place among all blocks. The one behind it has the next number, unless it is the last one of its sequence.
    pub place: usize,
    /// The reader of its recording.
    pub reader: ComponentSpec,
    /// Its frames.
    pub stretch: Stretch,
}

/// A recording that a verdict is about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingRecord {
    /// Its reader.
    pub reader: ComponentSpec,
    /// The hash of its contents.
    pub blake3: String,
}

/// The recordings of a suite, opened, and their blocks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Opened {
    /// The recordings, each once.
    pub recordings: Vec<RecordingRecord>,
    /// The blocks of those from which is drawn.
    pub blocks: Vec<Block>,
    /// In which order they are looked at.
    order: Vec<usize>,
    /// The contents of recordings by the paths that name them in their readers.
    contents: BTreeMap<String, String>,
}

/// Opens a recording.
pub type Open<'a> = dyn FnMut(&Value) -> Result<readers::Recording> + 'a;

impl Opened {
    /// Opens the recordings of a suite. `random` draws the order of their blocks.
    ///
    /// # Errors
    /// If a recording cannot be opened, is too short for a block, or does not have the frames of a fixed scenario.
    pub fn of(suite: &Suite, catalog: &Catalog, random: &mut Random, open: &mut Open<'_>) -> Result<Self> {
        let mut opened = Self::default();
        for recording in &suite.recordings {
            let found = open(&recording.dataset)?;
            opened.note(catalog, &found);
            let made = &found.made;
            let frames = made.frames.unwrap_or_default().min(recording.frames.unwrap_or(usize::MAX));
            let before = opened.blocks.len();
            opened.cut(recording, &found.reader, &made.sequences, frames);
            if opened.blocks.len() == before {
                return Err(Error::new(format!(
                    "the recording {} has {frames} frames, and no sequence of them is as long as a block of {}; set a smaller `block`",
                    recording.dataset, recording.block
                )));
            }
        }
        for number in 0..suite.scenarios.len() {
            let scenario = suite.fixed(number)?;
            let Some(stretch) = Stretch::of(&scenario) else { continue };
            let found = open(&serde_json::to_value(&scenario.simulator)?)?;
            opened.note(catalog, &found);
            if let Some(mistake) = stretch.mistake(found.made.frames.unwrap_or_default()) {
                return Err(Error::new(format!("[[scenario]] {}: {mistake}; name other frames", number + 1)));
            }
        }
        opened.order = (0..opened.blocks.len()).collect();
        random.shuffle(&mut opened.order);
        Ok(opened)
    }

    fn note(&mut self, catalog: &Catalog, found: &readers::Recording) {
        let readers::Recording { reader, content, .. } = found;
        let record = RecordingRecord { reader: reader.clone(), blake3: content.clone() };
        if !self.recordings.contains(&record) {
            self.recordings.push(record);
        }
        if let Some(path) = path_of(catalog, reader) {
            self.contents.insert(path, content.clone());
        }
    }

    /// Cuts the sequences of a recording into blocks. What is left at the end of a sequence is not used.
    fn cut(&mut self, recording: &Recording, reader: &ComponentSpec, sequences: &[usize], frames: usize) {
        let Recording { block, warm_up, steering_error, .. } = *recording;
        let mut starts: Vec<usize> = sequences.iter().copied().filter(|start| *start < frames).collect();
        if starts.first() != Some(&0) {
            starts.insert(0, 0);
        }
        let ends = starts.iter().skip(1).copied().chain([frames]);
        for (sequence, end) in starts.iter().copied().zip(ends) {
            // The last block of a sequence and the first of the next are not neighbours.
            let mut place = self.blocks.last().map_or(0, |last| last.place + 2);
            let mut start = sequence;
            while start + block <= end {
                let from = start.saturating_sub(warm_up).max(sequence);
                let stretch = Stretch { sequence, from, start, end: start + block, steering_error };
                self.blocks.push(Block { place, reader: reader.clone(), stretch });
                (place, start) = (place + 1, start + block);
            }
        }
    }

    /// The block that is looked at in this place.
    pub fn drawn(&self, number: usize) -> Option<&Block> {
        self.blocks.get(*self.order.get(number)?)
    }

    /// The block in this place of an order of its own, which `random` draws.
    pub fn drawn_apart(&self, number: usize, random: &mut Random) -> Option<&Block> {
        let mut order: Vec<usize> = (0..self.blocks.len()).collect();
        random.shuffle(&mut order);
        self.blocks.get(*order.get(number)?)
    }

    /// Puts the content of its recording into a scenario that was settled, so that its id follows from it.
    pub fn note_content(&self, scenario: &mut Scenario) {
        let named = scenario.simulator.parameters.values().filter_map(Value::as_str);
        let known: Vec<(String, String)> =
            named.filter_map(|path| Some((path.to_owned(), self.contents.get(path)?.clone()))).collect();
        scenario.files.extend(known);
    }
}

/// The path that names a recording in its reader.
fn path_of(catalog: &Catalog, reader: &ComponentSpec) -> Option<String> {
    let entry = catalog.get(Kind::Dataset, &reader.name).ok()?;
    let is_path = |kind: ParameterType| kind == ParameterType::Path;
    let mut paths = entry.description.parameters.iter().filter(|parameter| is_path(parameter.kind.clone()));
    paths.find_map(|parameter| Some(reader.parameters.get(&parameter.name)?.as_str()?.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{RECORDED, open_recorded, suite};
    use pdk_sdk::seed::Key;

    fn opened(text: &str, frames: usize, sequences: &[usize]) -> Result<Opened> {
        let mut open = open_recorded(frames, sequences);
        Opened::of(&suite(text)?.suite, &Catalog::default(), &mut Key([1; 32]).sequence(), &mut open)
    }

    #[test]
    fn sequences_are_cut_into_blocks_and_only_those_that_follow_each_other_are_neighbours() {
        let found = opened(RECORDED, 125, &[0, 45, 52]).unwrap();
        let cut: Vec<_> = found
            .blocks
            .iter()
            .map(|block| (block.place, block.stretch.from, block.stretch.start, block.stretch.end))
            .collect();
        // Of 45, 7 and 73 frames; a block has 20, and five before it are seen as well.
        assert_eq!(cut, [(0, 0, 0, 20), (1, 15, 20, 40), (3, 52, 52, 72), (4, 67, 72, 92), (5, 87, 92, 112)]);
        let looked: Vec<usize> = (0..5).map(|number| found.drawn(number).unwrap().place).collect();
        let mut sorted = looked.clone();
        sorted.sort_unstable();
        assert!(sorted == [0, 1, 3, 4, 5] && found.drawn(5).is_none());
        let few =
            opened(&RECORDED.replace("block = 20", "block = 20\nframes = 45"), 125, &[0, 45, 52]).unwrap();
        assert_eq!(few.blocks.len(), 2);
        let error = opened(RECORDED, 19, &[0]).unwrap_err().to_string();
        assert!(error.contains("has 19 frames") && error.contains("set a smaller `block`"), "{error}");
    }

    #[test]
    fn the_id_of_a_block_follows_from_what_is_in_the_recording() {
        let found = opened(RECORDED, 125, &[0]).unwrap();
        let mut scenario = Scenario::new(found.blocks[0].reader.clone(), ComponentSpec::new("x"));
        scenario.road = serde_json::to_value(found.blocks[0].stretch).unwrap();
        assert_eq!(Stretch::of(&scenario), Some(found.blocks[0].stretch));
        assert_eq!(Stretch::of(&Scenario::default()), None);
        let mut elsewhere = found.clone();
        elsewhere.contents = BTreeMap::from([("tracks/one".to_owned(), "00".to_owned())]);
        let id = |opened: &Opened| {
            let mut scenario = scenario.clone();
            opened.note_content(&mut scenario);
            scenario.id()
        };
        // A catalog without the reader does not say which of its parameters is the path.
        assert_eq!(id(&found), scenario.id());
        let one = id(&elsewhere);
        elsewhere.contents.insert("tracks/one".to_owned(), "01".to_owned());
        assert!(one != id(&elsewhere) && one != scenario.id());
    }

    #[test]
    fn a_fixed_block_has_to_be_there() {
        let fixed = r#"
            name = "again"
            version = 1
            [[scenario]]
            simulator = { name = "tape", path = "tracks/one" }
            road = { sequence = 0, from = 0, start = 10, end = 30, steering_error = 0.2 }
            duration = 30
            seed = 3
        "#;
        assert_eq!(opened(fixed, 30, &[0]).unwrap().recordings.len(), 1);
        let error = opened(fixed, 29, &[0]).unwrap_err().to_string();
        assert!(
            error.contains("[[scenario]] 1: frames 10 to 30") && error.contains("its 29 frames"),
            "{error}"
        );
    }
}
