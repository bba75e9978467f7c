//! All traces as flat CSV: a line for each frame that was driven, with the id of its scenario.

use std::io::Write;

use pdk_record::directory::RunDirectory;
use pdk_record::ledger::Line;
use pdk_record::trace::reader::{Owner, read_recorded};
use pdk_record::trace::step::Step;
use pdk_sdk::error::{Place, Result};

/// The columns. Those of the state have the names of the trace.
pub const COLUMNS: [&str; 22] = [
    "id",
    "number",
    "frame",
    "time",
    "x",
    "height",
    "z",
    "heading",
    "speed",
    "cross_track_error",
    "progress",
    "vehicle_ahead",
    "lane_departure",
    "collision",
    "finished",
    "steering",
    "throttle",
    "frame_hash",
    Step::OBSERVED[0],
    Step::OBSERVED[1],
    Step::APPLIED[0],
    Step::APPLIED[1],
];

/// Writes the traces of these lines, in order.
///
/// # Errors
/// If a trace is missing or damaged, or the file cannot be written.
pub fn write(directory: &RunDirectory, lines: &[Line], file: impl Write) -> Result<()> {
    let mut writer = csv::Writer::from_writer(file);
    writer.write_record(COLUMNS).map_err(std::io::Error::from)?;
    for (number, line) in lines.iter().enumerate() {
        let (steps, _) = read_recorded(&directory.trace_path(&line.id), Owner::of(line))?;
        let (id, number) = (line.id.to_string(), number.to_string());
        for step in &steps {
            writer.write_record(fields(&id, &number, step)).map_err(std::io::Error::from)?;
        }
    }
    writer.flush().place("cannot write the telemetry")
}

fn fields(id: &str, number: &str, step: &Step) -> [String; COLUMNS.len()] {
    let Step { sequence, state, control, frame_hash, observed, applied } = step;
    let finite = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
    let [x, height, z] = state.position;
    let of = |numbers: Option<[f64; 2]>| numbers.map_or_else(Default::default, |numbers| numbers.map(finite));
    let [observed_time, observed_speed] = of(*observed);
    let [applied_steering, applied_throttle] = of(applied.map(|control| control.numbers()));
    [
        id.to_owned(),
        number.to_owned(),
        sequence.to_string(),
        finite(state.time),
        finite(x),
        finite(height),
        finite(z),
        finite(state.heading),
        finite(state.speed),
        finite(state.cross_track_error),
        finite(state.progress),
        finite(state.vehicle_ahead),
        state.lane_departure.to_string(),
        state.collision.to_string(),
        state.finished.to_string(),
        finite(control.steering),
        finite(control.throttle),
        format!("{frame_hash:016x}"),
        observed_time,
        observed_speed,
        applied_steering,
        applied_throttle,
    ]
}
