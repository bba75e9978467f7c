//! A verdict for people and for other programs: a table, Markdown for a pull request, JUnit XML.

use std::fmt::Write;

use pdk_export::junit::{self, Case, Cases, Wrong};
use pdk_notice::printable;
use pdk_sdk::error::Result;
use pdk_terminal::shell;
use pdk_terminal::table::{Cell, CellAlignment, Table, table};

use crate::came::Ending;
use crate::gate::{Judged, NewFailure};
use crate::judge::{Finding, State};
use crate::repeats::Luck;
use crate::suite::Undecided;

/// The columns of the table of requirements.
const HEADER: [&str; 7] =
    ["requirement", "state", "scenarios", "old fails", "new fails", "difference", "found"];
/// New failures that a table names; the others are in the verdict.
const MOST: usize = 20;

/// The command that repeats a drive or a block.
pub fn replay(failure: &NewFailure) -> String {
    match failure.cause {
        Ending::Drive(_) => shell::replay(&failure.record, failure.id),
        Ending::Block(_) => {
            format!(
                "pdk verify {} --scenario {}",
                shell::quoted(&failure.record.to_string_lossy()),
                failure.id
            )
        }
    }
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
        finding.old_failed.map(share).unwrap_or_default(),
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
        "{word}: {} against {} in suite {} version {}, decided after {driven} of at most {budget} {}",
        verdict.new.named,
        verdict.old.named,
        verdict.suite.name,
        verdict.suite.version,
        verdict.unit()
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

/// What is known of drives of the same scenario that come out differently, a sentence each.
pub fn luck(judged: &Judged) -> Vec<String> {
    judged.verdict.decision.luck.as_ref().map(Luck::sentences).unwrap_or_default()
}

/// A line for each new failure.
pub fn failures(judged: &Judged) -> Vec<String> {
    let line = |failure: &NewFailure| {
        let NewFailure { title, said, clip, .. } = failure;
        let clip = clip.as_ref().map(|clip| format!("\n  {}", clip.display())).unwrap_or_default();
        format!("{title}: {said}\n  {}{clip}", replay(failure))
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
    for sentence in explanation(judged).into_iter().chain(luck(judged)) {
        // Writing to a string does not fail.
        let _ = write!(text, "\n{}\n", cell(&sentence));
    }
    if !judged.failures.is_empty() {
        let _ = write!(text, "\n<details><summary>New failures: {}</summary>\n\n", judged.failures.len());
        for failure in &judged.failures {
            let NewFailure { title, said, clip, .. } = failure;
            let clip = clip.as_ref().map(|clip| format!(", clip {}", cell(&clip.to_string_lossy())));
            let _ = writeln!(text, "- {}: {said}{}", cell(title), clip.unwrap_or_default());
            let _ = writeln!(text, "  ```sh\n  {}\n  ```", printable(&replay(failure)));
        }
        text += "\n</details>\n";
    }
    let _ = write!(text, "\nVerdict: `{}`\n", judged.verdict.root);
    text
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
        let figures = format!("{said}: {scenarios} scenarios, old fails {old}, new fails {new}{difference}");
        let failed = match finding.state {
            State::Met => false,
            State::NotMet => true,
            State::Undecided => judged.undecided == Undecided::Failed,
        };
        Case {
            class: format!("pdk.{}", verdict.suite.name),
            name: printable(&finding.requirement).into_owned(),
            wrong: failed.then(|| Wrong {
                is_error: false,
                kind: finding.state.text().to_owned(),
                message: said,
                text: figures.clone(),
            }),
            output: figures,
            ..Case::default()
        }
    };
    let mut output = vec![headline(judged)];
    output.extend(luck(judged));
    let lines = failures(judged);
    if !lines.is_empty() {
        output.push("New failures:".to_owned());
        output.extend(lines);
    }
    let known = [
        ("old", &verdict.old.named),
        ("new", &verdict.new.named),
        ("suite", &verdict.suite.blake3),
        ("root", &verdict.root),
    ];
    junit::render(&Cases {
        name: "pdk gate".to_owned(),
        suite: format!("{} {}", verdict.suite.name, verdict.suite.version),
        properties: known.map(|(name, value)| (name, printable(value).into_owned())).to_vec(),
        cases: verdict.decision.findings.iter().map(case).collect(),
        output: output.iter().flat_map(|text| text.lines()).map(printable).collect::<Vec<_>>().join("\n"),
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::outcome::Cause;
    use pdk_model::scenario::Scenario;
    use serde_json::json;

    use crate::came::Steering;

    fn failure(title: &str, cause: Ending) -> NewFailure {
        let scenario = Scenario::default();
        NewFailure {
            title: title.to_owned(),
            id: scenario.id(),
            cause,
            said: "it left the lane after 3 s".to_owned(),
            record: "runs/my gate".into(),
            clip: None,
            scenario,
        }
    }

    /// Two requirements, of which the second is in this state.
    fn judged(passed: bool, state: &str, failures: Vec<NewFailure>) -> Judged {
        let driver = |named: &str| json!({ "named": named, "component": { "name": "x" }, "files": {} });
        let verdict = json!({
            "format": 1, "pdk": "0", "suite": { "name": "small", "version": 2, "named": "small", "blake3": "ab" },
            "old": driver("old|one"), "new": driver("new_one"), "settled": [], "components": [], "entries": [], "root": "cd",
            "decision": { "passed": passed, "findings": [
                { "requirement": "not worse", "state": "met", "said": "fine", "scenarios": 8, "old_failed": 2, "new_failed": 1,
                  "test": { "difference": -0.125, "low": -0.5, "high": 0.1, "tolerated": 0.2, "alpha": 0.025 } },
                { "requirement": "no new failure", "state": state, "said": "one", "scenarios": 0, "old_failed": 0, "new_failed": 0 },
            ] },
        });
        Judged {
            verdict: serde_json::from_value(verdict).unwrap(),
            undecided: Undecided::Failed,
            failures,
            drives: (16, 40),
            known: 0,
            record: None,
            speed: Vec::new(),
            warnings: Vec::new(),
        }
    }

    #[test]
    fn a_pull_request_shows_what_was_decided_and_how_to_repeat_what_is_new() {
        let drive = failure("a*b", Ending::Drive(Cause::LaneDeparture));
        let text = markdown(&judged(false, "not_met", vec![drive.clone()]));
        let first = "### ❌ pdk gate failed: new\\_one against old\\|one in suite small version 2, decided after 16 of at most 40 drives";
        assert_eq!(text.lines().next(), Some(first));
        assert!(
            text.contains("| not worse | met | 8 | 2 (25 %) | 1 (12 %) | -0.12 (-0.50 to +0.10) | fine |"),
            "{text}"
        );
        // No share of no scenario.
        assert!(text.contains("| no new failure | not met | 0 |  |  |  | one |"), "{text}");
        assert!(text.contains("- a\\*b: it left the lane after 3 s"), "{text}");
        assert!(text.contains(&format!("pdk replay 'runs/my gate' --scenario {}", drive.id)), "{text}");
        assert!(text.ends_with("Verdict: `cd`\n"), "{text}");
        assert!(markdown(&judged(true, "met", Vec::new())).starts_with("### ✅ pdk gate passed: "));
    }

    #[test]
    fn a_block_is_repeated_by_its_verdict() {
        let block = failure("b", Ending::Block(Steering::Off));
        assert_eq!(replay(&block), format!("pdk verify 'runs/my gate' --scenario {}", block.id));
    }

    #[test]
    fn many_new_failures_are_counted() {
        let all =
            |count| failures(&judged(false, "met", vec![failure("b", Ending::Block(Steering::Off)); count]));
        assert_eq!(all(MOST).len(), MOST);
        let lines = all(MOST + 3);
        assert_eq!((lines.len(), lines.last().unwrap().as_str()), (MOST + 1, "and 3 more"));
    }

    #[test]
    fn what_is_undecided_is_a_failed_test_case_if_the_suite_says_so() {
        // Another requirement may be the reason why a gate failed.
        for (undecided, failures) in [(Undecided::Failed, 1), (Undecided::Passed, 0)] {
            let cases = junit(&Judged { undecided, ..judged(false, "undecided", Vec::new()) }).unwrap();
            assert!(cases.contains(&format!("tests=\"2\" failures=\"{failures}\"")), "{cases}");
        }
        // Each of two tests has a half of the error.
        let mut both = judged(true, "met", Vec::new());
        let findings = &mut both.verdict.decision.findings;
        findings[1].test = findings[0].test;
        let told = explanation(&both).unwrap();
        assert!(told.contains("97.5 %") && told.ends_with("2 tests share an error of 0.050"), "{told}");
    }
}
