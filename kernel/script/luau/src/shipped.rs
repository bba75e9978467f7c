//! The scripts that are part of pdk. The files in the folder `scripts` are their source.

use pdk_components::registry::BuiltInScript;

/// Scripts by name and file, seen from `scripts`.
macro_rules! scripts {
    ($($name:literal: $file:literal),* $(,)?) => {
        &[$(BuiltInScript { name: $name, source: include_str!(concat!("../../../../scripts/", $file)) }),*]
    };
}

/// The pipelines, which `pdk run` knows by name.
pub const PIPELINES: &[BuiltInScript] = scripts! {
    "quickstart": "quickstart.lua",
    "manual": "manual.lua",
    "greedy": "greedy.lua",
    "study": "study.lua",
    "attention": "attention.lua",
    "offline": "offline.lua",
    "search": "search.lua",
    "collect": "training/collect.lua",
};

/// The modules that pipelines require as `@pdk/NAME`.
pub const LIBRARY: &[BuiltInScript] = scripts! {
    "hill_climber": "library/hill_climber.lua",
    "study": "library/study.lua",
    "tally": "library/tally.lua",
};

/// The perturbations.
pub const PERTURBATIONS: &[BuiltInScript] = scripts! {
    "banding": "perturbations/banding.lua",
    "dirty_lens": "perturbations/dirty_lens.lua",
};

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    #[test]
    fn every_script_comes_along_under_its_name() {
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../scripts");
        let files = |folder: &str| -> BTreeSet<String> {
            let files = std::fs::read_dir(scripts.join(folder)).unwrap().map(|entry| entry.unwrap().path());
            let scripts = files.filter(|file| file.extension().is_some_and(|ending| ending == "lua"));
            scripts.map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
        };
        let names = |list: &[BuiltInScript]| list.iter().map(|script| script.name.to_owned()).collect();
        let pipelines: BTreeSet<String> = files("").union(&files("training")).cloned().collect();
        assert_eq!(pipelines, names(PIPELINES));
        assert_eq!(files("library"), names(LIBRARY));
        assert_eq!(files("perturbations"), names(PERTURBATIONS));
        for script in PIPELINES.iter().chain(LIBRARY).chain(PERTURBATIONS) {
            let named = format!("{}.lua", script.name);
            let found = ["", "training", "library", "perturbations"].iter().any(|folder| {
                std::fs::read_to_string(scripts.join(folder).join(&named))
                    .is_ok_and(|text| text == script.source)
            });
            assert!(found, "{} has the text of another file", script.name);
        }
    }
}
