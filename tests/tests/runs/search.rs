//! Searches: the same candidates whatever the number of workers and however often they are killed, and whatever goes wrong is
//! recorded or said in one sentence.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use pdk_tests::process::json_file;
use pdk_tests::{Pdk, repository, temp};
use serde_json::Value;

/// A problem without a simulator: critical in a corner.
const CORNER: &str = r#"
    local settings = pdk.settings({ strategy = "nsga2_dt", evaluations = 300 })
    local found = pdk.search({
        strategy = settings.strategy,
        space = { x = { real = { 0, 1 } }, n = { integer = { 0, 9 } }, kind = { choice = { "a", "b" } } },
        objectives = { miss = "minimise", gain = "maximise" },
        reference = { miss = 3, gain = -1 },
        evaluate = function(values)
            local miss = math.max(0, 0.7 - values.x) + math.max(0, 7 - values.n) / 10 + (if values.kind == "a" then 0 else 0.5)
            return { objectives = { miss = miss, gain = values.x - values.n / 10 }, critical = miss == 0 }
        end,
        stop = { evaluations = settings.evaluations },
    })
    pdk.save("found.json", found)
"#;

/// Short scenarios, each in a fraction of a second.
const LANE: &str = r#"
    local settings = pdk.settings({ strategy = "nsga2_dt", evaluations = 60 })
    pdk.search({
        simulator = { name = "lane", width = 64, height = 48, rate = 10 }, driver = "lane_keeper", duration = 3, images_every = 0,
        strategy = settings.strategy,
        space = {
            angle = { integer = { 0, 30 } },
            level = { real = { 0, 4 } },
            perturbation = { ordinal = { "contrast", "gaussian_noise", "translate_image" } },
        },
        objectives = { mean_cross_track_error = "maximise", progress = "minimise" },
        evaluate = function(values)
            return {
                road = { angles = { 0, values.angle, -values.angle }, segment = 10 },
                perturbations = { { name = values.perturbation, level = values.level } },
            }
        end,
        stop = { evaluations = settings.evaluations },
    })
"#;

fn script(folder: &Path, source: &str) -> PathBuf {
    let file = folder.join("search_test.lua");
    fs::write(&file, source).unwrap();
    file
}

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--out"]).arg(out).arg(script)
}

fn table(out: &Path) -> String {
    fs::read_to_string(out.join("search.csv")).unwrap()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn every_strategy_searches_and_what_it_proposes_follows_from_the_seed() {
    let folder = temp();
    let script = script(folder.path(), CORNER);
    let strategies = [
        "random",
        "grid",
        "sobol",
        "latin_hypercube",
        "nsga2",
        "nsga2_dt",
        "surrogate",
        "map_elites",
        "descent",
    ];
    for strategy in strategies {
        let [a, b, c] = ["a", "b", "c"].map(|name| folder.path().join(format!("{strategy}-{name}")));
        let given = match strategy {
            "descent" => r#"{"name":"descent","towards":"miss"}"#,
            name => name,
        };
        let search = |out: &Path| run(&script, out).set("strategy", given);
        search(&a).set("workers", 1).succeed();
        search(&b).set("workers", 3).succeed();
        search(&c).set("workers", 1).set("seed", 1).succeed();
        assert_eq!(table(&a), table(&b), "{strategy} depends on the number of workers");
        assert_eq!(strategy == "grid", table(&a) == table(&c), "{strategy} and its seed");
        let found = json_file(&a.join("search.json"));
        let returned = json_file(&a.join("found.json"));
        assert_eq!(found["front"], returned["front"]);
        let tests = found["tests"].as_array().unwrap();
        let distinct: std::collections::BTreeSet<String> =
            tests.iter().map(|test| test["values"].to_string()).collect();
        assert_eq!(
            found["evaluations"],
            distinct.len(),
            "{strategy}: the budget counts different candidates"
        );
        assert_eq!(found["duplicates"], tests.len() - distinct.len());
        assert!(found["critical"].as_u64().unwrap() > 0, "{strategy} found nothing");
        // A line for each test, and the header.
        assert_eq!(table(&a).lines().count(), tests.len() + 1);
        let volumes: Vec<f64> = found["convergence"]
            .as_array()
            .unwrap()
            .iter()
            .map(|point| point["hypervolume"].as_f64().unwrap())
            .collect();
        assert!(volumes.is_sorted() && volumes.last() > Some(&0.0), "{strategy}: {volumes:?}");
    }
}

#[test]
fn critical_regions_are_described_in_words() {
    let folder = temp();
    let out = folder.path().join("out");
    run(&script(folder.path(), CORNER), &out).succeed();
    let found = json_file(&out.join("search.json"));
    let region = found["tree"]["critical_regions"][0]["region"].as_str().unwrap();
    for part in ["kind is a", "n >= 7", "x >= 0."] {
        assert!(region.contains(part), "{region}");
    }
    let page = out.join("report.html");
    Pdk::new(["report"]).arg(&out).succeed();
    let page = fs::read_to_string(&page).unwrap();
    let shown = region.replace("&", "&amp;").replace(">", "&gt;").replace("<", "&lt;");
    assert!(page.contains(&shown) && page.contains("nsga2_dt") && page.contains("<circle"), "{shown}");
    assert_eq!(found["stopped"], "evaluations");
    assert!(found["distinct_failures"].as_array().unwrap().len() > 2);
}

#[test]
fn a_search_is_the_same_with_one_and_two_workers_and_killed_and_continued() {
    let folder = temp();
    let script = script(folder.path(), LANE);
    let [one, two, killed] = ["one", "two", "killed"].map(|name| folder.path().join(name));
    run(&script, &one).set("workers", 1).succeed();
    run(&script, &two).set("workers", 2).succeed();
    let mut kills = 0;
    for round in 1..=3 {
        let mut child = run(&script, &killed).set("workers", 2).spawn();
        // In the middle of it, however fast the machine is.
        let recorded =
            || fs::read_to_string(killed.join("scenarios.jsonl")).unwrap_or_default().lines().count();
        while child.try_wait().unwrap().is_none() && recorded() < 12 * round {
            std::thread::sleep(Duration::from_millis(2));
        }
        if child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            kills += 1;
        }
        child.wait().unwrap();
    }
    run(&script, &killed).set("workers", 2).succeed();
    assert!(kills > 0, "every run had ended before it was killed");
    for file in ["search.csv", "search.json", "scenarios.jsonl", "summary.json"] {
        let read = |out: &Path| fs::read_to_string(out.join(file)).unwrap();
        assert_eq!(read(&one), read(&two), "{file}");
        assert_eq!(read(&one), read(&killed), "{file} after {kills} kills");
    }
    let found = json_file(&one.join("search.json"));
    assert_eq!(found["evaluations"], 60);
    // A test names the scenario that it drove.
    let scenarios = fs::read_to_string(one.join("scenarios.jsonl")).unwrap();
    let tests = found["tests"].as_array().unwrap();
    assert!(tests.iter().all(|test| scenarios.contains(test["scenario"].as_str().unwrap())));
}

#[test]
fn a_strategy_may_be_written_in_lua() {
    let folder = temp();
    let source = CORNER.replace("settings.strategy,", "require(\"@pdk/hill_climber\").new(),");
    let script = script(folder.path(), &source);
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    run(&script, &a).set("workers", 1).succeed();
    run(&script, &b).set("workers", 2).succeed();
    assert_eq!(table(&a), table(&b));
    let found = json_file(&a.join("search.json"));
    assert_eq!(found["evaluations"], 300);
    assert!(found["critical"].as_u64().unwrap() > 50, "{}", found["critical"]);
}

#[test]
fn bisection_finds_where_failing_begins() {
    let folder = temp();
    let source = r#"
        local settings = pdk.settings({ from = "x", at = 0, least = 1.1 })
        pdk.search({
            strategy = require("@pdk/bisection").new({ [settings.from] = settings.at, n = 0 }),
            space = { x = { real = { 0, 1 } }, n = { integer = { 0, 9 } }, kind = { choice = { "a", "b" } } },
            objectives = { effort = "minimise" },
            evaluate = function(values)
                local effort = values.x + values.n / 9
                return { objectives = { effort = effort }, critical = values.kind == "b" and effort >= settings.least }
            end,
            stop = { evaluations = 100 },
        })
    "#;
    let script = script(folder.path(), source);
    let out = folder.path().join("out");
    run(&script, &out).succeed();
    let found = json_file(&out.join("search.json"));
    let tests = found["tests"].as_array().unwrap().iter();
    let failures = tests.filter(|test| test["critical"] == true);
    let efforts = failures.map(|test| test["objectives"]["effort"].as_f64().unwrap());
    let least = efforts.fold(f64::INFINITY, f64::min);
    assert!((1.1..1.12).contains(&least), "{least}");
    for (name, value, expected) in [
        ("from", "y", "bisection starts from y, which is not a number of the space"),
        ("from", "kind", "bisection starts from kind, which is not a number of the space"),
        ("at", "7", "bisection starts from x = 7; give a value from 0 to 1"),
        ("least", "0", "tests fail at the values that bisection starts from"),
    ] {
        run(&script, &folder.path().join(value)).set(name, value).fail(1, &[expected]);
    }
}

#[test]
fn a_space_of_which_all_is_evaluated_ends_the_search() {
    let folder = temp();
    let source = CORNER.replace("x = { real = { 0, 1 } }", "x = { integer = { 0, 1 } }");
    for strategy in ["nsga2", "random", "grid", "surrogate"] {
        let out = folder.path().join(strategy);
        run(&script(folder.path(), &source), &out).set("strategy", strategy).succeed();
        let found = json_file(&out.join("search.json"));
        assert_eq!(found["evaluations"], 40, "{strategy}: {}", found["stopped"]);
    }
}

#[test]
fn a_hypervolume_ends_the_search() {
    let folder = temp();
    let source = CORNER.replace("stop = {", "stop = { hypervolume = 4,");
    let script = script(folder.path(), &source);
    // More candidates are under way with more workers.
    let [one, eight] = [1, 8].map(|workers| {
        let out = folder.path().join(workers.to_string());
        run(&script, &out).set("workers", workers).succeed();
        out
    });
    let found = json_file(&one.join("search.json"));
    assert_eq!(found["stopped"], "hypervolume");
    assert!(found["evaluations"].as_u64().unwrap() < 300);
    assert_eq!(found["tests"].as_array().unwrap().len(), found["proposed"]);
    for file in ["search.json", "search.csv"] {
        let read = |out: &Path| fs::read_to_string(out.join(file)).unwrap();
        assert_eq!(read(&one), read(&eight), "{file} depends on the number of workers");
    }
}

/// What goes wrong with a candidate is recorded, and the search goes on.
#[test]
fn candidates_that_cannot_be_evaluated_are_recorded() {
    let evaluate = |body: &str| {
        let head = "local settings = pdk.settings({})\nlocal count = 0\npdk.search({ strategy = 'nsga2', \
             space = { x = { real = { 0, 1 } } }, objectives = { f = 'minimise' }, stop = { evaluations = 40 }, \
             simulator = { name = 'lane', width = 64, height = 48 }, driver = 'lane_keeper', duration = 0.2,\n\
             evaluate = function(values)\ncount = count + 1\nif count % 4 ~= 0 then return { objectives = { f = values.x } } end\n";
        format!("{head}{body}\nend }})")
    };
    for (name, body, said) in [
        ("nan", "return { objectives = { f = 0 / 0 } }", "evaluate.objectives.f is NaN"),
        ("error", "error('no such weather', 0)", "no such weather"),
        (
            "road",
            "return { road = pdk.road({ angles = { 60, 60, 60, 60, 60, 60, 60, 60 } }).road }",
            "the road leaves the map",
        ),
        ("nothing", "return nil", "what `evaluate` returns"),
        ("field", "return { objectives = { g = 1 } }", "`g` is not an objective"),
    ] {
        let folder = temp();
        let out = folder.path().join("out");
        let ran = run(&script(folder.path(), &evaluate(body)), &out).succeed();
        let found = json_file(&out.join("search.json"));
        assert_eq!(
            (&found["evaluations"], &found["failures"]),
            (&Value::from(40), &Value::from(10)),
            "{name}"
        );
        let failed: Vec<&str> =
            found["tests"].as_array().unwrap().iter().filter_map(|test| test["failure"].as_str()).collect();
        assert!(
            failed.len() == 10 && failed.iter().all(|failure| failure.contains(said)),
            "{name}: {failed:?}"
        );
        assert!(ran.stderr.contains("10 of 40 candidates could not be evaluated"), "{}", ran.stderr);
    }
}

/// A spreadsheet computes what begins so, and shows what stands behind an apostrophe.
#[test]
fn a_table_holds_no_formulas() {
    let folder = temp();
    let out = folder.path().join("out");
    let source = r#"pdk.search({ strategy = "random",
        space = { ["=x"] = { choice = { '=cmd|"/c calc"!A1', "+1+1", "@SUM(1)", "-2+3", "\t=1", "\r=1", "-2", "plain" } }, y = { real = { -3, -2 } } },
        objectives = { f = "minimise" }, stop = { evaluations = 60 },
        evaluate = function(values) return { objectives = { f = values.y } } end,
    })"#;
    run(&script(folder.path(), source), &out).succeed();
    let table = table(&out);
    for cell in [
        "number,'=x,y,f",
        ",\"'=cmd|\"\"/c calc\"\"!A1\",-2.",
        ",'+1+1,-2.",
        ",'@SUM(1),-2.",
        ",'-2+3,-2.",
        ",'\t=1,-2.",
        ",\"'\r=1\",-2.",
        ",-2,-2.",
        ",plain,-2.",
    ] {
        assert!(table.contains(cell), "{cell}: {table}");
    }
}

#[test]
fn a_scenario_that_crashes_its_worker_is_a_test_like_any_other() {
    let folder = temp();
    let source = LANE
        .replace("driver = \"lane_keeper\"", "driver = \"lane_keeper\", mode = \"lockstep\"")
        .replace(
            "road = {",
            "driver = if values.angle % 5 == 0 then { name = \"misbehave\", how = \"abort_in_drive\" } else \"lane_keeper\",\n road = {",
        )
        .replace("evaluations = 60", "evaluations = 30");
    let out = folder.path().join("out");
    let ran = run(&script(folder.path(), &source), &out).misbehave().run();
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    let found = json_file(&out.join("search.json"));
    assert_eq!(found["evaluations"], 30);
    let failures = found["failures"].as_u64().unwrap();
    assert!((1..20).contains(&failures), "{failures}");
}

#[test]
fn what_would_be_ignored_is_refused() {
    let folder = temp();
    let out = folder.path().join("out");
    let search = |fields: &str| {
        format!(
            "pdk.search({{ space = {{ x = {{ real = {{ 0, 1 }} }} }}, objectives = {{ y = 'minimise' }}, stop = {{ evaluations = 2 }}, \
             evaluate = function(values) return {{ objectives = {{ y = values.x }} }} end, {fields} }})"
        )
    };
    let random = "strategy = 'random'";
    let twice = format!(
        "{} {}",
        search("name = 'a', strategy = 'random'"),
        search("name = 'a', strategy = 'random'")
    );
    for (source, said) in [
        (
            search(&format!("{random}, constraints = {{ weights = {{ x = 1 }}, at_most = 0.5 }}")),
            "constraints is a table of fields",
        ),
        (
            search("strategy = { ask = function() return {} end, tel = print }"),
            "there is no field `strategy.tel`",
        ),
        (twice, "has a search `a` already"),
        ("pdk.perturbations('all')".to_owned(), "pdk.perturbations takes true or false"),
        (
            "pdk.session({ simulator = 'lane', driver = 'lane_keeper' }):drive({ scenarios = {} })"
                .to_owned(),
            "session:drive is a table of fields, but has to be a list",
        ),
    ] {
        let _ = fs::remove_dir_all(&out);
        run(&script(folder.path(), &source), &out).fail(1, &[said]);
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_space_that_cannot_be_searched_gets_one_sentence() {
    let folder = temp();
    let out = folder.path().join("out");
    let with = |from: &str, to: &str| {
        assert!(CORNER.contains(from), "{from}");
        script(folder.path(), &CORNER.replace(from, to))
    };
    let space =
        "{ x = { real = { 0, 1 } }, n = { integer = { 0, 9 } }, kind = { choice = { \"a\", \"b\" } } }";
    for (from, to, said) in [
        (space, "{}", "the space has no variables"),
        ("{ 0, 9 }", "{ 9, 0 }", "variable `n`: the range 9 to 0 is empty"),
        ("n = { integer", "n = { whole", "the variable `n` is"),
        ("\"minimise\"", "\"less\"", "\"minimise\" or \"maximise\""),
        (
            "stop = { evaluations = settings.evaluations }",
            "stop = {}",
            "has to name `evaluations` or `seconds`",
        ),
        ("settings.strategy,", "\"nsga3\",", "nsga3"),
        ("settings.strategy,", "{ name = \"nsga2\", populaton = 3 },", "has no parameter `populaton`"),
        ("settings.strategy,", "{ name = \"map_elites\", features = { \"z\" } },", "`z` is not a variable"),
        ("return { objectives", "return { objektives", "none of the first 20 candidates could be evaluated"),
        ("settings.strategy,", "{ ask = function() error('gone') end },", "gone"),
        (
            "settings.strategy,",
            "{ ask = function(n) return table.create(n + 1, {}) end },",
            "asked for 16 candidates",
        ),
        (
            "settings.strategy,",
            "{ ask = function() return { { x = 2, n = 0, kind = 'a' } } end },",
            "none of the first 20",
        ),
    ] {
        let _ = fs::remove_dir_all(&out);
        run(&with(from, to), &out).fail(1, &[said]);
    }
    let _ = fs::remove_dir_all(&out);
    let endless = with("settings.strategy,", "{ ask = function() while true do end end },");
    run(&endless, &out).env("PDK_SCRIPT_SECONDS", "1").fail(1, &["computed for more than 1 s at a stretch"]);
    let _ = fs::remove_dir_all(&out);
    let endless = with("local miss", "while true do end local miss");
    run(&endless, &out).env("PDK_SCRIPT_SECONDS", "1").fail(1, &["computed for more than 1 s at a stretch"]);
}

#[test]
fn a_strategy_that_misbehaves_ends_the_search_with_a_sentence() {
    let folder = temp();
    let script = script(folder.path(), CORNER);
    for (how, said) in [
        ("panic_in_start", "panicked"),
        ("abort_in_ask", "search `misbehave` in `ask`"),
        ("exit_in_tell", "search `misbehave` in `tell`"),
        ("too_many", "asked for"),
        ("out_of_range", "none of the first 20 candidates could be evaluated"),
    ] {
        let out = folder.path().join(how);
        let strategy = format!(r#"{{"name":"misbehave","how":"{how}"}}"#);
        run(&script, &out).misbehave().set("strategy", strategy).fail(1, &[said]);
    }
    let out = folder.path().join("hang");
    let strategy = r#"{"name":"misbehave","how":"hang_in_ask"}"#;
    run(&script, &out)
        .misbehave()
        .set("strategy", strategy)
        .set("patience", 3)
        .fail(1, &["search `misbehave` in `ask`"]);
}

#[test]
fn the_published_experiment_runs_small() {
    let folder = temp();
    let out = folder.path().join("out");
    Pdk::new(["run", "--out"])
        .arg(&out)
        .arg(repository().join("scripts/search.lua"))
        .set("simulator", r#"{"name":"lane","width":80,"height":60,"rate":10}"#)
        .set("evaluations", 24)
        .set("strategy.population", 8)
        .set("perturbations", "contrast,translate_image")
        .set("curvature", "0,20")
        .set("duration", 4)
        .succeed();
    let found = json_file(&out.join("search.json"));
    assert_eq!(found["evaluations"], 24);
    for test in found["tests"].as_array().unwrap() {
        // Negative if it failed, and only there.
        if let Some(criticality) = test["objectives"]["criticality"].as_f64() {
            assert_eq!(criticality < 0.0, test["critical"] == true, "{test}");
        }
    }
}

#[test]
fn searches_by_several_strategies_are_compared() {
    let folder = temp();
    let out = folder.path().join("out");
    let run = Pdk::new(["run", "--out"])
        .arg(&out)
        .arg(repository().join("scripts/search.lua"))
        .set("simulator", r#"{"name":"lane","width":64,"height":48,"rate":10}"#)
        .set("driver", "lane_keeper")
        .set("evaluations", 12)
        .set("strategy.population", 6)
        .set("searches", 3)
        .set("against", "random")
        .set("perturbations", "contrast,translate_image")
        .set("curvature", "0,20")
        .set("duration", 3)
        .succeed();
    assert!(
        run.stdout.contains("nsga2_dt") && run.stderr.contains("A: the probability"),
        "{} {}",
        run.stdout,
        run.stderr
    );
    let found = |name: &str| json_file(&out.join(format!("{name}.json")));
    let values = |name: &str| {
        found(name)["tests"].as_array().unwrap().iter().map(|t| t["values"].clone()).collect::<Vec<_>>()
    };
    // Each has a seed and candidates of its own.
    assert_ne!(values("random-1"), values("random-2"));
    assert_eq!(found("random-2")["seed"], 2);
    for number in 1..=3 {
        let found = found(&format!("nsga2_dt-{number}"));
        let first = found["tests"].as_array().unwrap().iter().position(|test| test["critical"] == true);
        assert_eq!(found["first_critical"].as_u64(), first.map(|place| place as u64 + 1));
        assert_eq!(found["hypervolume_reference"].as_array().unwrap().len(), 4);
    }
    let page = folder.path().join("page.html");
    Pdk::new(["report"]).arg(&out).arg("-o").arg(&page).succeed();
    let page = fs::read_to_string(&page).unwrap();
    assert!(page.contains("Search strategies") && page.contains("Medians, with the least"));
}

#[test]
fn the_space_of_the_documentation_is_searched() {
    let text = fs::read_to_string(repository().join("docs/search.md")).unwrap();
    let (_, rest) = text.split_once("```lua\n").unwrap();
    let (source, _) = rest.split_once("```").unwrap();
    let folder = temp();
    let out = folder.path().join("out");
    run(&script(folder.path(), source), &out)
        .set("evaluations", 6)
        .set("strategy", r#"{"name":"nsga2_dt","population":4}"#)
        .set("width", 80)
        .set("height", 60)
        .set("duration", 2)
        .succeed();
    let found = json_file(&out.join("search.json"));
    assert_eq!((&found["evaluations"], &found["failures"]), (&6.into(), &0.into()), "{found}");
}
