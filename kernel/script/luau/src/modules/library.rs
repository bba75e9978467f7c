//! The shipped library, in pipelines whose `pdk` answers without driving anything, and has simple statistics.

use mlua::{LuaSerdeExt, Table, Value};
use pdk_product::PRODUCT;
use pdk_sdk::serde_json::{self, json};

use super::Modules;
use crate::limits::Limits;
use crate::sandbox::Sandbox;

/// Notes all calls. A scenario succeeds unless it is on road 2, or has fog at level 3 or more.
const PDK: &str = r#"
    local calls = { drives = {}, tables = {}, saved = {} }
    local function settled(defaults)
        defaults.roads = 3
        defaults.repeats = 2
        defaults.perturbations = { "fog", "rain", "fog" }
        defaults.levels = { 3, 0, 3, 1 }
        if defaults.drivers then
            defaults.drivers = { "dave2", "lane_keeper" }
            defaults.conditions = { "easy", "hard" }
        end
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
                    verdict = if success then "passed" else "unsafe",
                    time = 3,
                    mean_cross_track_error = scenario.road.angles[1] + level / 10,
                    max_cross_track_error = (scenario.road.angles[1] + level) / 10,
                    measures = { over_line_seconds = 0 },
                }
                local conditions = if type(request.simulator) == "table" then ` {request.simulator.conditions}` else ""
                table.insert(calls.drives, `{scenario.name} {scenario.road.angles[1]} {request.driver} {request.duration}{conditions}`)
            end
            return outcomes
        end,
        draws = function(name) return name == "rain" end,
        failed_share = function(roads)
            local failed, count = 0, 0
            for _, road in roads do
                for _, one in road do
                    count += 1
                    failed += if one then 1 else 0
                end
            end
            return if count > 0 then { value = failed / count, low = 0, high = 1 } else nil
        end,
        mean = function(values)
            return if #values > 0 then { value = values[1], low = values[1], high = values[1] } else nil
        end,
        mean_share = function(shares)
            local sum, count = 0, 0
            for _, share in shares do
                if share then
                    sum += share
                    count += 1
                end
            end
            return if count > 0 then { value = sum / count, low = 0, high = 1 } else nil
        end,
        groups = function(entries)
            local groups = {}
            for i in entries do
                groups[i] = i
            end
            return groups
        end,
        compare = function(first, second)
            return { difference = { value = first[1] - second[1], low = -1, high = 1 }, effect_size = 0, p = 1, roads = #first }
        end,
        failing_level = function(roads)
            local drives, level = 0, nil
            for _, repeats in roads do
                for _, trials in repeats do
                    for _, trial in trials do
                        drives += 1
                        if trial.failed and (not level or trial.level < level) then
                            level = trial.level
                        end
                    end
                end
            end
            return if drives > 0 then { level = level, low = level, high = level, drives = drives } else nil
        end,
        fails_at = function(trials, level)
            for _, trial in trials do
                if (trial.failed and trial.level <= level) or (not trial.failed and trial.level >= level) then
                    return trial.failed
                end
            end
            return nil
        end,
        next_level = function(trials, search)
            if #trials == 0 then
                return search.highest
            elseif #trials == 1 and trials[1].failed then
                return search.lowest
            elseif #trials == 2 and not trials[2].failed then
                return (search.lowest + search.highest) / 2
            end
            return nil
        end,
        table = function(header, rows) table.insert(calls.tables, { header, rows }) end,
        save = function(name, value) calls.saved[name] = value end,
    }
"#;

/// The text of a pipeline.
fn source(name: &str) -> &'static str {
    PRODUCT.pipelines.iter().find(|script| script.name == name).unwrap().source
}

/// What a shipped pipeline does, after a change of its text.
fn run(name: &str, from: &str, to: &str) -> Result<(serde_json::Value, Modules), String> {
    let modules = Modules::new(None, PRODUCT.modules);
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

fn drives(calls: &serde_json::Value) -> Vec<&str> {
    calls["drives"].as_array().unwrap().iter().filter_map(|drive| drive.as_str()).collect()
}

#[test]
fn a_climb_goes_level_by_level_and_repeats_what_draws() {
    let (greedy, modules) = run("greedy", r#"search = "bisect""#, r#"search = "climb""#).unwrap();
    let drives = drives(&greedy);
    assert_eq!(
        drives[..3],
        ["nominal, road 1 1 dave2 60", "nominal, road 2 2 dave2 60", "nominal, road 3 3 dave2 60"]
    );
    assert_eq!(
        drives[3..10],
        [
            "fog@0, road 1 1 dave2 60",
            "rain@0, road 1 1 dave2 60",
            "rain@0, road 1, repeat 2 1 dave2 60",
            "fog@0, road 3 3 dave2 60",
            "rain@0, road 3 3 dave2 60",
            "rain@0, road 3, repeat 2 3 dave2 60",
            "fog@1, road 1 1 dave2 60",
        ]
    );
    // Three levels each: the last is where fog fails.
    assert_eq!(drives.len(), 3 + 3 * (2 + 4));
    let saved = &greedy["saved"]["greedy.json"];
    assert_eq!(saved["left_out"], json!([{ "road": 2, "cause": "lane_departure" }]));
    let road = |number: u32| json!({ "number": number, "road": { "angles": [number, 0], "segment": 25 }, "nominal": number });
    assert_eq!(saved["roads"], json!([road(1), road(3)]));
    let fog = &saved["results"][0];
    assert_eq!((&fog["failing_level"]["level"], &fog["failing_level"]["drives"]), (&json!(3), &json!(6)));
    assert_eq!(
        (&fog["unsafe"], &fog["stopped"], &fog["median_time_to_failure"]),
        (&json!(2), &json!(0), &json!(3))
    );
    assert_eq!(saved["results"][1]["failing_level"].get("level"), None);
    assert_eq!(modules.loaded()[0].name, "@pdk/study");
}

#[test]
fn a_bisection_drives_the_requested_levels() {
    let (greedy, _) = run("greedy", "dave2", "dave3").unwrap();
    let drives = drives(&greedy);
    assert_eq!(drives[3..5], ["fog@3, road 1 1 dave3 60", "rain@3, road 1 1 dave3 60"]);
    // The highest level everywhere, then where fog failed the lowest and the middle.
    assert_eq!(drives.len(), 3 + 6 + 4);
    assert_eq!(drives[9..11], ["fog@0, road 1 1 dave3 60", "fog@0, road 3 3 dave3 60"]);
    assert_eq!(drives[11..], ["fog@1.5, road 1 1 dave3 60", "fog@1.5, road 3 3 dave3 60"]);
    let searches = greedy["saved"]["greedy.json"]["searches"].as_array().unwrap();
    let counts: Vec<usize> =
        searches.iter().map(|search| search["drives"].as_array().unwrap().len()).collect();
    assert_eq!(counts, [3, 1, 1, 3, 1, 1]);
}

#[test]
fn a_study_halves_levels_and_compares_drivers() {
    let (study, _) = run("study", "dave2", "dave2").unwrap();
    let found = drives(&study);
    assert_eq!(
        found[..4],
        [
            "nominal, road 1 1 dave2 60 easy",
            "nominal, road 2 2 dave2 60 easy",
            "nominal, road 3 3 dave2 60 easy",
            "nominal, road 1 1 lane_keeper 60 easy",
        ]
    );
    assert_eq!(found.iter().filter(|drive| drive.starts_with("nominal")).count(), 12);
    // Two roads: the highest level first, rain twice; then the lowest where fog failed.
    assert_eq!(
        found[12..20],
        [
            "fog@3, road 1 1 dave2 60 easy",
            "fog@3, road 3 3 dave2 60 easy",
            "rain@3, road 1 1 dave2 60 easy",
            "rain@3, road 1, repeat 2 1 dave2 60 easy",
            "rain@3, road 3 3 dave2 60 easy",
            "rain@3, road 3, repeat 2 3 dave2 60 easy",
            "fog@0, road 1 1 dave2 60 easy",
            "fog@0, road 3 3 dave2 60 easy",
        ]
    );
    // The middle is not a level of the study, the nearest is.
    assert_eq!(found[20..22], ["fog@1, road 1 1 dave2 60 easy", "fog@1, road 3 3 dave2 60 easy"]);
    assert_eq!(found.len(), 12 + 4 * 10);
    assert_eq!(found.iter().filter(|drive| drive.contains("lane_keeper 60 hard")).count(), 3 + 10);
    let saved = &study["saved"]["ranking.json"];
    let out = |conditions: &str, driver: &str| json!({ "conditions": conditions, "driver": driver, "road": 2, "cause": "lane_departure" });
    assert_eq!(
        saved["left_out"],
        json!([
            out("easy", "dave2"),
            out("easy", "lane_keeper"),
            out("hard", "dave2"),
            out("hard", "lane_keeper")
        ])
    );
    let road = |number: u32| json!({ "road": number, "seed": number, "angles": [number, 0], "mean_cross_track_error": number, "over_line": false });
    assert_eq!(saved["nominal"][0]["roads"], json!([road(1), road(3)]));
    let fog = &saved["ranking"][0];
    assert_eq!(
        (&fog["perturbation"], &fog["drives"], &fog["failures"], &fog["unsafe"], &fog["failed_share"]),
        (&json!("fog"), &json!(24), &json!(8), &json!(8), &json!(1.0 / 3.0)),
        "it fails at the last of three levels"
    );
    let cell = &fog["cells"][3];
    assert_eq!((&cell["conditions"], &cell["driver"]), (&json!("hard"), &json!("lane_keeper")));
    let shares: Vec<_> =
        cell["by_level"].as_array().unwrap().iter().map(|at| at["failed_share"].clone()).collect();
    assert_eq!(shares, [json!(0), json!(0), json!(1)], "survived at 0 and 1");
    assert_eq!(fog["by_driver"][1]["failing_level"]["level"], 3);
    assert_eq!(saved["ranking"][1]["drives"], 16);
    assert!((saved["ranking"][1]["mean_cross_track_error_increase"].as_f64().unwrap() - 0.3).abs() < 1e-12);
    // Of 2 m: a failed drive came as close as can be, rain to .4 and .6 m on the two roads.
    let close = |place: usize| {
        let entry = &saved["ranking"][place];
        (entry["closeness"].as_f64().unwrap(), entry["closeness_group"].clone())
    };
    assert_eq!(close(0), (1.0, json!(1)));
    assert!((close(1).0 - 0.25).abs() < 1e-12 && close(1).1 == json!(2), "{:?}", close(1));
    assert!((saved["clear_view"]["closeness"].as_f64().unwrap() - 0.1).abs() < 1e-12);
    assert_eq!(saved["ranking"][0]["cells"][3]["closeness"], json!(1));
    assert_eq!(saved["by_level"][0]["by_level"][2]["failed_share"], json!(0.5));
    let comparison = &saved["comparisons"][0];
    assert_eq!((&comparison["against"], &comparison["paired"]["roads"]), (&json!("lane_keeper"), &json!(3)));
}

#[test]
fn closeness_is_of_the_place_at_which_a_lane_is_left() {
    let rain = |from: &str, to: &str| {
        let (study, _) = run("study", from, to).unwrap();
        study["saved"]["ranking.json"]["ranking"][1]["closeness"].as_f64()
    };
    let set = |lane_departure: f64| format!("failure = {{ lane_departure = {lane_departure} }}");
    let failure = "failure = {}";
    // Rain has .4 and .6 m on the two roads.
    for (lane_departure, expected) in [(4.0, 0.125), (0.5, 0.9)] {
        let found = rain(failure, &set(lane_departure)).unwrap();
        assert!((found - expected).abs() < 1e-12, "{lane_departure} m: {found}");
    }
    let of_the_simulator =
        rain(r#"simulator = "lane""#, r#"simulator = { name = "udacity", lane_departure = 4 }"#);
    assert!((of_the_simulator.unwrap() - 0.125).abs() < 1e-12);
    assert_eq!(rain(r#"simulator = "lane""#, r#"simulator = "udacity""#), None, "it is not known there");
}

#[test]
fn a_study_names_a_network_by_its_file() {
    let checked = "local names, levels = study.checked(settings";
    let network =
        format!("settings.drivers = {{ {{ name = \"onnx\", model = \"pilot.onnx\" }} }}\n{checked}");
    let (study, _) = run("study", checked, &network).unwrap();
    let saved = &study["saved"]["ranking.json"];
    assert_eq!(saved["ranking"][0]["by_driver"][0]["driver"], "pilot.onnx");
    assert_eq!(saved["nominal"][0]["driver"], "pilot.onnx");
    assert_eq!(study["tables"][1][0][5], "pilot.onnx fails at");
    assert!(!study["tables"].to_string().contains("0x"), "{}", study["tables"]);
}

#[test]
fn a_study_of_all_levels_drives_all() {
    let (study, _) = run("study", r#"search = "bisect""#, r#"search = "all""#).unwrap();
    let found = drives(&study);
    // Two roads, three levels, fog once, rain twice, for two drivers in two conditions.
    assert_eq!(found.len(), 12 + 4 * 2 * 3 * 3);
    let fog = &study["saved"]["ranking.json"]["ranking"][0];
    assert_eq!(
        (&fog["drives"], &fog["failures"], &fog["failed_share"]),
        (&json!(24), &json!(8), &json!(1.0 / 3.0))
    );
    assert!(
        (study["saved"]["ranking.json"]["ranking"][1]["mean_cross_track_error_increase"].as_f64().unwrap()
            - 0.3)
            .abs()
            < 1e-12
    );
}

#[test]
fn settings_that_make_no_study_are_refused_at_their_pipeline() {
    for name in ["greedy", "study"] {
        let source = source(name);
        let line = 1 + source.lines().position(|line| line.contains("study.checked")).unwrap();
        let error = |to: &str| run(name, "study.checked(settings", to).map(|_| ()).unwrap_err();
        assert_eq!(
            error("study.checked((function() settings.attempts = 0 return settings end)()"),
            format!("{name}:{line}: attempts is 0, but has to be a whole number of at least 1")
        );
        assert_eq!(
            error("study.checked((function() settings.levels = {} return settings end)()"),
            format!("{name}:{line}: levels is empty; name at least one from 0 to 4")
        );
        let roads = source.lines().find(|line| line.contains("= study.roads(")).unwrap();
        let (names, _) = roads.trim().split_once(" = ").unwrap();
        let error = run(name, roads, &format!("{names} = {{}}, {{}}")).map(|_| ()).unwrap_err();
        assert!(error.contains("managed no road without"), "{error}");
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
