//! What the documents print is what happens, and figures that stand in several places are the same.

use std::fs;

use pdk_tests::process::{json_file, pipeline};
use pdk_tests::{Pdk, repository, temp};

fn read(file: &str) -> String {
    fs::read_to_string(repository().join(file)).unwrap()
}

/// The text between a mark and the next one after it.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let start = text.find(from).unwrap_or_else(|| panic!("there is no {from:?}")) + from.len();
    let length = text[start..].find(to).unwrap_or_else(|| panic!("nothing ends {from:?}"));
    &text[start..start + length]
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_readme_shows_what_the_quickstart_prints() {
    let folder = temp();
    let ran = Pdk::new(["run", "quickstart", "--out"]).arg(folder.path().join("record")).succeed();
    let shown =
        between(&read("README.md"), "target/release/pdk run quickstart\n```\n\n```\n", "\n```\n").to_owned();
    // How fast it was is another matter. The README shows the table as a terminal does, with lines around its cells.
    let outcomes = |text: &str| {
        let lines = text.lines().take_while(|line| !line.contains(" frames in "));
        let of_text = lines.filter(|line| !line.starts_with(['┌', '╞', '└']));
        of_text
            .map(|line| line.replace(['│', '┆'], "  ").split_whitespace().collect::<Vec<_>>().join(" "))
            .collect::<Vec<_>>()
    };
    let (mut shown, printed) = (outcomes(&shown), outcomes(&ran.stdout));
    assert!(shown.len() > 14, "{shown:?}");
    // What the pipeline itself says goes to standard error.
    let said = shown.pop().unwrap();
    assert!(ran.stderr.contains(&said), "README.md shows {said:?}, but it says {}", ran.stderr);
    assert_eq!(shown, printed, "README.md shows another outcome of the quickstart");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_guide_shows_what_its_sessions_find() {
    for name in ["docs/guide/pipelines.md", "docs/guide/statistics.md"] {
        let page = read(name);
        let source = between(&page, "```lua\nlocal session", "```\n");
        let shown = between(&page[page.find("local session").unwrap()..], "```\n\n```\n", "\n```\n");
        let folder = temp();
        let script = pipeline(folder.path(), &format!("local session{source}"));
        let ran = Pdk::new(["run", "--out"]).arg(folder.path().join("record")).arg(script).succeed();
        assert!(ran.stderr.contains(shown), "{name} shows {shown:?}, but it prints {}", ran.stderr);
    }
}

#[test]
fn the_page_of_what_breaks_drivers_has_the_order_of_the_ranking() {
    let ranking = json_file(&repository().join("scripts/ranking.json"));
    let ranking: Vec<&serde_json::Value> = ranking["ranking"].as_array().unwrap().iter().collect();
    let name = |entry: &serde_json::Value| entry["perturbation"].as_str().unwrap().to_owned();
    let page = read("docs/breaks.md");
    let table = between(&page, "<!-- ranking -->\n", "<!-- end of ranking -->");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    let breaking: Vec<_> = ranking.iter().filter(|entry| entry["failures"] != 0).collect();
    assert_eq!(rows.len(), breaking.len());
    for (row, entry) in rows.iter().zip(breaking) {
        assert_eq!(
            (row[1], row[2]),
            (entry["group"].to_string().as_str(), format!("`{}`", name(entry)).as_str())
        );
        let share = entry["failed_share"].as_f64().unwrap();
        let told = if share < 0.005 { "< 1 %".to_owned() } else { format!("{:.0} %", 100.0 * share) };
        assert_eq!(row[3], told, "{}", name(entry));
        assert_eq!(
            row[5],
            format!("{}, {} of {}", entry["stopped"], entry["late"], entry["failures"]),
            "{}",
            name(entry)
        );
    }

    let script = read("scripts/search.lua");
    let listed: Vec<&str> =
        between(&script, "\tperturbations = {\n", "\n\t},").split('"').skip(1).step_by(2).collect();
    let weakest_first: Vec<String> = ranking
        .iter()
        .rev()
        .map(|entry| name(entry))
        .filter(|name| listed.contains(&name.as_str()))
        .collect();
    assert_eq!(listed, weakest_first, "scripts/search.lua has another order than scripts/ranking.json");
}
