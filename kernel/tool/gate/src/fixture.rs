//! Suites for tests.

use pdk_loop::protocol::Made;
use pdk_model::component::ComponentSpec;
use pdk_pipeline::program::Text;
use pdk_pipeline::readers::Recording;
use pdk_sdk::error::Result;
use serde_json::Value;

use crate::loaded::Loaded;

/// A suite in a text.
pub fn suite(source: &str) -> Result<Loaded> {
    Loaded::new(Text { path: "a.toml".into(), source: source.to_owned(), folder: None })
}

/// One that is right.
pub const SMALL: &str = r#"
    name = "small"
    version = 1
    perturbations = ["fog", "rain@3"]
    levels = [1, 2]
    nominal = 0.25
    [test]
    tolerated = 0.2
    pairs = 50
    [[place]]
    simulator = { name = "flat", light = "dusk" }
    road = { segments = 4, limit = 20 }
    duration = 12
"#;

/// One whose scenarios are blocks of a recording.
pub const RECORDED: &str = r#"
    name = "recorded"
    version = 1
    perturbations = ["fog", "rain@3"]
    levels = [1, 2]
    [[recording]]
    dataset = "tracks/one"
    block = 20
    warm_up = 5
"#;

/// Opens recordings of this many frames, of which these begin a sequence.
pub fn open_recorded(frames: usize, sequences: &[usize]) -> impl FnMut(&Value) -> Result<Recording> {
    let made = Made { frames: Some(frames), sequences: sequences.to_vec(), ..Made::default() };
    move |dataset: &Value| {
        let reader = match dataset {
            Value::String(path) => {
                let mut reader = ComponentSpec::new("tape");
                reader.parameters.insert("path".to_owned(), path.as_str().into());
                reader
            }
            reader => ComponentSpec::from_json("dataset", reader)?,
        };
        Ok(Recording { reader, made: made.clone(), content: "00".to_owned() })
    }
}
