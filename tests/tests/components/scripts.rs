//! Perturbations in Lua as their authors check them.

use std::path::Path;

use pdk_tests::{Finished, Pdk, repository, temp};

fn check(folder: &Path, name: &str, source: &str) -> Finished {
    let file = folder.join(name);
    std::fs::write(&file, source).unwrap();
    Pdk::new(["check"]).arg(name).folder(folder).run()
}

#[test]
fn what_comes_along_and_what_pdk_new_writes_passes() {
    for entry in std::fs::read_dir(repository().join("scripts/perturbations")).unwrap() {
        let file = entry.unwrap().path();
        let checked = Pdk::new(["check"]).arg(&file).succeed();
        assert!(!checked.stdout.contains("note"), "{}", checked.stdout);
        assert_eq!(checked.stdout.matches("ok   ").count(), 4, "{}", checked.stdout);
    }
    let folder = temp();
    Pdk::new(["new", "perturbation", "sun_visor_2", "--out"]).arg(folder.path()).succeed();
    let checked = Pdk::new(["check", "sun_visor_2.lua"]).folder(folder.path()).succeed();
    assert!(
        checked.stdout.contains("sun_visor_2.lua 1 carries perturbation `sun_visor_2`"),
        "{}",
        checked.stdout
    );
    assert!(!checked.stdout.contains("note"), "{}", checked.stdout);
}

#[test]
fn a_script_of_pdk_may_lie_beside_a_pipeline_and_a_changed_copy_is_reported() {
    let folder = temp();
    let path = |name: &str| folder.path().join(name);
    for name in ["perturbations/banding.lua", "models/dave2.onnx"] {
        std::fs::create_dir_all(path(name).parent().unwrap()).unwrap();
        std::fs::copy(repository().join("scripts").join(name), path(name)).unwrap();
    }
    std::fs::write(
        path("pipeline.lua"),
        "pdk.drive({ simulator = 'lane', driver = 'lane_keeper', duration = 0.2, scenarios = { {} } })",
    )
    .unwrap();
    let run = || Pdk::new(["run", "pipeline.lua"]).folder(folder.path()).succeed().stderr;
    assert!(!run().contains("warning"), "{}", run());
    for (name, component) in [("perturbations/banding.lua", "`banding`"), ("models/dave2.onnx", "`dave2`")] {
        let mut content = std::fs::read(path(name)).unwrap();
        content.extend_from_slice(b"\n");
        std::fs::write(path(name), content).unwrap();
        let said = run();
        assert!(said.contains(component) && said.contains("is left out") && said.contains(name), "{said}");
    }
}

#[test]
fn pipelines_that_lie_beside_are_not_run() {
    let folder = temp();
    let write = |name: &str, source: &str| std::fs::write(folder.path().join(name), source).unwrap();
    write("neighbour.lua", "print('the neighbour runs') pdk.settings({})");
    write("endless.lua", "while true do end pdk.drive({})");
    write("shared.lua", "print('the module runs') return { once = function() end }");
    write("darker.lua", "return { doc = 'Darker', apply = function(image) image:blur(3) end }");
    write("lost.lua", "local lost = { doc = 'Lost', apply = function(image) image:blur(3) end }");
    write(
        "pipeline.lua",
        "pdk.drive({ simulator = 'lane', driver = 'lane_keeper', duration = 0.2, scenarios = { { perturbations = { 'darker@2' } } } })",
    );
    let run = Pdk::new(["run", "pipeline.lua"]).folder(folder.path()).succeed();
    let listed = Pdk::new(["list", "perturbation", "--plugins", "."]).folder(folder.path()).succeed();
    for said in [&run.stderr, &listed.stderr] {
        assert!(!said.contains("runs") && !said.contains("more than"), "{said}");
    }
    assert!(listed.stdout.contains("darker"), "{}", listed.stdout);
    // What was meant as a perturbation and is not returned is reported where its folder was named.
    assert!(
        listed.stderr.contains("lost.lua: the script returns nothing, but has to return a table"),
        "{}",
        listed.stderr
    );
}

#[test]
fn names_that_a_script_misspells_are_corrected() {
    let folder = temp();
    let says = |source: &str, expected: &str| {
        std::fs::write(folder.path().join("pipeline.lua"), source).unwrap();
        Pdk::new(["run", "pipeline.lua"]).folder(folder.path()).fail(1, &[expected]);
    };
    says("pdk.drve({})", "pipeline.lua:1: pdk has no function `drve`; did you mean `drive`?");
    let drive = "local outcome = pdk.drive({ simulator = 'lane', driver = 'lane_keeper', duration = 0.2, scenarios = { {} } })[1]";
    says(
        &format!("{drive} print(outcome.sucess)"),
        "an outcome has no field `sucess`; did you mean `success`?",
    );
    // A field that says nothing is nil.
    std::fs::write(
        folder.path().join("pipeline.lua"),
        format!("{drive} assert(outcome.error == nil and outcome.cause == 'time_out')"),
    )
    .unwrap();
    Pdk::new(["run", "pipeline.lua"]).folder(folder.path()).succeed();
    let blurr =
        check(folder.path(), "blurr.lua", "return { doc = 'x', apply = function(image) image:blurr(3) end }");
    assert!(
        blurr.stdout.contains("blurr.lua:1: image has no method or field `blurr`; did you mean `blur`?"),
        "{}",
        blurr.stdout
    );
}

#[test]
fn a_pipeline_draws_the_same_numbers_everywhere() {
    let folder = temp();
    let drawn = |source: &str, seed: &str| {
        std::fs::write(folder.path().join("pipeline.lua"), source).unwrap();
        let run = Pdk::new(["run", "pipeline.lua", "--seed", seed]).folder(folder.path()).succeed();
        run.stderr.lines().next().unwrap().to_owned()
    };
    let source = "local random, list = pdk.random(7), { 'a', 'b', 'c', 'd', 'e' } random:shuffle(list) \
                  print(random:unit(), random:integer(1, 100), random:uniform(2, 4), random:normal(), random:choice(list), table.concat(list))";
    let first = drawn(source, "0");
    assert_eq!(first, drawn(source, "5"), "its seed is its own");
    assert_eq!(first, "0.0023851111393098368\t75\t2.618584614299253\t0.1869738765578938\td\tcdaeb");
    assert_ne!(drawn("print(pdk.random():unit())", "0"), drawn("print(pdk.random():unit())", "5"));
    std::fs::write(folder.path().join("pipeline.lua"), "pdk.random(-1)").unwrap();
    Pdk::new(["run", "pipeline.lua"]).folder(folder.path()).fail(1, &["pdk.random: `-1` is not a seed"]);
}

#[test]
fn what_is_kept_from_frame_to_frame_is_found_and_named() {
    let folder = temp();
    let fails = |source: &str, expected: &str| {
        let checked = check(folder.path(), "kept.lua", source);
        assert_eq!(checked.code, Some(1), "{source}: {}", checked.stdout);
        let line = checked.stdout.lines().find(|line| line.contains("alone and in a sequence")).unwrap();
        assert!(line.starts_with("FAIL") && line.contains(expected), "{source}: {line}");
    };
    fails(
        "local n = 0 return { doc = 'x', apply = function(image) n = n + 1 image:brightness(1 / n) end }",
        "frame 1 comes out differently after others than alone, because `n` (1, then 2) is kept",
    );
    fails(
        "count = 0 return { doc = 'x', apply = function(image) count += 1 image:brightness(1 / count) end }",
        "because `count` (1, then 2) is kept",
    );
    fails(
        "local state = {} return { doc = 'x', apply = function(image)
            if state.last then image:blend(state.last, 0.5) end
            state.last = image:copy()
        end }",
        "because `state.last` (its bytes) is kept",
    );
    // What stays after the first frame.
    fails(
        "local first return { doc = 'x', apply = function(image, cx)
            first = first or cx.frame_index
            image:fill(first, 0, 0)
        end }",
        "because `first` (nil, then 0) is kept",
    );
}

#[test]
fn a_cache_passes_and_what_changes_without_an_effect_is_noted() {
    let folder = temp();
    let cache = "local table, of return { doc = 'x', family = 'x', mathematics = 'x', source = 'x', apply = function(image)
        if of ~= image.width then table, of = buffer.create(256), image.width end
        image:lookup(table)
    end }";
    let checked = check(folder.path(), "cache.lua", cache);
    assert_eq!(checked.code, Some(0), "{}", checked.stdout);
    assert!(!checked.stdout.contains("note"), "{}", checked.stdout);

    let counts = "local n = 0 return { doc = 'x', apply = function(image) n = n + 1 image:grayscale() end }";
    let checked = check(folder.path(), "counts.lua", counts);
    assert_eq!(checked.code, Some(0), "{}", checked.stdout);
    assert!(
        checked.stdout.contains("note `n` (11, then 12) is kept from one frame to the next"),
        "{}",
        checked.stdout
    );
    assert!(checked.stdout.contains(
        "note `counts` does not say its `family`, `mathematics` and `source`; add them, and `pdk --plugins . show counts` shows them"
    ));
    Pdk::new(["--plugins", ".", "show", "counts"]).folder(folder.path()).succeed();
    let json = Pdk::new(["check", "--json", "counts.lua"]).folder(folder.path()).succeed().json();
    assert_eq!(json["notes"].as_array().unwrap().len(), 2, "{json}");
}

#[test]
fn the_name_of_a_script_is_answered_with_the_command_that_shows_it() {
    let folder = temp();
    let inner = folder.path().join("of mine");
    std::fs::create_dir(&inner).unwrap();
    for file in [folder.path().join("dims.lua"), inner.join("dims.lua")] {
        std::fs::write(file, "return { doc = 'x', apply = function(image) image:grayscale() end }").unwrap();
    }
    std::fs::write(folder.path().join("broken.lua"), "return {").unwrap();
    let hint = |arguments: &[&str], hint: &str| {
        Pdk::new(arguments.iter().copied()).folder(folder.path()).fail(1, &[hint]);
    };
    hint(&["show", "dims"], "for dims.lua, write `pdk --plugins . show dims`");
    hint(&["show", "dims.lua", "--json"], "for dims.lua, write `pdk --plugins . show dims --json`");
    hint(&["show", "of mine/dims"], "for 'of mine/dims.lua', write `pdk --plugins 'of mine' show dims`");
    // A folder that is searched already has a script that cannot be used.
    hint(
        &["--plugins", ".", "show", "broken"],
        "`pdk check broken.lua` reports what is wrong with broken.lua",
    );
    Pdk::new(["--plugins", "of mine", "show", "dims"]).folder(folder.path()).succeed();
    let checked = Pdk::new(["check", "of mine/dims.lua"]).folder(folder.path()).succeed();
    assert!(checked.stdout.contains("`pdk --plugins 'of mine' show dims` shows them"), "{}", checked.stdout);
}

#[test]
fn scripts_that_fail_get_a_reason() {
    let folder = temp();
    for (source, check_name, expected) in [
        ("return 1", "loading", "has to return a table"),
        (
            "return { doc = 'x', apply = function(image) image:blur(5000) end }",
            "odd sizes",
            "from 1 to 1023, but it is 5000",
        ),
        (
            "return { doc = 'x', apply = function(image) image:resized(image.width // 2, 1) end }",
            "odd sizes",
            "at 1x1 and level 0: ",
        ),
        (
            "return { doc = 'x', apply = function(image) image:fill(tonumber(string.sub(tostring({}), -6), 16) % 251, 0, 0) end }",
            // At which check two instances have tables at different addresses is up to the allocator.
            "perturbation `fails`",
            "comes out differently",
        ),
        ("return { doc = 'x', apply = function() while true do end end }", "odd sizes", "used more than"),
        (
            "pdk.settings({})",
            "loading",
            "is a pipeline, but a perturbation is expected here; run it with `pdk run",
        ),
    ] {
        let checked = check(folder.path(), "fails.lua", source);
        assert_eq!(checked.code, Some(1), "{source}: {}", checked.stdout);
        let line = checked
            .stdout
            .lines()
            .find(|line| line.starts_with("FAIL"))
            .unwrap_or_else(|| panic!("{source}"));
        assert!(line.contains(check_name) && line.contains(expected), "{source}: {line}");
    }
    let set = Pdk::new(["check", "fails.lua"]).folder(folder.path()).set("nothing.size", "1").run();
    assert_eq!(set.code, Some(1));
}

/// What `--plugins` named relative to one folder is found from another one.
#[test]
fn a_run_with_a_script_from_a_folder_is_replayed_from_anywhere() {
    let folder = temp();
    std::fs::create_dir(folder.path().join("own")).unwrap();
    let source = "return { doc = 'x', apply = function(image) image:brightness(0.9) end }";
    std::fs::write(folder.path().join("own/darker.lua"), source).unwrap();
    let pipeline = pdk_tests::process::pipeline(
        folder.path(),
        r#"pdk.drive({
            simulator = { name = "lane", width = 40, height = 30 }, driver = "lane_keeper", duration = 0.5,
            scenarios = { { perturbations = { "darker@2" } } },
        })"#,
    );
    let record = folder.path().join("record");
    Pdk::new(["run", "--plugins", "own", "--out"]).arg(&record).arg(pipeline).folder(folder.path()).succeed();
    let elsewhere = temp();
    let replayed = Pdk::new(["replay"]).arg(&record).folder(elsewhere.path()).succeed();
    assert!(replayed.stdout.contains("1 of 1 equal"), "{}", replayed.stdout);
}
