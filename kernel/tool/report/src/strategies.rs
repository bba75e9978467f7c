//! Compares the strategies of searches in the same setting: what each found, with the spread over searches, and how sure a difference is.

use pdk_sdk::error::Result;
use pdk_statistics::independent;
use serde::Serialize;

use crate::color::LINES;
use crate::curve::{Axes, Chart, Curve, chart};
use crate::text::{number, p_value, short};
use crate::view::{Reached, Search};

/// What the page says about several searches in the same setting.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// What was searched, as pairs of a name and a text.
    facts: Vec<(String, String)>,
    /// Names of the measures.
    columns: Vec<&'static str>,
    rows: Vec<Row>,
    curves: Vec<Chart>,
    /// The strategy that the others are compared with.
    against: String,
    /// Whether hypervolumes can be compared.
    has_reference: bool,
}

/// A strategy.
#[derive(Debug, Serialize)]
struct Row {
    strategy: String,
    searches: usize,
    /// Of each measure the median with the least and the greatest value, and the comparison with the first strategy.
    cells: Vec<(String, String)>,
}

/// What is drawn over the tests: the name of the axis, the title, and its value.
type Progress<'a> = (&'a str, &'a str, fn(&Reached) -> f64);

/// A number of a search.
struct Measure {
    name: &'static str,
    of: fn(&Search) -> f64,
}

const MEASURES: [Measure; 3] = [
    Measure { name: "critical tests", of: |search| search.critical as f64 },
    Measure { name: "unlike each other", of: |search| search.distinct.len() as f64 },
    // If none was found, one more than there were.
    Measure {
        name: "tests to the first",
        of: |search| search.first_critical.unwrap_or(search.evaluations + 1) as f64,
    },
];

/// Without a reference that was given, each search takes its own worst point, and this means nothing beside others.
const HYPERVOLUME: Measure =
    Measure { name: "hypervolume", of: |search| search.convergence.last().map_or(0.0, |at| at.hypervolume) };

/// The comparisons of a page: one for each setting in which there was more than one search.
///
/// # Errors
/// If a picture cannot be drawn.
pub fn comparisons(searches: &[Search]) -> Result<Vec<Comparison>> {
    let mut settings: Vec<Vec<&Search>> = Vec::new();
    for search in searches {
        match settings.iter_mut().find(|setting| setting[0].setting == search.setting) {
            Some(setting) => setting.push(search),
            None => settings.push(vec![search]),
        }
    }
    settings.iter().filter(|setting| setting.len() > 1).map(|setting| comparison(setting)).collect()
}

fn comparison(searches: &[&Search]) -> Result<Comparison> {
    let has_reference = searches.iter().all(|search| search.has_reference);
    let measures: Vec<&Measure> = MEASURES.iter().chain(has_reference.then_some(&HYPERVOLUME)).collect();
    let mut strategies: Vec<(&str, Vec<&Search>)> = Vec::new();
    for search in searches {
        match strategies.iter_mut().find(|(name, _)| *name == search.strategy) {
            Some((_, own)) => own.push(search),
            None => strategies.push((&search.strategy, vec![search])),
        }
    }
    // Chance is what a strategy has to be better than.
    let first = strategies.iter().position(|(_, own)| own[0].baseline).unwrap_or(0);
    let values =
        |own: &[&Search], measure: &Measure| own.iter().map(|s| (measure.of)(s)).collect::<Vec<f64>>();
    let row = |(place, (name, own)): (usize, &(&str, Vec<&Search>))| {
        let cell = |measure: &&Measure| {
            let found = values(own, measure);
            let compared = match place == first {
                true => None,
                false => independent::compare(&found, &values(&strategies[first].1, measure)),
            };
            let compared = compared.map(|c| format!("A {:.2}, p {}", c.effect_size, p_value(c.p)));
            (spread(&found), compared.unwrap_or_default())
        };
        Row { strategy: (*name).to_owned(), searches: own.len(), cells: measures.iter().map(cell).collect() }
    };
    let mut curves = Vec::new();
    let reached: [Progress<'_>; 2] = [
        ("distinct failures", "Failures unlike each other over the tests, by strategy", |at| {
            at.distinct as f64
        }),
        ("hypervolume", "Hypervolume over the tests, by strategy", |at| at.hypervolume),
    ];
    for (y, label, value) in reached.into_iter().take(if has_reference { 2 } else { 1 }) {
        curves.extend(over_tests(&strategies, y, label, value)?);
    }
    Ok(Comparison {
        facts: facts(searches),
        columns: measures.iter().map(|measure| measure.name).collect(),
        rows: strategies.iter().enumerate().map(row).collect(),
        curves,
        against: strategies[first].0.to_owned(),
        has_reference,
    })
}

/// What was searched: the same in all these searches.
fn facts(searches: &[&Search]) -> Vec<(String, String)> {
    let Some(search) = searches.first() else { return Vec::new() };
    let components = [("Simulator", &search.simulator), ("Driver", &search.driver)];
    let components = components.into_iter().filter(|(_, text)| !text.is_empty());
    let components = components.map(|(name, text)| (name.to_owned(), text.clone()));
    components.chain(search.variables.iter().cloned().zip(search.ranges.iter().cloned())).collect()
}

/// The median of each strategy over the tests, between its least and greatest value; none if all is 0.
fn over_tests(
    strategies: &[(&str, Vec<&Search>)],
    y: &str,
    label: &str,
    value: fn(&Reached) -> f64,
) -> Result<Option<Chart>> {
    let mut curves = Vec::new();
    for (place, (name, own)) in strategies.iter().enumerate() {
        // As far as all its searches came.
        let end =
            own.iter().filter_map(|search| Some(search.convergence.last()?.evaluations)).min().unwrap_or(0);
        let Some(steps) = own.first().map(|search| &search.convergence) else { continue };
        let at = |tests: usize| {
            let until = |search: &&Search| {
                search.convergence.iter().take_while(|at| at.evaluations <= tests).last().map_or(0.0, value)
            };
            let mut values: Vec<f64> = own.iter().map(until).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let steps: Vec<(f64, Vec<f64>)> = steps
            .iter()
            .filter(|step| step.evaluations <= end)
            .map(|step| (step.evaluations as f64, at(step.evaluations)))
            .collect();
        curves.push(Curve {
            key: char::from(b'a' + (place % 26) as u8).to_string(),
            name: (*name).to_owned(),
            points: steps.iter().map(|(tests, values)| (*tests, median(values))).collect(),
            band: match own.len() {
                1 => Vec::new(),
                _ => steps.iter().map(|(x, values)| (*x, values[0], values[values.len() - 1])).collect(),
            },
            color: LINES[place % LINES.len()],
        });
    }
    let highest = |curve: &Curve| {
        let points = curve.points.iter().map(|point| point.1);
        points.chain(curve.band.iter().map(|at| at.2)).fold(0.0, f64::max)
    };
    let top = curves.iter().map(highest).fold(0.0, f64::max);
    let last = curves.iter().filter_map(|curve| Some(curve.points.last()?.0)).fold(1.0, f64::max);
    if top == 0.0 {
        return Ok(None);
    }
    let axes = Axes { x: "tests", x_range: (0.0, last), y, top, share: false, label };
    chart(&curves, &axes).map(Some)
}

fn median(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[middle] } else { (sorted[middle - 1] + sorted[middle]) / 2.0 }
}

/// The median with the least and the greatest value.
fn spread(values: &[f64]) -> String {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let whole = sorted.iter().all(|value| value.fract() == 0.0);
    let shown = |value: f64| if whole { short(value) } else { number(value) };
    match sorted.len() {
        0 => String::new(),
        1 => shown(sorted[0]),
        count => format!("{} ({} to {})", shown(median(&sorted)), shown(sorted[0]), shown(sorted[count - 1])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(strategy: &str, critical: usize, first: Option<usize>) -> Search {
        Search {
            strategy: strategy.into(),
            baseline: strategy == "random",
            setting: "one".into(),
            driver: "dave2".into(),
            has_reference: true,
            variables: vec!["x".into()],
            ranges: vec!["0 to 1".into()],
            evaluations: 20,
            critical,
            distinct: (0..critical / 2).collect(),
            first_critical: first,
            convergence: [10, 20]
                .map(|evaluations| Reached {
                    evaluations,
                    hypervolume: evaluations as f64,
                    distinct: critical * evaluations / 40,
                })
                .to_vec(),
            ..Search::default()
        }
    }

    #[test]
    fn strategies_are_compared_with_chance() {
        let searches = [
            search("guided", 12, Some(3)),
            search("random", 2, None),
            search("guided", 16, Some(1)),
            search("random", 4, Some(9)),
            Search { setting: "another".into(), ..search("guided", 1, Some(1)) },
        ];
        let found = comparisons(&searches).unwrap();
        let [found] = &found[..] else { panic!("{found:?}") };
        assert_eq!(found.against, "random");
        let [guided, random] = &found.rows[..] else { panic!("{:?}", found.rows) };
        assert_eq!((guided.strategy.as_str(), guided.searches), ("guided", 2));
        assert_eq!(guided.cells[0], ("14 (12 to 16)".to_owned(), "A 1.00, p 0.245".to_owned()));
        assert_eq!(guided.cells[2].1, "A 0.00, p 0.245");
        // None was found in 20 tests.
        assert_eq!(random.cells[2], ("15 (9 to 21)".to_owned(), String::new()));
        assert_eq!(found.columns.last(), Some(&"hypervolume"));
        assert_eq!(found.curves.len(), 2);
        assert_eq!(found.curves[0].legend.len(), 2);
        let facts = [("Driver", "dave2"), ("x", "0 to 1")].map(|(name, text)| (name.into(), text.into()));
        assert_eq!(found.facts, facts);
    }

    #[test]
    fn hypervolumes_are_compared_where_a_reference_was_given() {
        let without = |strategy| Search { has_reference: false, ..search(strategy, 4, Some(1)) };
        let found = comparisons(&[without("guided"), without("random")]).unwrap();
        let [found] = &found[..] else { panic!("{found:?}") };
        assert_eq!(found.columns, ["critical tests", "unlike each other", "tests to the first"]);
        assert!(found.rows.iter().all(|row| row.cells.len() == 3));
        assert_eq!(found.curves.len(), 1);
        assert!(!found.curves[0].label.contains("Hypervolume") && !found.has_reference);
    }

    #[test]
    fn every_setting_has_a_comparison_of_its_own() {
        let of =
            |setting: &str, critical| Search { setting: setting.into(), ..search("random", critical, None) };
        let found = comparisons(&[of("a", 1), of("b", 2), of("b", 4), of("a", 3), of("c", 5)]).unwrap();
        let cells: Vec<&str> =
            found.iter().map(|comparison| comparison.rows[0].cells[0].0.as_str()).collect();
        assert_eq!(cells, ["2 (1 to 3)", "3 (2 to 4)"]);
    }
}
