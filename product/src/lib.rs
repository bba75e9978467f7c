//! What pdk consists of besides its kernel. The kernel names no plugin and no script; the executable hands it this list.

mod examples;

use pdk_components::product::{BuiltInScript, Product};

/// The product that the executable `pdk` and the Python package are.
pub static PRODUCT: Product = Product {
    plugins: PLUGINS,
    perturbations: PERTURBATIONS,
    pipelines: PIPELINES,
    scales: SCALES,
    suites: SUITES,
    domain: include_str!("../../scripts/domain.toml"),
    modules: MODULES,
    first_pipeline: include_str!("../templates/pipeline.lua"),
    examples: examples::EXAMPLES,
    samples: &[("{{perturbation}}", "fog_filter@3"), ("{{driver}}", "dave2")],
};

/// The built-in plugins: the folders of `plugins`, each of which is a crate with the library `pdk_NAME`.
const PLUGINS: &[&str] = &[
    "affine",
    "beamng",
    "blur",
    "camera",
    "carla",
    "color",
    "datasets",
    "device",
    "distortion",
    "donkey",
    "imagenet_c",
    "lane",
    "lens",
    "models",
    "noise",
    "overlay",
    "pattern",
    "process",
    "search",
    "stream",
    "udacity",
    "weather",
];

/// Scripts by name and file, seen from `scripts`.
macro_rules! scripts {
    ($($name:literal: $file:literal),* $(,)?) => {
        &[$(BuiltInScript {
            name: $name,
            file: concat!("scripts/", $file),
            source: include_str!(concat!("../../scripts/", $file)),
        }),*]
    };
}

/// The pipelines, which `pdk run` knows by name.
const PIPELINES: &[BuiltInScript] = scripts! {
    "quickstart": "quickstart.lua",
    "manual": "manual.lua",
    "greedy": "greedy.lua",
    "study": "study.lua",
    "attention": "attention.lua",
    "offline": "offline.lua",
    "search": "search.lua",
    "collect": "training/collect.lua",
};

/// The scales on which a level means the same for every perturbation.
const SCALES: &[BuiltInScript] = scripts! {
    "calibrated-1": "scales/calibrated-1.scale.json",
};

/// The suites, which `pdk gate` knows by name.
const SUITES: &[BuiltInScript] = scripts! {
    "smoke": "suites/smoke.toml",
    "standard": "suites/standard.toml",
    "full": "suites/full.toml",
};

/// The modules that pipelines require as `@pdk/NAME`.
const MODULES: &[BuiltInScript] = scripts! {
    "bisection": "library/bisection.lua",
    "hill_climber": "library/hill_climber.lua",
    "space": "library/space.lua",
    "study": "library/study.lua",
    "tally": "library/tally.lua",
};

/// The perturbations.
const PERTURBATIONS: &[BuiltInScript] = scripts! {
    "banding": "perturbations/banding.lua",
    "dirty_lens": "perturbations/dirty_lens.lua",
};

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    fn repository() -> &'static Path {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
    }

    #[test]
    fn every_plugin_is_part_of_the_product() {
        let folders = std::fs::read_dir(repository().join("plugins")).unwrap().map(|entry| entry.unwrap());
        let folders = folders.filter(|entry| entry.path().join("Cargo.toml").is_file());
        let folders: BTreeSet<_> =
            folders.map(|entry| entry.file_name().into_string().unwrap().replace('-', "_")).collect();
        assert_eq!(PLUGINS.iter().map(|&name| name.to_owned()).collect::<BTreeSet<_>>(), folders);
    }

    #[test]
    fn every_script_comes_along_under_its_name() {
        let scripts = repository().join("scripts");
        let files = |folder: &str| -> BTreeSet<String> {
            let files = std::fs::read_dir(scripts.join(folder)).unwrap().map(|entry| entry.unwrap().path());
            let ending = match folder {
                "suites" => "toml",
                "scales" => "json",
                _ => "lua",
            };
            let scripts = files.filter(|file| file.extension().is_some_and(|own| own == ending));
            scripts.map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
        };
        let names = |list: &[BuiltInScript]| -> BTreeSet<String> {
            list.iter().map(|script| script.name.to_owned()).collect()
        };
        let pipelines: BTreeSet<String> = files("").union(&files("training")).cloned().collect();
        assert_eq!(pipelines, names(PIPELINES));
        assert_eq!(files("suites"), names(SUITES));
        assert_eq!(files("scales"), names(SCALES).iter().map(|name| format!("{name}.scale")).collect());
        assert_eq!(files("library"), names(MODULES));
        assert_eq!(files("perturbations"), names(PERTURBATIONS));
        for script in PIPELINES.iter().chain(SCALES).chain(SUITES).chain(MODULES).chain(PERTURBATIONS) {
            let stem = Path::new(script.file).file_stem().unwrap().to_str().unwrap();
            assert_eq!(stem.trim_end_matches(".scale"), script.name);
            assert_eq!(std::fs::read_to_string(repository().join(script.file)).unwrap(), script.source);
        }
    }
}
