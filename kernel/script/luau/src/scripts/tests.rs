use std::fs;

use pdk_sdk::serde_json::{Map, json};

use super::*;

/// Describes a script in a new folder of this name.
fn describe(folder: &str, source: &str) -> Result<Option<Description>> {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join(folder);
    fs::create_dir(&folder).unwrap();
    let file = folder.join("foo.lua");
    fs::write(&file, source).unwrap();
    let result = LuaScripts::default().describe(Script::File(&file));
    // Without the way there, which differs.
    result.map_err(|error| error.to_string().replace(&format!("{}/", folder.display()), "").into())
}

fn error(folder: &str, source: &str) -> String {
    describe(folder, source).expect_err(source).to_string()
}

const PERTURBATION: &str = "-- Not what pdk.drive({}) does.
    return { doc = 'Fog', apply = function(image) image:fill(1, 2, 3) end }";
const PIPELINES: [&str; 5] = [
    "local settings = pdk.settings({}) pdk.drive({})",
    "local study = require('@pdk/study') study.drive()",
    "local drive = pdk['dri' .. 've'] return drive({})",
    "for _, name in pdk.perturbations() do print(name) end",
    "local ok = pcall(function() pdk.settings({}) end) if not ok then error('no settings') end",
];
const MODULES: [&str; 4] =
    ["return { once = function() end }", "return function() end", "local x = 1", "return { doc = 'x' }"];

#[test]
fn a_table_with_apply_is_a_perturbation_wherever_it_lies() {
    for folder in ["perturbations", "scripts"] {
        let description = describe(folder, PERTURBATION).unwrap().unwrap();
        let expected = Description { defined_in: String::new(), ..Description::perturbation("foo", "Fog") };
        assert_eq!(description, expected);
        assert_eq!(
            error(folder, "return { doc = 'x', aply = 1, apply = print }"),
            "foo.lua: the perturbation has an unknown field `aply`; did you mean `apply`?"
        );
    }
    // What is in a text does not count.
    let source = "local text = 'pdk.drive(' return { doc = 'x', apply = print }";
    assert!(describe("scripts", source).unwrap().is_some(), "{source}");
}

#[test]
fn pipelines_and_modules_are_not_components() {
    for source in PIPELINES.iter().chain(&MODULES).filter(|source| !source.contains("doc")) {
        assert_eq!(describe("scripts", source), Ok(None), "{source}");
    }
    // What says what it does is meant as a perturbation, and told what it lacks.
    let error = describe("scripts", "return { doc = 'x' }").unwrap_err().to_string();
    assert!(error.contains("has no `apply`"), "{error}");
}

#[test]
fn pipelines_and_modules_are_not_run_to_find_out() {
    for source in [
        "error('it runs') pdk.drive({ mask = 1 })",
        "while true do end pdk.drive({})",
        "error('it runs') return { once = function() require('./x') end }",
        "error('it runs')",
        "local x = = pdk",
    ] {
        assert_eq!(describe("scripts", source), Ok(None), "{source}");
    }
}

#[test]
fn a_perturbation_that_is_not_returned_is_reported() {
    for (folder, source) in [
        ("scripts", "local fog = { doc = 'x', apply = function() end }"),
        ("perturbations", "local fog = { doc = 'x', apply = function() end }"),
        ("scripts", "function apply(image) image:fill(1, 2, 3) end"),
    ] {
        let error = error(folder, source);
        assert!(
            error.starts_with(
                "foo.lua: the script returns nothing, but has to return a table, as in return {"
            ),
            "{error}"
        );
    }
}

#[test]
fn nothing_but_perturbations_belongs_into_their_folder() {
    for source in PIPELINES {
        let error = error("perturbations", source);
        assert!(
            error.starts_with("foo.lua: is a pipeline, but a perturbation is expected here; "),
            "{error}"
        );
    }
    for source in MODULES {
        let error = error("perturbations", source);
        let said = ["has no `apply`", "but has to return a table", "unknown field `once`"];
        assert!(said.iter().any(|said| error.contains(said)), "{error}");
    }
}

#[test]
fn a_file_that_the_user_named_has_to_be_a_perturbation() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, source: &str| {
        let file = place.path().join(name);
        fs::write(&file, source).unwrap();
        file
    };
    let named = write("named.lua", PIPELINES[0]);
    let other = write("other.lua", PIPELINES[0]);
    let fog = write("fog.lua", PERTURBATION);
    let plugins = vec![named.clone(), fog.clone(), place.path().to_owned()];
    let scripts = LuaScripts::new(&SearchPath { plugins, ..SearchPath::default() });
    let error = scripts.describe(Script::File(&named)).unwrap_err().to_string();
    assert!(error.contains("named.lua: is a pipeline, but a perturbation is expected here"), "{error}");
    assert_eq!(scripts.describe(Script::File(&other)), Ok(None));
    assert_eq!(scripts.describe(Script::File(&fog)).unwrap().unwrap().name, "fog");
}

#[test]
fn a_script_that_fails_for_another_reason_is_an_error() {
    for folder in ["perturbations", "scripts"] {
        for (source, expected) in [
            ("local apply error('no road')", "foo.lua:1: no road"),
            ("\nlocal apply = = 1", "foo.lua:2: Expected"),
            ("local mask while true do end", "foo.lua:1: used more than "),
            ("return { apply = nothing.drive() }", "foo.lua:1: attempt to index nil with 'drive'"),
            ("local doc error('pdk.drive')", "foo.lua:1: pdk.drive"),
        ] {
            let error = error(folder, source);
            assert!(error.starts_with(expected), "{error}");
        }
    }
    let missing =
        LuaScripts::default().describe(Script::File(Path::new("no/such/file.lua"))).unwrap_err().to_string();
    assert!(missing.starts_with("no/such/file.lua: "), "{missing}");
}

#[test]
fn an_instance_that_calls_a_function_of_pipelines_gets_an_error() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("perturbations");
    fs::create_dir(&folder).unwrap();
    let file = folder.join("foo.lua");
    fs::write(&file, "return { doc = 'x', apply = function() pdk.drive({}) end }").unwrap();
    let scripts = LuaScripts::default();
    let description = scripts.describe(Script::File(&file)).unwrap().unwrap();
    let config = Config::check(&description, json!({}).as_object().unwrap_or(&Map::new())).unwrap();
    let Ok(Instance::Perturbation(mut made)) = scripts.create(Script::File(&file), &config) else { panic!() };
    let src = pdk_sdk::ops::FrameBuf::new(4, 3);
    let mut dst = src.clone();
    let key = pdk_sdk::seed::key(7, "foo", 0);
    let cx = pdk_sdk::perturbation::Context::new(1.0, 0, 0.0, &key);
    let error = made.apply(src.as_ref(), dst.as_mut(), &cx).unwrap_err().to_string();
    assert!(
        error.ends_with("foo.lua:1: pdk.drive is available only in pipelines, which `pdk run` runs"),
        "{error}"
    );
}
