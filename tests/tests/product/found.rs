//! Each component that comes with pdk is found in one guess: its source file is named after it, in the crate of its family.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use pdk_tests::{Pdk, repository};
use serde_json::Value;

/// The rule, as CONTRIBUTING has it: `scripts/perturbations/NAME.lua`, or `plugins/FAMILY/src/NAME.rs`, or, in a crate that has components
/// of several kinds, `plugins/CRATE/src/KIND/NAME.rs`. In the name of a file, a hyphen is an underscore and a plus `_plus`.
fn file_of(component: &Value, kinds: usize) -> String {
    let word = |field: &str| component["description"][field].as_str().unwrap().to_owned();
    let name = word("name");
    if component["file"].as_str().unwrap().starts_with("built-in:") {
        return format!("scripts/perturbations/{name}.lua");
    }
    let file = name.replace('-', "_").replace('+', "_plus");
    match kinds {
        1 if word("kind") == "perturbation" => format!("plugins/{}/src/{file}.rs", word("family")),
        1 => format!("plugins/{}/src/{file}.rs", crate_of(component)),
        _ => format!("plugins/{}/src/{}/{file}.rs", crate_of(component), word("kind")),
    }
}

/// The folder of the crate whose library has a component.
fn crate_of(component: &Value) -> String {
    let library =
        Path::new(component["file"].as_str().unwrap()).file_stem().unwrap().to_string_lossy().into_owned();
    library.trim_start_matches("libpdk_").to_owned()
}

fn components() -> Vec<Value> {
    let list = Pdk::new(["list", "--json"]).succeed();
    let list: Value = serde_json::from_str(&list.stdout).unwrap();
    list.as_array().unwrap().clone()
}

#[test]
fn every_component_is_in_the_file_that_its_name_says() {
    let components = components();
    assert!(components.len() > 100);
    let mut kinds: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for component in &components {
        kinds.entry(crate_of(component)).or_default().insert(component["description"]["kind"].to_string());
    }
    let mut files = BTreeSet::new();
    for component in &components {
        let expected = file_of(component, kinds[&crate_of(component)].len());
        let name = component["description"]["name"].as_str().unwrap();
        assert_eq!(component["code"], expected.as_str(), "{name}");
        let source = std::fs::read_to_string(repository().join(&expected))
            .unwrap_or_else(|error| panic!("{expected}: {error}"));
        // The compiler notes the file in which a description begins; that of a script is what runs.
        let short = name.strip_prefix("imagenet_c_").unwrap_or(name);
        assert!(
            expected.ends_with(".lua") || source.contains(&format!("\"{short}\"")),
            "{expected} does not describe `{name}`"
        );
        assert!(source.lines().count() <= 500, "{expected} has {} lines", source.lines().count());
        assert!(files.insert(expected.clone()), "{expected} has two components");
    }
}

#[test]
fn show_says_the_source_file_of_what_comes_with_pdk_and_the_file_of_what_does_not() {
    let shown = |pdk: Pdk, name: &str| pdk.args(["show", name]).succeed().stdout;
    let pdk = || Pdk::new([] as [&str; 0]);
    assert!(shown(pdk(), "gaussian_noise").contains("code      plugins/noise/src/gaussian_noise.rs\n"));
    assert!(
        shown(pdk(), "grad-cam++").contains("code      plugins/models/src/saliency/grad_cam_plus_plus.rs\n")
    );
    assert!(shown(pdk(), "banding").contains("code      scripts/perturbations/banding.lua\n"));
    let library = pdk_tests::test_library("misbehave");
    let given = Pdk::new(["list", "--json", "--plugins"]).arg(&library).succeed();
    let given: Value = serde_json::from_str(&given.stdout).unwrap();
    let own =
        given.as_array().unwrap().iter().filter(|component| component["file"] == library.to_str().unwrap());
    let own: Vec<_> = own.collect();
    assert!(!own.is_empty() && own.iter().all(|component| component["code"] == component["file"]), "{own:?}");
}
