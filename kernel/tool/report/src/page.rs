//! Puts the page together.

use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};
use pdk_sdk::error::{Error, Result};
use serde::Serialize;

use crate::closed_loop::failing::{self, TOGETHER};
use crate::text::{count, date, number, percent};
use crate::view::{Drive, DriveTimes, EvaluateTimes, Run};
use crate::{closed_loop, color, compare, offline, overview, road, search, strategies, tasks};

/// Row of the table of times.
#[derive(Debug, Serialize)]
struct DriveRow {
    steps: u64,
    workers: u64,
    frames_per_second: String,
    real_time_factor: String,
    stages: Vec<(String, String)>,
    overruns: String,
}

#[derive(Debug, Serialize)]
struct EvaluateRow {
    frames: u64,
    workers: u64,
    frames_per_second: String,
    perturbation: String,
    driver: String,
}

/// The templates by their names; the ending says what is escaped.
const TEMPLATES: [(&str, &str); 12] = [
    ("page.html", include_str!("template/page.html")),
    ("overview.html", include_str!("template/overview.html")),
    ("closed_loop.html", include_str!("template/closed_loop.html")),
    ("compare.html", include_str!("template/compare.html")),
    ("offline_compare.html", include_str!("template/offline_compare.html")),
    ("search.html", include_str!("template/search.html")),
    ("strategies.html", include_str!("template/strategies.html")),
    ("parts.html", include_str!("template/parts.html")),
    ("provenance.html", include_str!("template/provenance.html")),
    ("style.css", include_str!("template/style.css")),
    ("tasks.html", include_str!("template/tasks.html")),
    ("page.js", include_str!("template/page.js")),
];

/// Makes the page.
///
/// # Errors
/// If a picture cannot be drawn.
pub fn render(run: &Run) -> Result<String> {
    let classes = road::classes(&run.drives);
    let drives = run
        .drives
        .iter()
        .map(|drive| closed_loop::section(drive, &run.drives, &classes))
        .collect::<Result<Vec<_>>>()?;
    let scale = offline::Scale::of(&run.evaluations);
    let evaluations = run
        .evaluations
        .iter()
        .map(|evaluation| offline::section(evaluation, &scale))
        .collect::<Result<Vec<_>>>()?;
    let mut verdict = if run.drives.is_empty() { Vec::new() } else { closed_loop::verdict(&run.drives) };
    verdict.extend(offline::verdict::verdict(&run.evaluations));
    verdict.extend(run.tasks.iter().map(tasks::verdict));
    verdict.extend(run.searches.iter().flat_map(search::verdict));
    let comparisons = strategies::comparisons(&run.searches)?;
    let searches = run.searches.iter().map(search::section).collect::<Result<Vec<_>>>()?;
    if verdict.is_empty() {
        verdict.push("Nothing has been driven or evaluated yet.".to_owned());
    }
    let drive_times = run.drive_times.as_ref().map(drive_row);
    let evaluate_times: Vec<EvaluateRow> = run.evaluate_times.iter().map(evaluate_row).collect();
    let setup = &run.setup;
    let pairs: Vec<_> = compare::pairs(&run.drives)
        .into_iter()
        .filter_map(|(base, other)| compare::comparison(base, other))
        .collect();
    let offline_pairs: Vec<_> = offline::compare::pairs(&run.evaluations)
        .into_iter()
        .filter_map(|(base, other)| offline::compare::comparison(base, other))
        .collect();
    // A few drives fit into one picture, many into a table.
    let (failing, overview) = match run.drives.len() {
        0..=TOGETHER => (failing::picture(&run.drives.iter().collect::<Vec<_>>()), None),
        _ => (None, overview::overview(&run.drives)),
    };
    let scenarios = run.drives.iter().map(|drive| drive.scenarios.len()).sum();
    let page = context! {
        title => run.title,
        folder => run.folder,
        started => run.started.map(date),
        unfinished => run.unfinished,
        verdict,
        scenarios => count(scenarios, "scenario"),
        tested => tested(&run.drives),
        overview,
        drives,
        evaluations,
        tasks => run.tasks.iter().map(tasks::section).collect::<Vec<_>>(),
        comparisons,
        pairs,
        offline_pairs,
        others => run.others,
        searches,
        setup,
        drive_times,
        evaluate_times,
        colors => color::style(),
        failing,
        errors => offline::picture::picture(&run.evaluations),
    };
    let place = |error: minijinja::Error| Error::new(format!("cannot make the page ({error:#})"));
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|name| match name.ends_with(".html") {
        true => AutoEscape::Html,
        false => AutoEscape::None,
    });
    environment.set_trim_blocks(true);
    environment.set_lstrip_blocks(true);
    for (name, source) in TEMPLATES {
        environment.add_template(name, source).map_err(place)?;
    }
    environment.get_template("page.html").and_then(|template| template.render(page)).map_err(place)
}

/// The style sheet of the page, for other pages that look like it.
///
/// # Errors
/// If it cannot be made.
pub fn style() -> Result<String> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    let made =
        environment.render_str(include_str!("template/style.css"), context! { colors => color::style() });
    made.map_err(|error| Error::new(format!("cannot make the style sheet ({error:#})")))
}

/// What was driven with what: names and values, each value once.
fn tested(drives: &[Drive]) -> Vec<(String, String)> {
    let once = |name: &str, of: fn(&Drive) -> &String| {
        let mut values: Vec<&str> = Vec::new();
        for drive in drives {
            if !values.contains(&of(drive).as_str()) {
                values.push(of(drive));
            }
        }
        let plural = if values.len() > 1 { "s" } else { "" };
        (format!("{name}{plural}"), values.join(", "))
    };
    match drives {
        [] => Vec::new(),
        _ => vec![
            once("Driver", |drive| &drive.driver),
            once("Simulator", |drive| &drive.simulator),
            once("Mode", |drive| &drive.mode),
        ],
    }
}

fn drive_row(times: &DriveTimes) -> DriveRow {
    DriveRow {
        steps: times.steps,
        workers: times.workers,
        frames_per_second: format!("{:.0}", times.frames_per_second),
        real_time_factor: format!("{:.1}", times.real_time_factor),
        stages: times.stages.iter().map(|(median, p99)| (number(*median), number(*p99))).collect(),
        overruns: match (times.overruns, times.steps) {
            (0, _) => "none".to_owned(),
            (overruns, steps) => {
                format!("{overruns} ({})", percent(overruns as f64 / steps.max(1) as f64))
            }
        },
    }
}

fn evaluate_row(times: &EvaluateTimes) -> EvaluateRow {
    EvaluateRow {
        frames: times.frames,
        workers: times.workers,
        frames_per_second: format!("{:.0}", times.frames_per_second),
        perturbation: number(times.perturbation),
        driver: number(times.driver),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::*;

    const NASTY: &str = "<script>alert(\"x\")</script>&'";

    /// A run in which every text is dangerous.
    fn run() -> Run {
        let nasty = || NASTY.to_owned();
        let scenario = |index: u64, perturbation: Option<String>, verdict: Verdict| Scenario {
            index,
            name: nasty(),
            level: perturbation.as_ref().map(|_| 2.0),
            perturbation,
            road: Some(0),
            verdict,
            cause: nasty(),
            error: nasty(),
            time: 3.0,
            skipped_frames: 17,
            progress: 0.5,
            mean_error: 0.25,
            max_error: 1.5,
            road_id: nasty(),
            seed: 0,
            repeat: 0,
            measures: Some(Measures { over_line_seconds: 0.75, ..Measures::default() }),
            path: vec![Place::default(), Place { x: 1.0, z: 20.0, error: 1.0 }],
            unreadable: nasty(),
            replay: nasty(),
            clip: crate::text::address(NASTY),
            shots: match verdict {
                Verdict::Unsafe => {
                    vec![Shot { time: 1.0, raw: vec![1, 2, 3], perturbed: vec![], attention: vec![] }]
                }
                _ => vec![],
            },
        };
        Run {
            title: nasty(),
            folder: nasty(),
            started: Some(0),
            unfinished: Some(nasty()),
            setup: Setup {
                version: nasty(),
                seed: 7,
                pipeline: nasty(),
                source: nasty(),
                modules: vec![(nasty(), nasty())],
                command: nasty(),
                settings: vec![(nasty(), nasty())],
                components: vec![Component {
                    kind: nasty(),
                    name: nasty(),
                    version: 1,
                    info: nasty(),
                    file: nasty(),
                    hash: nasty(),
                }],
                files: vec![(nasty(), nasty())],
                machine: nasty(),
            },
            drives: vec![Drive {
                simulator: nasty(),
                driver_spec: None,
                driver: nasty(),
                mode: nasty(),
                roads: vec![vec![[0.0, 0.0], [0.0, 30.0]]],
                scenarios: vec![
                    scenario(0, None, Verdict::Passed),
                    scenario(1, Some(nasty()), Verdict::Unsafe),
                    scenario(2, Some(nasty()), Verdict::Void),
                ],
            }],
            evaluations: vec![Evaluation {
                number: 0,
                driver: nasty(),
                dataset: nasty(),
                frames: 1,
                bad_frames: vec![(nasty(), nasty())],
                original_error: 0.5,
                constant_error: 0.75,
                cells: [0.0, 1.0]
                    .map(|level| EvaluationCell {
                        perturbation: nasty(),
                        level,
                        error: 0.75,
                        drift: 0.25,
                        ..EvaluationCell::default()
                    })
                    .to_vec(),
                worst: vec![WorstFrame { frame: nasty(), perturbation: nasty(), ..WorstFrame::default() }],
            }],
            tasks: vec![Task {
                name: nasty(),
                numbers: vec![TaskNumber {
                    name: nasty(),
                    original: Some(0.5),
                    cells: vec![(nasty(), 1.0, 0.25)],
                }],
                bad_frames: vec![(nasty(), nasty())],
                ..Task::default()
            }],
            searches: vec![Search {
                name: nasty(),
                strategy: nasty(),
                stopped: nasty(),
                evaluations: 2,
                critical: 1,
                variables: vec![nasty(), nasty()],
                objectives: vec![nasty(), nasty()],
                tests: [false, true]
                    .map(|critical| Test {
                        values: vec![nasty(), nasty()],
                        positions: vec![0.5, 1.0],
                        objectives: vec![1.0, 2.0],
                        critical,
                        cause: nasty(),
                        replay: nasty(),
                    })
                    .to_vec(),
                distinct: vec![1],
                front: vec![0],
                regions: vec![Region { words: nasty(), evaluations: 1, critical: 1 }],
                tree: vec![
                    Branch { words: nasty(), ..Branch::default() },
                    Branch { words: nasty(), ..Branch::default() },
                ],
                convergence: vec![Reached { evaluations: 2, hypervolume: 1.0, distinct: 1 }],
                ..Search::default()
            }],
            drive_times: Some(DriveTimes {
                steps: 10,
                overruns: 5,
                stages: [(1.5, 2.5); 4],
                ..Default::default()
            }),
            evaluate_times: vec![EvaluateTimes { frames: 3, ..Default::default() }],
            others: vec![Other { folder: nasty(), unfinished: Some(nasty()), setup: Setup::default() }],
        }
    }

    /// Follows the tags and reports those that are not closed.
    fn check_tags(page: &str) {
        let void = ["meta", "img", "br", "!doctype"];
        let mut open: Vec<&str> = Vec::new();
        let mut rest = page;
        while let Some((_, after)) = rest.split_once('<') {
            let (tag, after) = after.split_once('>').expect("a tag that does not end");
            let name = tag.split(|c: char| c.is_whitespace() || c == '/').next().unwrap_or_default();
            if let Some(closed) = tag.strip_prefix('/') {
                assert_eq!(open.pop(), Some(closed.trim()), "after {open:?}");
            } else if !tag.ends_with('/') && !void.contains(&name) {
                open.push(name);
            }
            // What stands in them is not HTML.
            rest = match name {
                "script" | "style" => {
                    after.split_once("</").map_or("", |(skipped, _)| &after[skipped.len()..])
                }
                _ => after,
            };
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn whatever_stands_in_a_text_is_text() {
        let page = render(&run()).unwrap();
        assert!(!page.contains("<script>alert") && !page.contains("(\"x\")"), "a text got through");
        assert!(page.matches("&lt;script&gt;alert").count() > 25);
        assert_eq!(page.matches("<script>").count(), 1);
        check_tags(&page);
    }

    #[test]
    fn a_page_needs_nothing_besides_itself() {
        let page = render(&run()).unwrap();
        for outside in ["http", "url(", "@import", "<link", "src=\"/", "<iframe"] {
            assert!(!page.contains(outside), "{outside}");
        }
        assert!(page.contains("data:image/jpeg;base64,AQID"));
        assert_eq!(page, render(&run()).unwrap());
    }

    #[test]
    fn every_section_is_there() {
        let page = render(&run()).unwrap();
        for part in [
            "driven, and 1 failed (50\u{a0}%)",
            ">✗ 3.00 s</td>",
            ">failed</td>",
            "0.250",
            "0.75",
            "How sure this is",
            "50 %",
            "1970-01-01 00:00 UTC",
            "2.50",
            "level 2",
            "0.750",
            "5 (50 %)",
            ">17</td>",
        ] {
            assert!(page.contains(part), "{part}");
        }
    }

    #[test]
    fn an_empty_run_has_a_page() {
        let page = render(&Run { title: "x".into(), ..Run::default() }).unwrap();
        assert!(page.contains("Nothing has been driven or evaluated yet."));
        check_tags(&page);
    }
}
