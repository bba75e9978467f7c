//! What a search found: where tests fail, how soon that was known, and the failures that are unlike each other.

use pdk_sdk::error::Result;
use serde::Serialize;

use crate::color::LINES;
use crate::curve::{Axes, Chart, Curve, chart};
use crate::scatter::{Kind, Mark, Scatter, scatter};
use crate::text::{count, number, percent, was};
use crate::view::Search;

/// Failures in the table.
const FAILURES: usize = 30;
/// Pictures over pairs of variables and of objectives.
const PAIRS: usize = 3;

/// What the page says about a search.
#[derive(Debug, Serialize)]
pub struct Section {
    pub name: String,
    facts: Vec<(&'static str, String)>,
    /// Regions in which most tests are critical: words, critical and all tests there, their share.
    regions: Vec<(String, String, String)>,
    tree: Vec<Branch>,
    pub curves: Vec<Chart>,
    pub space: Vec<Scatter>,
    pub objectives: Vec<Scatter>,
    legend: Vec<(String, crate::color::Rgb)>,
    columns: Vec<String>,
    failures: Vec<Failure>,
    failure_note: String,
}

/// A line of the tree.
#[derive(Debug, Serialize)]
struct Branch {
    depth: usize,
    text: String,
    count: String,
    critical: bool,
}

#[derive(Debug, Serialize)]
struct Failure {
    number: u64,
    cells: Vec<String>,
    cause: String,
    replay: String,
}

/// The sentences about a search at the top of the page.
pub fn verdict(search: &Search) -> Vec<String> {
    vec![format!(
        "The search `{}` made {}: {} critical, {} of them unlike each other.",
        search.name,
        count(search.evaluations, "test"),
        was(search.critical, "test"),
        search.distinct.len()
    )]
}

/// The section about a search.
///
/// # Errors
/// If a picture cannot be drawn.
pub fn section(search: &Search) -> Result<Section> {
    let facts = vec![
        ("Strategy", search.strategy.clone()),
        ("Seed", search.seed.to_string()),
        ("Tests", search.evaluations.to_string()),
        ("Ended by", search.stopped.clone()),
        ("Asked for twice", search.duplicates.to_string()),
        ("Not evaluated", search.failures.to_string()),
    ];
    let region = |region: &crate::view::Region| {
        let share = region.critical as f64 / region.evaluations.max(1) as f64;
        (region.words.clone(), format!("{} of {}", region.critical, region.evaluations), percent(share))
    };
    let names: Vec<String> = search.variables.iter().chain(&search.objectives).cloned().collect();
    let failure = |place: &usize| {
        let test = search.tests.get(*place)?;
        let cells = test.values.iter().cloned().chain(test.objectives.iter().map(|value| number(*value)));
        Some(Failure {
            number: *place as u64,
            cells: cells.collect(),
            cause: test.cause.clone(),
            replay: test.replay.clone(),
        })
    };
    let failures: Vec<Failure> = search.distinct.iter().filter_map(failure).take(FAILURES).collect();
    let failure_note = match search.distinct.len() > failures.len() {
        true => format!(
            "{} of {} are shown; the others stand in {}.csv.",
            failures.len(),
            search.distinct.len(),
            search.name
        ),
        false => String::new(),
    };
    let kinds: Vec<Kind> = (0..search.tests.len()).map(|place| kind(search, place)).collect();
    let positions = |axis: usize, place: usize| search.tests[place].positions.get(axis).copied();
    let objectives = |axis: usize, place: usize| search.tests[place].objectives.get(axis).copied();
    Ok(Section {
        name: search.name.clone(),
        facts,
        regions: search.regions.iter().map(region).collect(),
        tree: search.tree.iter().map(branch).collect(),
        curves: curves(search)?,
        space: pictures(&search.variables, &kinds, &positions)?,
        objectives: pictures(&search.objectives, &kinds, &objectives)?,
        legend: [("test", Kind::Passed), ("critical test", Kind::Critical), ("best compromise", Kind::Best)]
            .map(|(text, kind)| (text.to_owned(), kind.color()))
            .to_vec(),
        columns: names,
        failures,
        failure_note,
    })
}

fn kind(search: &Search, place: usize) -> Kind {
    match search.tests[place].critical {
        _ if search.front.contains(&place) => Kind::Best,
        true => Kind::Critical,
        false => Kind::Passed,
    }
}

fn branch(branch: &crate::view::Branch) -> Branch {
    Branch {
        depth: branch.depth,
        text: branch.words.clone(),
        count: format!("{} of {} critical", branch.critical, branch.evaluations),
        critical: 2 * branch.critical > branch.evaluations,
    }
}

/// A picture for each of the first pairs of quantities.
fn pictures(
    names: &[String],
    kinds: &[Kind],
    value: &dyn Fn(usize, usize) -> Option<f64>,
) -> Result<Vec<Scatter>> {
    let pairs = (0..names.len()).flat_map(|a| (a + 1..names.len()).map(move |b| (a, b)));
    let picture = |(a, b): (usize, usize)| {
        let mark = |(place, kind): (usize, &Kind)| {
            Some(Mark { x: value(a, place)?, y: value(b, place)?, kind: *kind })
        };
        let marks: Vec<Mark> = kinds.iter().enumerate().filter_map(mark).collect();
        scatter(&marks, &names[a], &names[b])
    };
    pairs.take(PAIRS).map(picture).collect()
}

fn curves(search: &Search) -> Result<Vec<Chart>> {
    let last = search.convergence.last().map_or(1.0, |point| point.evaluations as f64);
    let mut charts = Vec::new();
    let mut add = |name: &str, label: &str, value: &dyn Fn(&crate::view::Reached) -> f64| -> Result<()> {
        let points: Vec<(f64, f64)> =
            search.convergence.iter().map(|point| (point.evaluations as f64, value(point))).collect();
        let top = points.iter().map(|point| point.1).fold(0.0, f64::max);
        if top > 0.0 {
            let curve =
                Curve { key: "·".into(), name: name.to_owned(), points, band: Vec::new(), color: LINES[0] };
            let axes = Axes { x: "tests", x_range: (0.0, last), y: name, top, share: false, label };
            charts.push(chart(&[curve], &axes)?);
        }
        Ok(())
    };
    add("distinct failures", "Failures unlike each other over the tests", &|point| point.distinct as f64)?;
    add("hypervolume", "Hypervolume over the tests", &|point| point.hypervolume)?;
    Ok(charts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Branch as TreeBranch, Reached, Region, Test};

    #[test]
    fn a_section_has_all_that_was_found() {
        let test = |critical: bool, x: f64| Test {
            values: vec![x.to_string(), "fog".into()],
            positions: vec![x, 1.0],
            objectives: vec![x * 2.0],
            critical,
            cause: "lane departure".into(),
            replay: "pdk replay a --scenario b".into(),
        };
        let search = Search {
            name: "search".into(),
            evaluations: 3,
            critical: 2,
            variables: vec!["level".into(), "perturbation".into()],
            objectives: vec!["error".into()],
            tests: vec![test(false, 0.0), test(true, 1.0), test(true, 2.0)],
            distinct: vec![1, 2],
            front: vec![2],
            regions: vec![Region { words: "level >= 1".into(), evaluations: 2, critical: 2 }],
            tree: vec![TreeBranch { depth: 0, words: "all".into(), evaluations: 3, critical: 2 }],
            convergence: vec![Reached { evaluations: 3, hypervolume: 1.5, distinct: 2 }],
            ..Search::default()
        };
        assert_eq!(
            verdict(&search),
            ["The search `search` made 3 tests: 2 tests were critical, 2 of them unlike each other."]
        );
        let section = section(&search).unwrap();
        assert_eq!(section.failures.len(), 2);
        assert_eq!(section.failures[0].cells, ["1", "fog", "2.00"]);
        assert_eq!((section.space.len(), section.objectives.len(), section.curves.len()), (1, 0, 2));
        assert_eq!(section.regions[0].2, "100 %");
    }
}
