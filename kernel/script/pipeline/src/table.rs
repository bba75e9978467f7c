//! Results as tables for people.

use pdk_sdk::error::{Error, Result};
use pdk_terminal::table::{Cell, CellAlignment, Table, table};
use serde_json::Value;

/// Renders what `pdk.drive` or `pdk.evaluate` returned.
///
/// # Errors
/// If it is neither.
pub fn render(result: &Value) -> Result<String> {
    match result {
        Value::Array(outcomes) if outcomes.iter().all(|outcome| outcome.get("cause").is_some()) => {
            Ok(outcome_table(table(OUTCOMES), outcomes).to_string())
        }
        Value::Object(summary) if summary.contains_key("rows") => Ok(evaluation_tables(result)),
        _ => Err(Error::new("pdk.show takes what pdk.drive or pdk.evaluate returned")),
    }
}

fn right(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

fn number(value: &Value, digits: usize) -> String {
    value.as_f64().map_or_else(String::new, |value| format!("{value:.digits$}"))
}

/// The header of a table of outcomes.
const OUTCOMES: [&str; 7] =
    ["scenario", "outcome", "time s", "road", "mean |XTE| m", "max |XTE| m", "over line s"];

/// Adds a row for each outcome.
fn outcome_table(mut table: Table, outcomes: &[Value]) -> Table {
    for outcome in outcomes {
        let cause = outcome["cause"].as_str().unwrap_or_default().replace('_', " ");
        let verdict = outcome["verdict"].as_str().unwrap_or_default();
        let mark = match verdict {
            "passed" => "ok",
            "unsafe" => "FAIL",
            "stopped" => "STOP",
            "late" => "LATE",
            _ => "",
        };
        // If a component failed, there is nothing to say about the driver.
        let cell = |text: String| right(if verdict == "void" { String::new() } else { text });
        // The mean of a part of the road is none of the road.
        let mean = match verdict {
            "passed" => number(&outcome["mean_cross_track_error"], 3),
            _ => "cut short".to_owned(),
        };
        table.add_row([
            Cell::new(outcome["name"].as_str().unwrap_or_default()),
            Cell::new(format!("{mark:<4} {cause}")),
            cell(number(&outcome["time"], 1)),
            cell(format!("{:.0} %", outcome["progress"].as_f64().unwrap_or_default() * 100.0)),
            cell(mean),
            cell(number(&outcome["max_cross_track_error"], 3)),
            cell(number(&outcome["measures"]["over_line_seconds"], 1)),
        ]);
    }
    table
}

/// Two tables, perturbations by levels: the error against the ground truth, and the drift from the original.
fn evaluation_tables(summary: &Value) -> String {
    let rows: Vec<&Value> = summary["rows"].as_array().into_iter().flatten().collect();
    let mut levels: Vec<f64> = rows.iter().filter_map(|row| row["level"].as_f64()).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut labels: Vec<&str> = Vec::new();
    for row in &rows {
        let label = row["label"].as_str().unwrap_or_default();
        if !labels.contains(&label) {
            labels.push(label);
        }
    }
    let grid = |field: &str| {
        let header: Vec<String> = levels.iter().map(|level| format!("level {level}")).collect();
        let mut table = table(std::iter::once("perturbation").chain(header.iter().map(String::as_str)));
        for label in &labels {
            let cell = |level: &f64| {
                let row = rows.iter().find(|row| row["label"] == **label && row["level"] == *level);
                right(row.map_or_else(String::new, |row| number(&row[field], 3)))
            };
            table.add_row(std::iter::once(Cell::new(label)).chain(levels.iter().map(cell)));
        }
        table
    };
    let bad = summary["bad_frames"].as_array().map_or(0, Vec::len);
    let left_out = if bad > 0 { format!(", {bad} left out") } else { String::new() };
    format!(
        "{} frames{left_out}; mean absolute steering error on the original frames: {}\n\n\
         Mean absolute steering error against the ground truth\n{}\n\n\
         Mean absolute drift of the steering from the prediction on the original frame\n{}",
        summary["frames"],
        number(&summary["original_steering_error"], 3),
        grid("steering_error"),
        grid("steering_drift")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_value_that_is_not_a_result_is_rejected() {
        assert!(render(&json!([1, 2])).is_err());
        assert!(render(&json!({"a": 1})).is_err());
    }

    #[test]
    fn a_drive_that_was_cut_short_has_no_mean() {
        let outcome = |verdict: &str, cause: &str| {
            json!({"name": "x", "cause": cause, "verdict": verdict, "time": 6.24, "progress": 0.5,
                "mean_cross_track_error": 0.123, "max_cross_track_error": 2.01, "measures": {"over_line_seconds": 1.5}})
        };
        let row = |verdict: &str, cause: &str| {
            let text = outcome_table(Table::new(OUTCOMES, true), &[outcome(verdict, cause)]).to_string();
            let row = text.lines().find(|line| line.contains(" x ")).unwrap().to_owned();
            row.split('┆').map(|cell| cell.trim_matches([' ', '│']).to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(row("passed", "finished"), ["x", "ok   finished", "6.2", "50 %", "0.123", "2.010", "1.5"]);
        assert_eq!(
            row("unsafe", "lane_departure")[1..5],
            ["FAIL lane departure", "6.2", "50 %", "cut short"]
        );
        assert_eq!(row("stopped", "no_progress")[1], "STOP no progress");
        assert_eq!(row("late", "time_out")[1], "LATE time out");
        assert_eq!(row("void", "error")[1..4], ["error", "", ""]);
    }

    #[test]
    fn an_evaluation_is_a_grid_of_perturbations_and_levels() {
        let row = |name: &str, level: f64, error: f64| json!({"perturbation": "x", "label": name, "level": level, "steering_error": error, "steering_drift": 0.5});
        let summary = json!({
            "frames": 3, "bad_frames": [], "original_steering_error": 0.07,
            "rows": [row("fog", 0.0, 0.1), row("fog", 1.0, 0.2), row("fog,thick=2", 0.0, 0.3)],
        });
        let text = render(&summary).unwrap();
        for part in ["level 0", "0.100", "0.200", "fog,thick=2", "0.300"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
