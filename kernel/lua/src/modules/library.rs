//! The shipped library, in pipelines whose `pdk` answers without driving anything.

use mlua::{LuaSerdeExt, Table, Value};
use pdk_sdk::serde_json::{self, json};

use super::Modules;
use crate::limits::Limits;
use crate::sandbox::Sandbox;
use crate::shipped::{LIBRARY, PIPELINES};

/// Notes all calls. A scenario succeeds unless it is on road 2, or has fog at level 3 or more.
const PDK: &str = r#"
    local calls = { drives = {}, tables = {}, saved = {} }
    local function settled(defaults)
        defaults.roads = 3
        defaults.perturbations = { "fog", "rain", "fog" }
        defaults.levels = { 3, 0, 3, 1 }
        return defaults
    end
    return calls, {
        settings = settled,
        perturbations = function() return { "fog" } end,
        road = function(request)
            return { angles = { request.seed, 0 }, road = { angles = { request.seed, 0 }, segment = 25 } }
        end,
        drive = function(request)
            local outcomes = {}
            for i, scenario in request.scenarios do
                local applied = scenario.perturbations and scenario.perturbations[1]
                local fog = applied and applied.name == "fog" and applied.level >= 3
                local success = scenario.road.angles[1] ~= 2 and not fog
                local level = if applied then applied.level else 0
                outcomes[i] = {
                    success = success,
                    cause = if success then "end_of_road" else "lane_departure",
                    mean_cross_track_error = scenario.road.angles[1] + level / 10,
                }
                table.insert(calls.drives, `{scenario.name} {scenario.road.angles[1]} {request.driver} {request.duration}`)
            end
            return outcomes
        end,
        table = function(header, rows) table.insert(calls.tables, { header, rows }) end,
        save = function(name, value) calls.saved[name] = value end,
    }
"#;

/// The text of a pipeline.
fn source(name: &str) -> &'static str {
    PIPELINES.iter().find(|script| script.name == name).unwrap().source
}

/// What a shipped pipeline does, after a change of its text.
fn run(name: &str, from: &str, to: &str) -> Result<(serde_json::Value, Modules), String> {
    let modules = Modules::new(None, LIBRARY);
    let mut calls = None;
    let sandbox = Sandbox::with_api(Limits::default(), |lua| {
        let (noted, pdk): (Table, Table) = lua.load(PDK).eval()?;
        calls = Some(noted);
        lua.globals().set("pdk", pdk)?;
        modules.install(lua)
    })
    .unwrap();
    let source = source(name);
    assert!(source.contains(from), "{from}");
    let chunk = sandbox.load(name, source.replace(from, to).as_bytes()).unwrap();
    sandbox.call(name, &chunk, ()).map_err(|error| error.to_string())?;
    Ok((sandbox.lua().from_value(Value::Table(calls.unwrap())).unwrap(), modules))
}

#[test]
fn studies_leave_out_roads_and_drive_the_others() {
    let (greedy, modules) = run("greedy", "dave2", "dave3").unwrap();
    let nominal = ["nominal, road 1 1 dave3 40", "nominal, road 2 2 dave3 40", "nominal, road 3 3 dave3 40"];
    let drives: Vec<&str> = greedy["drives"].as_array().unwrap().iter().filter_map(|d| d.as_str()).collect();
    assert_eq!(drives[..3], nominal);
    assert_eq!(
        drives[3..8],
        [
            "fog@0, road 1 1 dave3 40",
            "rain@0, road 1 1 dave3 40",
            "fog@0, road 3 3 dave3 40",
            "rain@0, road 3 3 dave3 40",
            "fog@1, road 1 1 dave3 40"
        ]
    );
    let saved = &greedy["saved"]["greedy.json"];
    assert_eq!(saved["left_out"], json!([{ "road": 2, "cause": "lane_departure" }]));
    let road = |number: u32| json!({ "number": number, "road": { "angles": [number, 0], "segment": 25 }, "nominal": number });
    assert_eq!(saved["roads"], json!([road(1), road(3)]));
    assert_eq!(saved["results"][0]["first_failing_level"], 3);
    assert_eq!(saved["results"][1].get("first_failing_level"), None);
    assert_eq!(modules.loaded()[0].name, "@pdk/study");

    let (study, _) = run("study", "dave2", "dave3").unwrap();
    let drives: Vec<&str> = study["drives"].as_array().unwrap().iter().filter_map(|d| d.as_str()).collect();
    assert_eq!(drives[..3], nominal);
    assert_eq!(drives.len(), 3 + 2 * 3 * 2);
    let saved = &study["saved"]["ranking.json"];
    assert_eq!(saved["left_out"], json!([{ "road": 2, "cause": "lane_departure" }]));
    let road = |number: u32| json!({ "road": number, "seed": number, "angles": [number, 0], "nominal_mean_cross_track_error": number });
    assert_eq!(saved["roads"], json!([road(1), road(3)]));
    assert_eq!(saved["ranking"][0]["perturbation"], "fog");
    assert_eq!(saved["ranking"][0]["failures"], 2);
}

#[test]
fn settings_that_make_no_study_are_refused_at_their_pipeline() {
    for name in ["greedy", "study"] {
        let source = source(name);
        let line = 1 + source.lines().position(|line| line.contains("study.checked")).unwrap();
        let error = |to: &str| run(name, "study.checked(settings", to).map(|_| ()).unwrap_err();
        assert_eq!(
            error("study.checked((function() settings.attempts = 0 return settings end)()"),
            format!("{name}:{line}: attempts is 0, but has to be at least 1")
        );
        assert_eq!(
            error("study.checked((function() settings.levels = {} return settings end)()"),
            format!("{name}:{line}: levels is empty; name at least one from 0 to 4")
        );
        let error = run(name, "= study.roads(settings)", "= {}, {}").map(|_| ()).unwrap_err();
        assert!(error.contains("the driver managed no road without perturbation"), "{error}");
    }
}

#[test]
fn no_perturbations_are_the_default_set() {
    let none = "local none = table.clone(settings) none.perturbations = {}\nlocal names, levels = study.checked(none";
    let (study, _) = run("study", "local names, levels = study.checked(settings", none).unwrap();
    let ranking = study["saved"]["ranking.json"]["ranking"].as_array().unwrap();
    assert_eq!(ranking.len(), 1);
    assert_eq!(ranking[0]["perturbation"], "fog");
}
