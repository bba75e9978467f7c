//! Results as tables for people.

use pdk_sdk::error::{Error, Result};
use pdk_terminal::table::{Cell, CellAlignment, Table, table};
use pdk_terminal::text::wrapped;
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
        Value::Object(summary) if summary.contains_key("task") => Ok(task_tables(result)),
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

/// What is said of an evaluation: how the driver does on the frames as they are, and tables of perturbations by levels for the error
/// against the ground truth and for the drift from the original, of steering and throttle.
fn evaluation_tables(summary: &Value) -> String {
    let rows: Vec<&Value> = summary["rows"].as_array().into_iter().flatten().collect();
    let bad = summary["bad_frames"].as_array().map_or(0, Vec::len);
    let left_out = if bad > 0 { format!(", {bad} left out") } else { String::new() };
    let sequences = match summary["sequences"].as_u64() {
        Some(1) | None => "one sequence".to_owned(),
        Some(sequences) => format!("{sequences} sequences"),
    };
    let mut parts = vec![
        format!(
            "{} frames{left_out}, in {sequences}; {}",
            summary["frames"],
            match summary["original_steering_error"].is_null() {
                true => "no steering was recorded to compare with".to_owned(),
                false => format!(
                    "mean absolute steering error on the original frames: {}",
                    with_interval(summary, "original_steering_error")
                ),
            }
        ),
        check(&summary["check"]),
    ];
    // A network that only steers has the same throttle everywhere.
    let drifts = rows.iter().any(|row| row["throttle_drift"].as_f64().is_some_and(|drift| drift > 0.0));
    for (what, error, drift) in
        [("steering", "steering_error", "steering_drift"), ("throttle", "throttle_error", "throttle_drift")]
    {
        if what == "throttle" && !drifts {
            parts.push("The throttle does not change under any perturbation.".to_owned());
            continue;
        }
        match rows.iter().all(|row| row[error].is_null()) {
            true => parts.push(format!("No {what} was recorded to compare with.")),
            false => parts.push(format!(
                "Mean absolute {what} error against the ground truth\n{}",
                grid(&rows, error, None)
            )),
        }
        let levels = (what == "steering").then_some(summary);
        parts.push(format!(
            "Mean absolute drift of the {what} from the prediction on the original frame\n{}",
            grid(&rows, drift, levels)
        ));
    }
    parts.push(
        "± reaches to the further end of the interval of 95 %, from blocks of frames that follow each other"
            .to_owned(),
    );
    parts.join("\n\n")
}

/// What is said of an evaluation of a predictor: a table of perturbations by levels for each number of its metric.
fn task_tables(summary: &Value) -> String {
    let bad = summary["bad_frames"].as_array().map_or(0, Vec::len);
    let left_out = if bad > 0 { format!(", {bad} left out") } else { String::new() };
    let originals: Vec<&Value> = summary["original"].as_array().into_iter().flatten().collect();
    let mut parts = vec![format!(
        "{} pictures{left_out}, {}",
        summary["frames"],
        summary["task"].as_str().unwrap_or_default()
    )];
    for original in originals {
        let name = original["name"].as_str().unwrap_or_default();
        // As the grid of a driver has it, with this number alone.
        let row = |row: &Value| {
            let mut totals = row["totals"].as_array().into_iter().flatten();
            let total = totals.find(|total| total["name"] == name).cloned().unwrap_or_default();
            serde_json::json!({"label": row["label"], "level": row["level"], "value": total["value"],
                "value_interval": total["interval"]})
        };
        let rows: Vec<Value> = summary["rows"].as_array().into_iter().flatten().map(row).collect();
        let shown = with_interval(
            &serde_json::json!({"value": original["value"], "value_interval": original["interval"]}),
            "value",
        );
        let shown = if shown.is_empty() { "none".to_owned() } else { shown };
        parts.push(format!(
            "{name}, without perturbation: {shown}\n{}",
            grid(&rows.iter().collect::<Vec<_>>(), "value", None)
        ));
    }
    let errors = &summary["corruption_errors"];
    if errors.is_object() {
        let percent = |value: &Value| {
            right(value.as_f64().map_or_else(String::new, |value| format!("{:.1} %", value * 100.0)))
        };
        let mut table = table(["perturbation", "error", "of the baseline", "CE", "relative CE"]);
        for row in errors["rows"].as_array().into_iter().flatten() {
            table.add_row([
                Cell::new(row["label"].as_str().unwrap_or_default()),
                percent(&row["error"]),
                percent(&row["baseline_error"]),
                percent(&row["ce"]),
                percent(&row["relative_ce"]),
            ]);
        }
        table.add_row([
            Cell::new(format!("mean (mCE, relative mCE) over {} of {}", errors["over"], errors["of"])),
            right(String::new()),
            right(String::new()),
            percent(&errors["mce"]),
            percent(&errors["relative_mce"]),
        ]);
        parts.push(format!(
            "Corruption errors, relative to {}\n{table}",
            errors["baseline"].as_str().unwrap_or_default()
        ));
    }
    parts.join("\n\n")
}

/// How a driver does on the frames as they are, beside constants.
pub fn check(check: &Value) -> String {
    let mut table = table(["on the frames as they are", "steering", "throttle"]);
    let mut add = |what: String, cells: [String; 2]| {
        table.add_row([Cell::new(what)].into_iter().chain(cells.map(right)));
    };
    let both = |of: &dyn Fn(&Value) -> String| ["steering", "throttle"].map(|name| of(&check[name]));
    // Without anything to compare with there is no constant.
    let with = |what: &str, name: &str| match ["steering", "throttle"].map(|of| number(&check[of][name], 3)) {
        numbers if numbers.iter().all(String::is_empty) => what.to_owned(),
        numbers => format!("{what} ({})", numbers.join(", ")),
    };
    let percent = |value: &Value| format!("{:.0} %", value.as_f64().unwrap_or_default() * 100.0);
    add("mean absolute error of the driver".to_owned(), both(&|of| number(&of["error"], 3)));
    add(with("... of the best constants", "constant"), both(&|of| number(&of["constant_error"], 3)));
    add(with("... of the means", "mean"), both(&|of| number(&of["mean_error"], 3)));
    add("outputs at a limit (-1 or 1)".to_owned(), both(&|of| percent(&of["at_limit"])));
    add("outputs that are the same number".to_owned(), both(&|of| percent(&of["same"])));
    add("frames without a usable output".to_owned(), [percent(&check["failed"]), String::new()]);
    let refusal = check["refusal"].as_str();
    let refusal = refusal.map_or_else(String::new, |refusal| format!("\n{}", wrapped("Warning: ", refusal)));
    format!("{table}{refusal}")
}

/// Perturbations by levels. With the summary, the last column says from which level on the tolerance is exceeded.
fn grid(rows: &[&Value], field: &str, summary: Option<&Value>) -> Table {
    let mut levels: Vec<f64> = rows.iter().filter_map(|row| row["level"].as_f64()).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut labels: Vec<&str> = Vec::new();
    for row in rows {
        let label = row["label"].as_str().unwrap_or_default();
        if !labels.contains(&label) {
            labels.push(label);
        }
    }
    let header: Vec<String> = std::iter::once("perturbation".to_owned())
        .chain(levels.iter().map(|level| format!("level {level}")))
        .chain(summary.map(|summary| format!("over {} from level", summary["tolerance"])))
        .collect();
    let mut table = table(header.iter().map(String::as_str));
    for label in &labels {
        let cell = |level: &f64| {
            let row = rows.iter().find(|row| row["label"] == **label && row["level"] == *level);
            right(row.map_or_else(String::new, |row| with_interval(row, field)))
        };
        let exceeded = summary.map(|summary| {
            let levels = summary["levels"].as_array().into_iter().flatten();
            right(levels.filter(|row| row["label"] == **label).map(exceeded).collect())
        });
        table.add_row(std::iter::once(Cell::new(label)).chain(levels.iter().map(cell)).chain(exceeded));
    }
    table
}

/// A mean with the further end of its interval.
fn with_interval(of: &Value, field: &str) -> String {
    let interval = &of[format!("{field}_interval")];
    let (Some(value), Some(low), Some(high)) =
        (of[field].as_f64(), interval["low"].as_f64(), interval["high"].as_f64())
    else {
        return number(&of[field], 3);
    };
    format!("{value:.3} ±{:.3}", (value - low).max(high - value))
}

/// From which level on a tolerance is exceeded, with the levels that are possible.
fn exceeded(row: &Value) -> String {
    let level = |name: &str| row[name].as_f64().map(|level| format!("{level:.1}"));
    match (level("level"), level("low"), level("high")) {
        (None, None, _) => "none".to_owned(),
        (None, Some(low), _) => format!("none ({low} or higher)"),
        (Some(level), Some(low), Some(high)) => format!("{level} ({low} to {high})"),
        (Some(level), low, _) => format!("{level} ({} or higher)", low.unwrap_or_else(|| level.clone())),
    }
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
        let row = |name: &str, level: f64, error: f64| {
            json!({"perturbation": "x", "label": name, "level": level, "steering_error": error, "steering_drift": 0.5,
                "steering_drift_interval": {"low": 0.25, "high": 0.625}, "throttle_drift": 0.0})
        };
        let numbers = json!({"error": 0.07, "constant": 0.25, "constant_error": 0.1, "mean": 0.5, "mean_error": 0.125,
            "at_limit": 0.1, "same": 0.2});
        let level = |name: &str, level: Value, low: Value, high: Value| json!({"label": name, "level": level, "low": low, "high": high});
        let mut summary = json!({
            "frames": 3, "sequences": 2, "bad_frames": [], "original_steering_error": 0.07, "tolerance": 0.2,
            "check": {"steering": numbers, "throttle": numbers, "failed": 0.0, "refusal": "driver `x` is lost"},
            "rows": [row("fog", 0.0, 0.1), row("fog", 1.0, 0.2), row("fog,thick=2", 0.0, 0.3)],
            "levels": [level("fog", json!(0.5), json!(0.25), Value::Null), level("fog,thick=2", Value::Null, json!(0), Value::Null)],
        });
        let text = render(&summary).unwrap();
        for part in [
            "3 frames, in 2 sequences",
            "level 0",
            "0.100",
            "0.500 ±0.250",
            "fog,thick=2",
            "over 0.2 from level",
            "0.5 (0.2 or higher)",
            "none (0.0 or higher)",
            "of the best constants (0.250, 0.250)",
            "Warning: driver `x` is lost",
            "The throttle does not change",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        summary["rows"][0]["throttle_drift"] = json!(0.125);
        let text = render(&summary).unwrap();
        assert!(text.contains("Mean absolute drift of the throttle") && text.contains("0.125"), "{text}");
    }
}
