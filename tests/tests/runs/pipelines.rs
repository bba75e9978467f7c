//! The pipelines that come with pdk: what they save agrees with the record, and two runs are equal.

use std::fs;
use std::path::Path;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Pdk, repository, temp};
use serde_json::{Value, json};

/// Small frames: 80 x 60 pixels, 20 a second.
const SIMULATOR: &str = r#"{"name":"lane","width":80,"height":60,"rate":20}"#;

fn tiny(script: &str, out: &Path) -> Pdk {
    Pdk::new(["run", "--out"])
        .arg(out)
        .arg(repository().join("scripts").join(script))
        .set("simulator", SIMULATOR)
        .set("perturbations", "contrast,translate_image")
        .set("levels", "0,4")
        .set("limit", "10")
        .set("segment", "12")
}

/// A study of one driver in easy conditions.
fn tiny_study(out: &Path) -> Pdk {
    tiny("study.lua", out).set("conditions", "easy").set("drivers", "dave2")
}

/// The outcome of a scenario by its name.
fn outcome<'a>(outcomes: &'a [Value], name: &str) -> &'a Value {
    outcomes.iter().find(|outcome| outcome["name"] == name).expect(name)
}

#[test]
fn greedy_climbs_until_the_first_failure() {
    let folder = temp();
    let outs = ["a", "b"].map(|name| folder.path().join(name));
    let climb = |out: &Path| tiny("greedy.lua", out).set("roads", 1).set("search", "climb");
    let ran = climb(&outs[0]).succeed();
    climb(&outs[1]).set("workers", 1).succeed();
    let read = |out: &Path| fs::read_to_string(out.join("greedy.json")).unwrap();
    assert_eq!(read(&outs[0]), read(&outs[1]));
    assert!(ran.stdout.contains("translate_image") && ran.stdout.contains("fails at"), "{}", ran.stdout);

    let outcomes = json_lines(&outs[0].join("scenarios.jsonl"));
    let greedy = json_file(&outs[0].join("greedy.json"));
    let searches = greedy["searches"].as_array().unwrap();
    assert_eq!(searches.len(), 2);
    let mut driven = 1;
    for search in searches {
        let name = search["perturbation"].as_str().unwrap();
        let drives = search["drives"].as_array().unwrap();
        for (place, drive) in drives.iter().enumerate() {
            driven += 1;
            let outcome = outcome(&outcomes, &format!("{name}@{}, road 1", drive["level"]));
            for field in ["success", "cause"] {
                assert_eq!(outcome[field], drive[field]);
            }
            // Luau writes a whole number without a point.
            assert_eq!(outcome["time"].as_f64(), drive["time"].as_f64());
            assert!(drive["success"] == true || place + 1 == drives.len(), "it went on: {search}");
            // A mean of a part of the road is none.
            assert_eq!(drive.get("mean_cross_track_error").is_some(), drive["success"] == true);
        }
    }
    assert_eq!(outcomes.len(), driven, "something was driven that no result speaks of");
    let results = greedy["results"].as_array().unwrap();
    let translate = results.iter().find(|result| result["perturbation"] == "translate_image").unwrap();
    assert!(translate["failing_level"]["level"].is_number(), "{translate}");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_bisection_finds_the_failing_level_on_every_road() {
    let folder = temp();
    let out = folder.path().join("record");
    tiny("greedy.lua", &out).set("roads", 4).set("resolution", 1).succeed();
    let greedy = json_file(&out.join("greedy.json"));
    let of = |name: &str| {
        let found =
            greedy["results"].as_array().unwrap().iter().find(|result| result["perturbation"] == name);
        found.unwrap()["failing_level"].clone()
    };
    // One drive on each road says that contrast never makes it fail.
    let contrast = of("contrast");
    let roads = greedy["roads"].as_array().unwrap().len();
    assert_eq!((contrast.get("level"), &contrast["drives"]), (None, &json!(roads)), "{contrast}");
    let translate = of("translate_image");
    let level = translate["level"].as_f64().unwrap();
    assert!(
        translate["low"].as_f64().unwrap() <= level && translate["drives"].as_u64().unwrap() > roads as u64
    );
    tiny("greedy.lua", &folder.path().join("x")).set("search", "fast").fail(1, &["bisect or climb"]);
}

#[test]
fn roads_that_fail_without_perturbation_are_left_out() {
    let folder = temp();
    let out = folder.path().join("record");
    let said = ["managed no road", "raise duration, which is 1 s"];
    let greedy = tiny("greedy.lua", &out).set("duration", 1).set("roads", 1).fail(1, &said);
    assert!(!greedy.contains("Left out"), "{greedy}");
    let study = folder.path().join("study");
    tiny_study(&study).set("duration", 1).set("roads", 1).fail(1, &said);
}

#[test]
fn settings_are_checked_before_anything_is_driven() {
    let folder = temp();
    for (setting, value, said) in [
        ("levels", "0,5", "levels has 5, but intensities go from 0 to 4"),
        ("repeats", "2.5", "repeats is 2.5, but has to be a whole number of at least 1"),
        ("confidence", "95", "confidence is 95, but has to be between 0 and 1"),
    ] {
        for script in ["greedy.lua", "study.lua"] {
            let out = folder.path().join(format!("{script}-{setting}"));
            tiny(script, &out).set(setting, value).fail(1, &[said]);
            assert!(!out.exists(), "{script} began to drive with {setting}={value}");
        }
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn repeats_are_searched_apart() {
    let folder = temp();
    let out = folder.path().join("record");
    // In less than half of the repeats it makes the driver fail, at levels from 1 on.
    let source = "return { doc = 'moves the frame at times', draws_per_sequence = 'whether', apply = function(image, cx) \
                  if cx.sequence_random:unit() < 0.3 and cx.intensity >= 1 then image:translate(40, -30) end end }";
    fs::write(folder.path().join("at_times.lua"), source).unwrap();
    let greedy =
        tiny("greedy.lua", &out).set("roads", 4).set("resolution", 1).arg("--plugins").arg(folder.path());
    greedy.set("perturbations", "at_times").succeed();
    let greedy = json_file(&out.join("greedy.json"));
    let searches = greedy["searches"].as_array().unwrap();
    let failed = searches.iter().filter(|search| search["drives"][0]["success"] == false);
    assert_eq!((searches.len(), failed.count()), (12, 2));
    // The drives below level 4 were all under the luck of those that failed there, and say nothing about the others.
    let level = &greedy["results"][0]["failing_level"];
    assert_eq!((level.get("level"), level["drives"].as_u64()), (None, Some(12 + 2 * 3)), "{level}");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn levels_are_climbed_from_the_lowest_and_nothing_counts_twice() {
    let folder = temp();
    let out = folder.path().join("greedy");
    let names = "translate_image,contrast,translate_image";
    let greedy = tiny("greedy.lua", &out).set("perturbations", names).set("levels", "4,0,4").set("roads", 1);
    greedy.set("search", "climb").succeed();
    let greedy = json_file(&out.join("greedy.json"));
    assert_eq!(greedy["results"].as_array().unwrap().len(), 2);
    let searches = greedy["searches"].as_array().unwrap();
    assert_eq!(searches.len(), 2);
    for search in searches {
        assert_eq!(search["drives"][0]["level"], 0);
    }
    let out = folder.path().join("study");
    let study = tiny_study(&out).set("roads", 1).set("perturbations", names).set("levels", "4,0,4");
    study.set("search", "all").succeed();
    let ranking = json_file(&out.join("ranking.json"));
    let counts: Vec<_> =
        ranking["ranking"].as_array().unwrap().iter().map(|entry| entry["drives"].clone()).collect();
    assert_eq!(counts, [2, 2]);
    for (setting, value) in [("levels", "[]"), ("roads", "0")] {
        for script in ["greedy.lua", "study.lua"] {
            let out = folder.path().join(format!("{script}-{setting}"));
            tiny(script, &out).set(setting, value).fail(1, &[setting]);
        }
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn an_error_of_a_component_is_not_a_failure_of_the_driver() {
    let folder = temp();
    let source =
        "return { doc = 'breaks', apply = function(_, cx) if cx.time > 0.3 then error('broken') end end }";
    fs::write(folder.path().join("breaks.lua"), source).unwrap();
    let run = |script: &str| {
        let out = folder.path().join(script);
        let run = if script == "study.lua" { tiny_study(&out) } else { tiny(script, &out) };
        let run = run.set("perturbations", "breaks,contrast").set("roads", 1);
        // What a component breaks is reported at the end.
        run.arg("--plugins").arg(folder.path()).fail(1, &["breaks"]);
        out
    };
    let greedy = json_file(&run("greedy.lua").join("greedy.json"));
    let breaks = &greedy["results"][0];
    assert_eq!((&breaks["errors"], breaks.get("failing_level")), (&json!(1), None), "{breaks}");
    assert_eq!(
        greedy["searches"][0]["drives"],
        json!([]),
        "an error is not a drive, and the search goes no further"
    );
    let ranking = json_file(&run("study.lua").join("ranking.json"));
    assert_eq!(ranking["not_driven"], json!(["breaks"]));
    let entries = ranking["ranking"].as_array().unwrap();
    assert_eq!((entries.len(), &entries[0]["perturbation"]), (1, &json!("contrast")));
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_study_ranks_by_failures() {
    let folder = temp();
    let outs = ["a", "b"].map(|name| folder.path().join(name));
    for (out, workers) in outs.iter().zip([2, 1]) {
        let study = tiny_study(out).set("perturbations", "contrast,translate_image,splatter_mapping");
        study.set("search", "all").set("roads", 1).set("repeats", 2).set("workers", workers).succeed();
    }
    let read = |out: &Path| fs::read_to_string(out.join("ranking.json")).unwrap();
    assert_eq!(read(&outs[0]), read(&outs[1]));

    let outcomes = json_lines(&outs[0].join("scenarios.jsonl"));
    let ranking = json_file(&outs[0].join("ranking.json"));
    let entries = ranking["ranking"].as_array().unwrap();
    assert_eq!(entries.len(), 3);
    let shares: Vec<f64> = entries.iter().map(|entry| entry["failed_share"].as_f64().unwrap()).collect();
    assert!(shares.is_sorted_by(|a, b| a >= b) && shares[0] > 0.0, "{shares:?}");
    for entry in entries {
        // The share on each road, here on one.
        assert_eq!(entry["shares"], json!([entry["failed_share"]]));
        let name = entry["perturbation"].as_str().unwrap();
        // Where discs sit is drawn, so it is driven twice at each of the two levels; the others draw nothing.
        let each = if name == "splatter_mapping" { 2 } else { 1 };
        let of_entry: Vec<&Value> = outcomes
            .iter()
            .filter(|outcome| outcome["name"].as_str().unwrap().starts_with(&format!("{name}@")))
            .collect();
        let failed = of_entry.iter().filter(|outcome| outcome["success"] == false).count();
        assert_eq!(of_entry.len(), 2 * each);
        assert_eq!((&entry["drives"], &entry["failures"]), (&json!(of_entry.len()), &json!(failed)));
        assert_eq!(
            ["unsafe", "stopped", "late"].map(|name| entry[name].as_u64().unwrap()).iter().sum::<u64>(),
            failed as u64
        );
        for by_level in entry["cells"][0]["by_level"].as_array().unwrap() {
            let name = format!("{name}@{}, ", by_level["level"]);
            let of_level =
                of_entry.iter().filter(|outcome| outcome["name"].as_str().unwrap().starts_with(&name));
            let failed = of_level.filter(|outcome| outcome["success"] == false).count();
            assert_eq!(by_level["failed_share"].as_f64().unwrap(), failed as f64 / each as f64);
        }
        let number = |field: &str| entry[field].as_f64().unwrap();
        let share = failed as f64 / of_entry.len() as f64;
        assert_eq!(number("failed_share"), share);
        assert!(number("failed_share_low") <= share && share <= number("failed_share_high"));
        let at_highest: Vec<f64> = of_entry
            .iter()
            .filter(|outcome| outcome["name"].as_str().unwrap().contains("@4,"))
            .map(|outcome| match outcome["success"] == true {
                true => (outcome["max_cross_track_error"].as_f64().unwrap() / 2.0).min(1.0),
                false => 1.0,
            })
            .collect();
        assert_eq!(at_highest.len(), each);
        let closeness = at_highest.iter().sum::<f64>() / each as f64;
        assert!((number("closeness") - closeness).abs() < 1e-12, "{closeness} of {entry}");
        let increases: Vec<f64> = of_entry
            .iter()
            .filter(|outcome| outcome["success"] == true && outcome["name"].as_str().unwrap().contains("@4,"))
            .map(|outcome| {
                let nominal = self::outcome(&outcomes, "nominal, road 1");
                let error = |outcome: &Value| outcome["mean_cross_track_error"].as_f64().unwrap();
                error(outcome) - error(nominal)
            })
            .collect();
        match increases.is_empty() {
            true => assert_eq!(entry.get("mean_cross_track_error_increase"), None),
            false => {
                let mean = increases.iter().sum::<f64>() / increases.len() as f64;
                assert!((number("mean_cross_track_error_increase") - mean).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn a_pipeline_saves_files_of_its_own_only() {
    let folder = temp();
    let early = r#"pdk.save("a.json", {})"#;
    let run = |name: &str, source: &str| {
        let place = folder.path().join(name);
        fs::create_dir(&place).unwrap();
        Pdk::new(["run", "--out"]).arg(place.join("record")).arg(pipeline(&place, source)).misbehave()
    };
    run("early", early).fail(1, &["pdk.save has to come after the first pdk.drive"]);
    let drive = r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {} } })"#;
    run("own", &format!("{drive}\npdk.save('manifest.json', 1)")).fail(1, &["a file of the record itself"]);
    run("good", &format!("{drive}\npdk.save('a.json', {{ b = 1, a = {{ 2 }} }})")).succeed();
    assert_eq!(json_file(&folder.path().join("good/record/a.json")), json!({"a": [2], "b": 1}));
}

#[test]
fn the_ranking_that_comes_along_is_of_the_default_set() {
    let ranking = json_file(&repository().join("scripts/ranking.json"));
    let entries = ranking["ranking"].as_array().unwrap();
    let mut ranked: Vec<&str> = entries.iter().map(|entry| entry["perturbation"].as_str().unwrap()).collect();
    ranked.sort_unstable();
    let listed = Pdk::new(["list", "--json"]).succeed().json();
    let default = |component: &&Value| {
        component["description"]["kind"] == "perturbation" && component["description"]["default"] == true
    };
    let mut names: Vec<&str> = listed
        .as_array()
        .unwrap()
        .iter()
        .filter(default)
        .map(|c| c["description"]["name"].as_str().unwrap())
        .collect();
    names.sort_unstable();
    assert_eq!(ranked, names, "measure it anew: pdk run study");
    let shares: Vec<f64> = entries.iter().map(|entry| entry["failed_share"].as_f64().unwrap()).collect();
    assert!(shares.is_sorted_by(|a, b| a >= b));
    assert!(
        entries.iter().all(|entry| entry["drives"].as_u64().unwrap() >= 48),
        "four drivers in three conditions"
    );
}

#[test]
fn a_pipeline_has_the_statistics_of_the_report() {
    let folder = temp();
    let source = r#"
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {} } })
        local never, always, roads = {}, {}, {}
        for road = 1, 10 do
            never[road], always[road] = { false }, { true, true }
            local trials = {}
            local level = pdk.next_level(trials, { resolution = 0.5 })
            while level do
                table.insert(trials, { level = level, failed = level > 1.6 + road / 20 })
                level = pdk.next_level(trials, { resolution = 0.5 })
            end
            roads[road] = { trials }
        end
        local ones, zeros = table.create(10, 1), table.create(10, 0)
        -- 49 perturbations that are all alike, each with shares of five levels on eight roads.
        local alike, state = {}, 1
        for entry = 1, 49 do
            alike[entry] = {}
            for road = 1, 8 do
                state = state * 16807 % 2147483647
                alike[entry][road] = (state // 1000 % 6) / 5
            end
        end
        local function sum(shares)
            local all = 0
            for _, share in shares do
                all += share
            end
            return all
        end
        table.sort(alike, function(a, b) return sum(a) > sum(b) end)
        pdk.save("told.json", {
            never = pdk.failed_share(never),
            always = pdk.failed_share(always, 0.9),
            mean = pdk.mean({ 1, 2, 3 }),
            paired = pdk.compare(ones, zeros),
            groups = pdk.groups({ ones, zeros, zeros }),
            alike = pdk.groups(alike),
            level = pdk.failing_level(roads),
            noise = pdk.draws("gaussian_noise"),
            contrast = pdk.draws("contrast"),
        })
    "#;
    let out = folder.path().join("record");
    let run = |source: &str, out: &Path| {
        Pdk::new(["run", "--out"]).arg(out).arg(pipeline(folder.path(), source)).misbehave()
    };
    run(source, &out).succeed();
    let told = json_file(&out.join("told.json"));
    let number = |value: &Value| value.as_f64().unwrap();
    // "0 of 10" is at most 28 %.
    assert!((number(&told["never"]["high"]) - 0.2775).abs() < 1e-4, "{told}");
    assert!(told["always"]["value"] == 1 && number(&told["always"]["low"]) > 0.7);
    assert_eq!(told["mean"]["value"], 2);
    assert_eq!((&told["paired"]["effect_size"], &told["paired"]["roads"]), (&json!(1), &json!(10)));
    assert_eq!(told["groups"], json!([1, 2, 2]));
    assert_eq!(told["alike"], json!(vec![1; 49]));
    // Of 1,024 ways to exchange, two are as extreme, which count half.
    assert_eq!(told["paired"]["p"], json!(1.0 / 1024.0));
    let level = number(&told["level"]["level"]);
    assert!((1.5..2.2).contains(&level) && number(&told["level"]["drives"]) < 60.0, "{told}");
    // On half of the roads it fails from 2 on, on the others from 2.5: each level between could be the one.
    assert_eq!((&told["level"]["low"], &told["level"]["high"]), (&json!(1.5), &json!(2.5)), "{told}");
    assert_eq!((&told["noise"], &told["contrast"]), (&json!(true), &json!(false)));
    for (call, said) in [
        ("pdk.failed_share({ 1 })", "pdk.failed_share: 1 is not a list"),
        ("pdk.compare({ 0.5 }, {})", "the lists have 1 and 0 entries"),
        (
            "pdk.failing_level({ { { level = 1, failed = true } } })",
            "pdk.failing_level: {\"failed\":true,\"level\":1} is not a list",
        ),
        ("pdk.draws('contrst')", "did you mean `contrast`?"),
        ("pdk.next_level({}, { lowest = 4 })", "there is nothing to look for"),
    ] {
        run(call, &folder.path().join("wrong")).fail(1, &[said]);
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn attention_compares_where_it_matters_with_where_it_does_not() {
    let folder = temp();
    let out = folder.path().join("attention");
    let run = |out: &Path| {
        tiny("attention.lua", out)
            .set("roads", 1)
            .set("every", 10)
            .set("conditions", "")
            .set("drivers", r#"["dave2"]"#)
    };
    let (names, shares) = (["gaussian_noise", "defocus_blur"], [10.0, 30.0]);
    let methods = [json!("gradient"), json!({"name": "hirescam", "sign": "positive"})];
    run(&out)
        .set("levels", "4")
        .set("perturbations", names.join(","))
        .set("shares", "10,30")
        .set("methods", json!(methods))
        .set("repeats", 2)
        .succeed();
    let found = json_file(&out.join("attention.json"));
    let entries = found["drivers"][0]["perturbations"].as_array().unwrap();
    let lines = json_lines(&out.join("scenarios.jsonl"));
    let entry = |name: &str, share: f64, method: &Value| {
        let is = |entry: &&Value| {
            entry["perturbation"] == name && entry["share"] == share && entry["method"] == *method
        };
        entries.iter().find(is).unwrap()
    };
    for (name, share, method) in names
        .iter()
        .flat_map(|name| shares.iter().flat_map(|share| methods.iter().map(|method| (*name, *share, method))))
    {
        for place in ["top", "random", "bottom"] {
            let is = |line: &&Value| {
                let applied = &line["scenario"]["perturbations"][0];
                let by = &applied["where"]["by"]["name"];
                let wanted = method.as_str().or(method["name"].as_str());
                applied["name"] == name
                    && applied["where"][place] == share
                    && (place == "random" || by.as_str() == wanted)
            };
            let driven: Vec<_> = lines.iter().filter(is).collect();
            // The blur draws nothing, but random places are drawn.
            let drives = if name == "defocus_blur" && place != "random" { 1 } else { 2 };
            let found = &entry(name, share, method)["where"][place];
            assert_eq!(
                (driven.len(), found["drives"].as_u64()),
                (drives, Some(drives as u64)),
                "{name} {place}"
            );
            let failures = driven.iter().filter(|line| line["success"] == false).count();
            assert_eq!(found["failures"], failures);
            for line in driven {
                let model = &line["scenario"]["perturbations"][0]["where"]["by"]["parameters"]["model"];
                assert_eq!(model.as_str(), (place != "random").then_some("dave2"));
            }
        }
        for pair in ["top-random", "random-bottom", "top-bottom"] {
            let compared = &entry(name, share, method)["comparisons"][pair];
            assert!(compared["failed"]["roads"].as_u64().unwrap() > 0);
        }
    }
    // Each perturbation counts the same in all together, however often it was driven.
    for place in ["top", "random", "bottom"] {
        let share = |name: &str| {
            entry(name, 10.0, &methods[0])["where"][place]["failed_share"]["value"].as_f64().unwrap()
        };
        assert!((share("all") - (share(names[0]) + share(names[1])) / 2.0).abs() < 1e-9);
    }
    run(&folder.path().join("x")).set("shares", "20,100").fail(1, &["shares has 100 percent"]);
    run(&folder.path().join("y")).set("methods", "").fail(1, &["methods is empty"]);
}
