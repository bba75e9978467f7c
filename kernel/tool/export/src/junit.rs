//! JUnit XML, which the services that run tests show: of the scenarios of a record, and of what else pdk decides.

use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};
use pdk_model::outcome::Verdict;
use pdk_record::ledger::Line;
use pdk_sdk::error::{Error, Result};
use serde::Serialize;

const NAME: &str = "junit.xml";

/// Test cases that belong together.
#[derive(Debug, Default)]
pub struct Cases {
    /// What made them.
    pub name: String,
    /// What they are about.
    pub suite: String,
    /// What else is known of all of them, by name.
    pub properties: Vec<(&'static str, String)>,
    /// The test cases.
    pub cases: Vec<Case>,
    /// What is said of all of them, in lines.
    pub output: String,
}

/// A test case.
#[derive(Debug, Default)]
pub struct Case {
    /// The group that it belongs to.
    pub class: String,
    /// What it is called in the group.
    pub name: String,
    /// How long it took, in seconds.
    pub time: Option<f64>,
    /// What else is known of it, by name.
    pub properties: Vec<(&'static str, String)>,
    /// What is wrong; none if it passed.
    pub wrong: Option<Wrong>,
    /// What is said of it.
    pub output: String,
}

/// Why a test case did not pass.
#[derive(Debug)]
pub struct Wrong {
    /// Whether nothing can be said, because the test itself went wrong.
    pub is_error: bool,
    /// In which way.
    pub kind: String,
    /// A clause about it.
    pub message: String,
    /// All that is said about it, in lines.
    pub text: String,
}

#[derive(Serialize)]
struct Shown {
    class: String,
    name: String,
    time: String,
    properties: Vec<(&'static str, String)>,
    wrong: Option<ShownWrong>,
    output: String,
}

#[derive(Serialize)]
struct ShownWrong {
    element: &'static str,
    kind: String,
    message: String,
    text: String,
}

/// Test cases as JUnit XML.
///
/// # Errors
/// If the file cannot be made.
pub fn render(all: &Cases) -> Result<String> {
    let count = |errors: bool| {
        all.cases
            .iter()
            .filter(|case| case.wrong.as_ref().is_some_and(|wrong| wrong.is_error == errors))
            .count()
    };
    let times: Vec<f64> = all.cases.iter().filter_map(|case| case.time).collect();
    let page = context! {
        name => written(&all.name),
        suite => written(&all.suite),
        properties => properties(&all.properties),
        failures => count(false),
        errors => count(true),
        time => time((!times.is_empty()).then(|| times.iter().sum())),
        cases => all.cases.iter().map(shown).collect::<Vec<_>>(),
        output => written(&all.output),
    };
    let place = |error: minijinja::Error| Error::new(format!("cannot make the JUnit file ({error:#})"));
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template(NAME, include_str!("template/junit.xml")).map_err(place)?;
    environment.get_template(NAME).and_then(|template| template.render(page)).map_err(place)
}

fn shown(case: &Case) -> Shown {
    let wrong = |wrong: &Wrong| ShownWrong {
        element: if wrong.is_error { "error" } else { "failure" },
        kind: written(&wrong.kind),
        message: written(&wrong.message),
        text: written(&wrong.text),
    };
    Shown {
        class: written(&case.class),
        name: written(&case.name),
        time: time(case.time),
        properties: properties(&case.properties),
        wrong: case.wrong.as_ref().map(wrong),
        output: written(&case.output),
    }
}

fn properties(all: &[(&'static str, String)]) -> Vec<(&'static str, String)> {
    all.iter().map(|(name, value)| (*name, written(value))).collect()
}

/// A time as the attribute has it, which is left out if there is none.
fn time(seconds: Option<f64>) -> String {
    seconds.map(|seconds| seconds.to_string()).unwrap_or_default()
}

/// A text without what XML 1.0 cannot hold, escaped or not.
fn written(text: &str) -> String {
    let holds = |letter: char| {
        matches!(letter, '\t' | '\n' | '\r')
            || (letter >= ' ' && !('\u{fffe}'..='\u{ffff}').contains(&letter))
    };
    text.chars().map(|letter| if holds(letter) { letter } else { '\u{fffd}' }).collect()
}

/// The scenarios of a run of this name. A driver that failed is a failure, and a component that failed an error.
///
/// # Errors
/// If the file cannot be made.
pub fn scenarios(name: &str, lines: &[Line], replay: &dyn Fn(usize) -> String) -> Result<String> {
    let case = |(number, line): (usize, &Line)| {
        let outcome = &line.outcome;
        let message = match &outcome.error {
            Some(error) => error.clone(),
            None => format!(
                "{} after {:.2} s, {:.0} % of the road; largest cross-track error {:.3} m",
                outcome.cause.text(),
                outcome.time,
                100.0 * outcome.progress,
                outcome.max_cross_track_error
            ),
        };
        let verdict = outcome.cause.verdict();
        let wrong = (verdict != Verdict::Passed).then(|| Wrong {
            is_error: verdict == Verdict::Void,
            kind: outcome.cause.text().to_owned(),
            text: format!("{message}\n{}", replay(number)),
            message,
        });
        Case {
            class: format!("{name}.{}.{}", line.scenario.simulator.name, line.scenario.driver.name),
            name: format!("{number}: {}", line.name),
            time: Some(outcome.time),
            properties: vec![("id", line.id.to_string())],
            wrong,
            output: String::new(),
        }
    };
    let cases = lines.iter().enumerate().map(case).collect();
    render(&Cases { name: name.to_owned(), suite: name.to_owned(), cases, ..Cases::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_are_counted_by_what_is_wrong_and_nothing_breaks_the_text() {
        let wrong = |is_error| Wrong {
            is_error,
            kind: "late".into(),
            message: "a < \"b\"\u{1}".into(),
            text: "one\ntwo".into(),
        };
        let case = |name: &str, wrong, time| Case { name: name.into(), wrong, time, ..Case::default() };
        let text = render(&Cases {
            name: "n".into(),
            suite: "s & t".into(),
            properties: vec![("root", "00".into())],
            cases: vec![
                case("a", Some(wrong(true)), Some(1.5)),
                case("b", Some(wrong(false)), Some(2.0)),
                case("c", None, None),
            ],
            output: "out".into(),
        })
        .unwrap();
        assert!(
            text.contains(
                "name=\"s &amp; t\" tests=\"3\" failures=\"1\" errors=\"1\" skipped=\"0\" time=\"3.5\">"
            ),
            "{text}"
        );
        assert!(
            text.contains("<error type=\"late\" message=\"a &lt; &quot;b&quot;\u{fffd}\">one\ntwo</error>"),
            "{text}"
        );
        assert!(text.contains("<testcase classname=\"\" name=\"c\">\n    </testcase>"), "{text}");
        assert!(
            text.contains("<property name=\"root\" value=\"00\"/>")
                && text.contains("<system-out>out</system-out>")
        );
    }
}
