//! The documents are true: what is generated is up to date, and what they point to is there.

use std::path::Path;

use pdk_model::described;
use pdk_model::outcome::{Measures, Outcome};
use pdk_model::scenario::Scenario;
use pdk_preview::modifiers;
use pdk_tests::{Pdk, repository, temp};

#[test]
fn the_reference_is_up_to_date() {
    let folder = repository().join("docs/reference");
    Pdk::new(["reference", "--check"]).arg(&folder).succeed();
}

/// The tables in documents that are written from descriptions: the document, the name of the table, and what it is.
fn tables() -> [(&'static str, &'static str, String); 4] {
    [
        ("docs/guide/perturb.md", "modifiers", modifiers::markdown()),
        ("docs/record.md", "scenario", described::markdown(Scenario::FIELDS)),
        ("docs/record.md", "outcome", described::markdown(Outcome::FIELDS)),
        ("docs/record.md", "measures", described::markdown(Measures::FIELDS)),
    ]
}

/// `PDK_BLESS=1` writes the tables anew.
#[test]
fn the_tables_in_the_documents_are_up_to_date() {
    for (document, name, expected) in tables() {
        let file = repository().join(document);
        let text = std::fs::read_to_string(&file).unwrap();
        let marks = [format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->")];
        let place = |mark: &String| text.find(mark).unwrap_or_else(|| panic!("{document}: no {mark}"));
        let [start, end] = [place(&marks[0]) + marks[0].len(), place(&marks[1])];
        if std::env::var_os("PDK_BLESS").is_some() {
            std::fs::write(&file, format!("{}{expected}{}", &text[..start], &text[end..])).unwrap();
        } else {
            let stale = format!("the table of the {name} in {document} is stale; run this with PDK_BLESS=1");
            assert_eq!(&text[start..end], expected, "{stale}");
        }
    }
}

#[test]
fn every_perturbation_has_its_picture() {
    let folder = repository().join("docs/reference");
    for page in std::fs::read_dir(&folder).unwrap() {
        check_links(&page.unwrap().path());
    }
}

#[test]
fn what_the_documents_point_to_is_there() {
    for name in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md"] {
        check_links(&repository().join(name));
    }
    for folder in ["docs", "docs/guide", "docs/simulators"] {
        for page in std::fs::read_dir(repository().join(folder)).unwrap() {
            check_links(&page.unwrap().path());
        }
    }
    for part in std::fs::read_dir(repository().join("sdk")).unwrap() {
        let readme = part.unwrap().path().join("README.md");
        if readme.is_file() {
            check_links(&readme);
        }
    }
}

#[test]
fn every_page_is_in_the_contents_of_the_site() {
    let contents = std::fs::read_to_string(repository().join("docs/SUMMARY.md")).unwrap();
    for folder in ["docs", "docs/guide", "docs/simulators", "docs/reference"] {
        for page in std::fs::read_dir(repository().join(folder)).unwrap() {
            let name = page.unwrap().file_name().into_string().unwrap();
            let path = Path::new(folder).join(name);
            let path = path.strip_prefix("docs").unwrap();
            if path.extension().is_some_and(|ending| ending == "md") && path != Path::new("SUMMARY.md") {
                assert!(
                    contents.contains(&format!("]({})", path.display())),
                    "docs/SUMMARY.md does not name {}",
                    path.display()
                );
            }
        }
    }
}

/// The page of a crate on a package index has no other file of the repository beside it.
#[test]
fn the_pages_of_published_crates_link_to_nothing_outside_of_them() {
    let mut pages = 0;
    for part in std::fs::read_dir(repository().join("sdk")).unwrap() {
        let folder = part.unwrap().path();
        let Ok(manifest) = std::fs::read_to_string(folder.join("Cargo.toml")) else { continue };
        if manifest.contains("publish = false") {
            continue;
        }
        let page = std::fs::read_to_string(folder.join("README.md")).unwrap();
        assert!(
            !page.contains("](../"),
            "{}: README.md links to a file outside of the crate",
            folder.display()
        );
        assert!(folder.join("LICENSE").is_file(), "{} has no LICENSE", folder.display());
        pages += 1;
    }
    assert!(pages >= 12, "{pages}");
}

/// What goes wrong with simulators and with drivers in another process, and the test of each that shows what follows.
const FAULTS: [(&str, [&str; 5]); 10] = [
    (
        "not there",
        [
            "one_that_is_not_there_is_waited_for_and_said",
            "one_that_does_not_come_is_waited_for_and_said",
            "an_unsupported_server_version_is_reported",
            "one_that_is_not_there_is_waited_for_and_said",
            "a_program_that_cannot_be_started_or_does_not_come_is_reported",
        ],
    ),
    (
        "wrong port",
        [
            "another_program_at_the_port_is_reported",
            "a_port_in_use_is_reported",
            "an_unsupported_server_version_is_reported",
            "another_program_at_the_port_is_reported",
            "a_program_that_cannot_be_started_or_does_not_come_is_reported",
        ],
    ),
    (
        "wrong version",
        [
            "the_other_build_and_a_missing_scene_are_named",
            "the_other_build_is_named",
            "an_unsupported_server_version_is_reported",
            "another_version_is_reported",
            "another_version_of_the_library_is_reported",
        ],
    ),
    (
        "closes in mid-scenario",
        [
            "a_scenario_whose_simulator_is_lost_is_driven_again",
            "a_scenario_whose_simulator_is_lost_is_driven_again",
            "a_server_that_breaks_in_mid_scenario_is_reported",
            "a_scenario_whose_game_is_lost_is_driven_again",
            "one_that_fails_ends_its_scenario_with_that_cause",
        ],
    ),
    (
        "hangs",
        [
            "one_that_hangs_ends_the_run_and_keeps_what_there_is",
            "one_that_hangs_ends_the_run",
            "a_server_that_breaks_in_mid_scenario_is_reported",
            "one_that_hangs_ends_the_run",
            "one_that_fails_ends_its_scenario_with_that_cause",
        ],
    ),
    (
        "half a message",
        [
            "a_scenario_whose_simulator_is_lost_is_driven_again",
            "a_scenario_whose_simulator_is_lost_is_driven_again",
            "a_server_that_breaks_in_mid_scenario_is_reported",
            "a_scenario_whose_game_is_lost_is_driven_again",
            "one_that_fails_ends_its_scenario_with_that_cause",
        ],
    ),
    (
        "garbage",
        [
            "nonsense_is_the_outcome_of_its_scenario",
            "nonsense_is_the_outcome_of_its_scenario",
            "a_server_that_breaks_in_mid_scenario_is_reported",
            "nonsense_is_the_outcome_of_its_scenario",
            "one_that_fails_ends_its_scenario_with_that_cause",
        ],
    ),
    (
        "100 MB message",
        [
            "nonsense_is_the_outcome_of_its_scenario",
            "nonsense_is_the_outcome_of_its_scenario",
            "a_server_that_breaks_in_mid_scenario_is_reported",
            "nonsense_is_the_outcome_of_its_scenario",
            "another_version_of_the_library_is_reported",
        ],
    ),
    (
        "two clients at once",
        [
            "two_runs_do_not_share_a_simulator",
            "no_other_user_can_connect",
            "two_runs_do_not_share_a_server",
            "two_clients_at_once_do_not_meet",
            "two_at_once_are_reported",
        ],
    ),
    (
        "comes back after 5 s",
        [
            "a_scenario_whose_simulator_is_lost_is_driven_again",
            "a_scenario_whose_simulator_is_lost_is_driven_again",
            "one_that_comes_back_is_used_again",
            "one_that_comes_back_is_used_again",
            "one_that_comes_back_serves_what_follows",
        ],
    ),
];

#[test]
fn every_fault_is_tried_with_every_simulator_and_with_drivers_outside() {
    let files = ["donkey", "udacity", "carla", "beamng", "external_driver"];
    let sources = files.map(|name| {
        std::fs::read_to_string(repository().join(format!("tests/tests/simulators/{name}.rs"))).unwrap()
    });
    for (fault, tests) in FAULTS {
        for ((file, source), test) in files.iter().zip(&sources).zip(tests) {
            let attribute = source.lines().take_while(|line| *line != format!("fn {test}() {{")).last();
            let there =
                attribute.is_some_and(|line| line == "#[test]" || line.starts_with("#[ignore = \"long:"));
            assert!(there, "{fault}: tests/tests/simulators/{file}.rs has no test {test}");
        }
    }
}

/// Checks the relative links of a page of Markdown, with the headings that they lead to.
fn check_links(page: &Path) {
    let (Some(folder), true) = (page.parent(), page.extension().is_some_and(|ending| ending == "md")) else {
        return;
    };
    let text = std::fs::read_to_string(page).unwrap_or_else(|e| panic!("{}: {e}", page.display()));
    for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        if link.starts_with("http") {
            continue;
        }
        let (target, heading) = link.split_once('#').unwrap_or((link, ""));
        let file = if target.is_empty() { page.to_owned() } else { folder.join(target) };
        assert!(file.exists(), "{} points to {target}, which does not exist", page.display());
        if !heading.is_empty() {
            let there = headings(&std::fs::read_to_string(&file).unwrap());
            assert!(there.iter().any(|found| found == heading), "{}: no heading for {link}", page.display());
        }
    }
}

/// The headings of a page, as links name them.
fn headings(text: &str) -> Vec<String> {
    let mut in_code = false;
    let mut headings = Vec::new();
    for line in text.lines() {
        in_code ^= line.starts_with("```");
        if let (false, Some((hashes, heading))) = (in_code, line.split_once(' '))
            && !hashes.is_empty()
            && hashes.chars().all(|sign| sign == '#')
        {
            let kept = heading.chars().filter(|&sign| sign.is_alphanumeric() || " -_".contains(sign));
            headings.push(kept.collect::<String>().to_lowercase().replace(' ', "-"));
        }
    }
    headings
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_failures_in_the_documents_fail() {
    let folder = temp();
    // `auto` is ONNX Runtime if it is installed.
    for engine in ["pdk", "auto"] {
        for name in ["fog_filter", "grayscale_filter", "false_color_filter"] {
            let out = folder.path().join(format!("{name}-{engine}"));
            let pipeline = repository().join(format!("docs/failures/{name}.lua"));
            Pdk::new(["run", "--out"]).arg(&out).set("engine", engine).arg(pipeline).succeed();
            let lines = pdk_tests::process::json_lines(&out.join("scenarios.jsonl"));
            let line = &lines[0];
            assert_eq!(line["cause"], "lane_departure", "{line}");
            // Not at the last moment, so that it does not hang by the last digits of a processor.
            let limit = line["scenario"]["duration"].as_f64().unwrap();
            assert!(line["time"].as_f64().unwrap() < 0.8 * limit, "{line}");
        }
    }
}
