//! Suites of scenarios in TOML, and what is drawn from them.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pdk_gate::loaded::Loaded;
use pdk_gate::series::Series;
use pdk_gate::step::step;
use pdk_pipeline::program::Text;

fuzz_target!(|data: &[u8]| {
    let Ok(source) = std::str::from_utf8(data) else { return };
    let text = Text { path: "a.toml".into(), source: source.to_owned(), folder: None };
    let Ok(loaded) = Loaded::new(text) else { return };
    if !loaded.suite.places.is_empty()
        && let Ok(drawn) = step(&loaded, Series::Drawn, 0)
    {
        assert!(step(&loaded, Series::Drawn, 0).is_ok_and(|again| again == drawn));
    }
    if !loaded.suite.scenarios.is_empty() {
        assert!(step(&loaded, Series::Fixed, 0).is_ok());
    }
});
