//! What a release of pdk computes, the next one computes too: ids, digests, outcomes and messages of scenarios of all sorts are
//! compared, byte for byte, with those in `tests/golden/record`. A change of them is a change of a component's version or of a format, and made
//! on purpose: `PDK_BLESS=1` writes the files anew.

use std::fs;

use pdk_tests::{Pdk, repository, temp};

/// Every place that decides an outcome: roads, the chain with its modifiers, networks, maps, masks, memory, errors, a search.
const PIPELINE: &str = r#"
    local simulator = { name = "lane", width = 80, height = 60 }
    local bend = { angles = { 0, 20, -20 }, segment = 10 }
    local function drive(driver, scenarios)
        for _, scenario in scenarios do
            scenario.road = scenario.road or bend
        end
        pdk.drive({ simulator = simulator, driver = driver, duration = 1, images_every = 0, scenarios = scenarios })
    end
    local names = pdk.perturbations()
    table.sort(names)
    local all = {}
    for _, name in names do
        table.insert(all, { name = name, perturbations = { { name = name, level = 3 } } })
    end
    drive("lane_keeper", all)
    local where = { random = 30 }
    drive("lane_keeper", {
        { name = "nominal", road = { waypoints = { { 0, 0, 0 }, { 0, 0, 30 }, { 5, 0, 60 } } } },
        { name = "repeat", ["repeat"] = 1, perturbations = { { name = "gaussian_noise", level = 2 } } },
        { name = "chain", perturbations = { { name = "contrast", level = 1.5 }, { name = "fog_filter", level = { pulse = { level = 3, start = 0.3, duration = 0.4, period = 1 } } } } },
        { name = "modifiers", perturbations = { { name = "gaussian_noise", level = 4, probability = 0.5, where = where }, { name = "elastic", level = 4 } } },
        { name = "no such road", road = { angles = { 0, 400 } } },
    })
    drive("dave2", {
        { name = "network" },
        { name = "maps", perturbations = { { name = "false_color_filter", level = 4, where = { top = 20, by = { name = "hirescam", model = "dave2" } } } } },
    })
    drive("dave2_temporal", { { name = "memory", perturbations = { { name = "motion_blur", level = 2 } } } })
    pdk.search({
        driver = "lane_keeper", duration = 0.5, strategy = "nsga2_dt", objectives = { max_cross_track_error = "maximise" },
        space = { level = { real = { 0, 4 } }, angle = { integer = { -30, 30 } } },
        evaluate = function(values)
            return { simulator = simulator, road = { angles = { 0, values.angle }, segment = 10 }, perturbations = { { name = "contrast", level = values.level } } }
        end,
        stop = { evaluations = 8 },
    })
"#;

#[test]
fn what_was_computed_before_is_computed_again() {
    let folder = temp();
    fs::write(folder.path().join("unchanged.lua"), PIPELINE).unwrap();
    let run = Pdk::new(["run", "unchanged.lua", "--out", "record", "--workers", "2", "--keep-errors"])
        .folder(folder.path())
        .run();
    let ledger = fs::read_to_string(folder.path().join("record/scenarios.jsonl")).unwrap();
    if !ledger.contains("/x86-64-v3") {
        eprintln!("skipped: networks run on another class of processors here");
        return;
    }
    let search = fs::read_to_string(folder.path().join("record/search.csv")).unwrap();
    // What was said, but for how long it took.
    let said: String =
        run.stderr.lines().filter(|line| line.starts_with("pdk: ")).map(|line| format!("{line}\n")).collect();
    let golden = repository().join("tests/golden/record");
    for (name, found) in [("scenarios.jsonl", &ledger), ("search.csv", &search), ("said.txt", &said)] {
        let path = golden.join(name);
        if std::env::var_os("PDK_BLESS").is_some() {
            fs::create_dir_all(&golden).unwrap();
            fs::write(&path, found).unwrap();
            continue;
        }
        let expected = fs::read_to_string(&path).unwrap();
        for (number, (found, expected)) in found.lines().zip(expected.lines()).enumerate() {
            assert_eq!(found, expected, "line {} of {name}", number + 1);
        }
        assert_eq!(found.lines().count(), expected.lines().count(), "{name}");
    }
}
