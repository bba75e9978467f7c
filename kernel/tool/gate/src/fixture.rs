//! Suites for tests.

use pdk_pipeline::program::Text;
use pdk_sdk::error::Result;

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
