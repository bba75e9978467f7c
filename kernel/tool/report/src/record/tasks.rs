//! Reads what evaluations of predictors came to: the summary has it, because a metric is over all pictures.

use pdk_record::directory::SUMMARY;
use pdk_sdk::error::{Place, Result};
use serde::Deserialize;
use serde_json::Value;

use crate::view::{Task, TaskNumber};

#[derive(Deserialize)]
struct Summary {
    evaluation: u64,
    task: String,
    frames: usize,
    bad_frames: Vec<Bad>,
    original: Vec<Total>,
    rows: Vec<Row>,
}

#[derive(Deserialize)]
struct Bad {
    frame: String,
    error: String,
}

#[derive(Deserialize)]
struct Row {
    label: String,
    level: f64,
    totals: Vec<Total>,
}

#[derive(Deserialize)]
struct Total {
    name: String,
    value: Option<f64>,
}

/// The evaluations of predictors in a summary, in order.
///
/// # Errors
/// If one is damaged.
pub fn read(summary: &Value) -> Result<Vec<Task>> {
    let evaluations = summary["evaluations"].as_array().into_iter().flatten();
    evaluations
        .filter(|evaluation| evaluation.get("task").is_some())
        .map(|evaluation| Ok(task(Summary::deserialize(evaluation).place(SUMMARY)?)))
        .collect()
}

fn task(summary: Summary) -> Task {
    let Summary { evaluation, task, frames, bad_frames, original, rows } = summary;
    let numbers = original.into_iter().map(|Total { name, value }| {
        let of_row = |row: &Row| {
            let value = row.totals.iter().find(|total| total.name == name)?.value?;
            Some((row.label.clone(), row.level, value))
        };
        let cells = rows.iter().filter_map(of_row).collect();
        TaskNumber { name, original: value, cells }
    });
    Task {
        number: evaluation,
        name: task,
        frames,
        numbers: numbers.collect(),
        bad_frames: bad_frames.into_iter().map(|Bad { frame, error }| (frame, error)).collect(),
    }
}
