//! A verdict for people and for other programs: a table, Markdown for a pull request, JUnit XML.

use std::fmt::Write;

use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};
use pdk_notice::printable;
use pdk_sdk::error::{Error, Result};
use pdk_terminal::shell;
use pdk_terminal::table::{Cell, CellAlignment, Table, table};
use serde::Serialize;

use crate::gate::{Judged, NewFailure};
use crate::judge::{Finding, State};

/// The columns of the table of requirements.
const HEADER: [&str; 7] =
    ["requirement", "state", "scenarios", "old fails", "new fails", "difference", "found"];
/// New failures that a table names; the others are in the verdict.
const MOST: usize = 20;

/// The command that repeats a drive.
pub fn replay(failure: &NewFailure) -> String {
    shell::replay(&failure.record, failure.id)
}

/// The cells of a row after the name of the requirement.
fn cells(finding: &Finding) -> [String; 6] {
    let share = |failed: usize| match finding.scenarios {
        0 => String::new(),
        all => format!("{failed} ({:.0} %)", 100.0 * failed as f64 / all as f64),
    };
    let difference =
        finding.test.map(|test| format!("{:+.2} ({:+.2} to {:+.2})", test.difference, test.low, test.high));
    [
        finding.state.text().to_owned(),
        finding.scenarios.to_string(),
        share(finding.old_failed),
        share(finding.new_failed),
        difference.unwrap_or_default(),
        finding.said.clone(),
    ]
}

/// The requirements as a table for the terminal.
pub fn requirements(judged: &Judged) -> Table {
    let mut shown = table(HEADER);
    for finding in &judged.verdict.decision.findings {
        let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        let [state, scenarios, old, new, difference, said] = cells(finding);
        shown.add_row([
            Cell::new(printable(&finding.requirement)),
            Cell::new(state),
            right(scenarios),
            right(old),
            right(new),
            Cell::new(difference),
            Cell::new(said),
        ]);
    }
    shown
}

/// The decision in a sentence.
pub fn headline(judged: &Judged) -> String {
    let verdict = &judged.verdict;
    let word = if verdict.decision.passed { "passed" } else { "failed" };
    let (driven, budget) = judged.drives;
    format!(
        "{word}: {} against {} in suite {} version {}, decided after {driven} of at most {budget} drives",
        verdict.new.named, verdict.old.named, verdict.suite.name, verdict.suite.version
    )
}

/// What the numbers in brackets are, in a sentence.
pub fn explanation(judged: &Judged) -> Option<String> {
    let tests: Vec<_> = judged.verdict.decision.findings.iter().filter_map(|finding| finding.test).collect();
    let alpha = tests.first()?.alpha;
    let together = match tests.len() {
        1 => String::new(),
        count => format!("; {count} tests share an error of {:.3}", alpha * count as f64),
    };
    Some(format!(
        "difference: failure rate of the new driver less that of the old one, with bounds that each hold with {:.1} % whenever one stops{together}",
        100.0 * (1.0 - alpha)
    ))
}

/// A line for each new failure.
pub fn failures(judged: &Judged) -> Vec<String> {
    let line = |failure: &NewFailure| {
        let NewFailure { title, cause, time, clip, .. } = failure;
        let clip = clip.as_ref().map(|clip| format!("\n  {}", clip.display())).unwrap_or_default();
        format!("{title}: {} after {time:.2} s\n  {}{clip}", cause.text(), replay(failure))
    };
    let mut lines: Vec<String> = judged.failures.iter().take(MOST).map(line).collect();
    if let Some(more) = judged.failures.len().checked_sub(MOST).filter(|more| *more > 0) {
        lines.push(format!("and {more} more"));
    }
    lines
}

/// A text in a cell of Markdown.
fn cell(text: &str) -> String {
    let mut escaped = String::new();
    for c in printable(text).chars() {
        match c {
            '|' | '\\' | '`' | '*' | '_' | '<' | '>' | '[' | ']' => escaped.extend(['\\', c]),
            c => escaped.push(c),
        }
    }
    escaped
}

/// The verdict as Markdown.
pub fn markdown(judged: &Judged) -> String {
    let mark = if judged.verdict.decision.passed { "✅" } else { "❌" };
    let mut text = format!("### {mark} pdk gate {}\n\n", cell(&headline(judged)));
    let row = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    text += &row(&HEADER.map(str::to_owned));
    text += &format!("|{}\n", "---|".repeat(HEADER.len()));
    for finding in &judged.verdict.decision.findings {
        let mut all = vec![cell(&finding.requirement)];
        all.extend(cells(finding).iter().map(|text| cell(text)));
        text += &row(&all);
    }
    if let Some(sentence) = explanation(judged) {
        // Writing to a string does not fail.
        let _ = write!(text, "\n{}\n", cell(&sentence));
    }
    if !judged.failures.is_empty() {
        let _ = write!(text, "\n<details><summary>New failures: {}</summary>\n\n", judged.failures.len());
        for failure in &judged.failures {
            let NewFailure { title, cause, time, clip, .. } = failure;
            let clip = clip.as_ref().map(|clip| format!(", clip {}", cell(&clip.to_string_lossy())));
            let _ = writeln!(
                text,
                "- {}: {} after {time:.2} s{}",
                cell(title),
                cause.text(),
                clip.unwrap_or_default()
            );
            let _ = writeln!(text, "  ```sh\n  {}\n  ```", printable(&replay(failure)));
        }
        text += "\n</details>\n";
    }
    let _ = write!(text, "\nVerdict: `{}`\n", judged.verdict.root);
    text
}

/// A requirement in JUnit.
#[derive(Serialize)]
struct Case {
    requirement: String,
    failed: bool,
    state: &'static str,
    said: String,
    figures: String,
}

/// The verdict as JUnit XML: a test case for each requirement.
///
/// # Errors
/// If the template is not right.
pub fn junit(judged: &Judged) -> Result<String> {
    let verdict = &judged.verdict;
    let case = |finding: &Finding| {
        let [_, scenarios, old, new, difference, said] = cells(finding);
        let difference =
            if difference.is_empty() { difference } else { format!(", difference {difference}") };
        Case {
            requirement: printable(&finding.requirement).into_owned(),
            failed: match finding.state {
                State::Met => false,
                State::NotMet => true,
                // As the suite says.
                State::Undecided => !verdict.decision.passed,
            },
            state: finding.state.text(),
            figures: format!("{said}: {scenarios} scenarios, old fails {old}, new fails {new}{difference}"),
            said,
        }
    };
    let cases: Vec<Case> = verdict.decision.findings.iter().map(case).collect();
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    let place = |error: minijinja::Error| Error::new(format!("cannot make the JUnit file ({error:#})"));
    environment.add_template("junit.xml", include_str!("template/junit.xml")).map_err(place)?;
    let template = environment.get_template("junit.xml").map_err(place)?;
    let lines = failures(judged);
    let output = match lines.is_empty() {
        true => headline(judged),
        false => format!("{}\nNew failures:\n{}", headline(judged), lines.join("\n")),
    };
    let properties = [
        ("old", &verdict.old.named),
        ("new", &verdict.new.named),
        ("suite", &verdict.suite.blake3),
        ("root", &verdict.root),
    ];
    template
        .render(context! {
            suite => format!("{} {}", verdict.suite.name, verdict.suite.version),
            class => verdict.suite.name,
            failures => cases.iter().filter(|case| case.failed).count(),
            properties => properties.map(|(name, value)| (name, printable(value).into_owned())),
            output => output.lines().map(|line| printable(line).into_owned()).collect::<Vec<_>>().join("\n"),
            cases,
        })
        .map_err(place)
}

/// The verdict with its new failures, as JSON for a program.
///
/// # Errors
/// If it cannot be JSON.
pub fn json(judged: &Judged) -> Result<serde_json::Value> {
    let mut failures = Vec::with_capacity(judged.failures.len());
    for failure in &judged.failures {
        let mut value = serde_json::to_value(failure)?;
        value["replay"] = replay(failure).into();
        failures.push(value);
    }
    Ok(serde_json::json!({
        "passed": judged.verdict.decision.passed,
        "record": judged.record,
        "drives": judged.drives.0,
        "budget": judged.drives.1,
        "new_failures": failures,
        "verdict": judged.verdict,
    }))
}
