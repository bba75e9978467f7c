//! Records of runs: lines of the ledger, and what traces hold as arrays.

use std::path::{Path, PathBuf};

use numpy::{IntoPyArray, PyArray, PyArray1};
use pdk_model::outcome::Cause;
use pdk_record::directory::RunDirectory;
use pdk_record::ledger;
use pdk_record::trace::reader::{Entry, Owner, TraceReader, read_recorded};
use pdk_record::trace::step::{ImageTopic, Step};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, State};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{bytes, made};
use crate::failure::{detached, mistake, raise};

/// The lines of a record's ledger as JSON, in their order, after a look at their checksums.
#[pyfunction]
#[pyo3(name = "ledger")]
pub fn read_ledger(py: Python<'_>, record: PathBuf) -> PyResult<Vec<String>> {
    detached(py, || {
        let (lines, _) = ledger::read(&RunDirectory::open(&record)?)?;
        lines.iter().map(|line| Ok(serde_json::to_string(line)?)).collect()
    })
}

/// What the cause of an outcome says about the driver, as in pipelines.
#[pyfunction]
pub fn verdict(py: Python<'_>, cause: &str) -> PyResult<String> {
    let known = serde_json::from_value::<Cause>(cause.into());
    let known = known.map_err(|_| mistake(py, format!("`{cause}` is not the cause of an outcome")))?;
    let name = serde_json::to_value(known.verdict()).map_err(|error| raise(py, &error.into()))?;
    Ok(name.as_str().unwrap_or_default().to_owned())
}

/// The line of the ledger that a trace belongs to, from the id and the digest in it.
fn owner(scenario: &str, digest: String) -> Result<Owner> {
    Ok(Owner { scenario: scenario.parse()?, digest })
}

/// The steps of a trace: an array for each number of states and controls, by name. Like all that reads a trace, it raises if the trace
/// does not belong to the line with this id and digest.
#[pyfunction]
pub fn trace_steps<'py>(
    py: Python<'py>,
    trace: PathBuf,
    scenario: &str,
    digest: String,
) -> PyResult<Bound<'py, PyDict>> {
    let (steps, _) = detached(py, || read_recorded(&trace, owner(scenario, digest)?))?;
    let columns = PyDict::new(py);
    let numbers = |of: &dyn Fn(&Step) -> f64| -> Bound<'_, PyArray1<f64>> {
        steps.iter().map(of).collect::<Vec<f64>>().into_pyarray(py)
    };
    let frames: Vec<u64> = steps.iter().map(|step| step.sequence).collect();
    columns.set_item("frame", frames.into_pyarray(py))?;
    for (place, name) in State::NUMBERS.iter().enumerate() {
        columns.set_item(name, numbers(&|step| step.state.numbers()[place]))?;
    }
    for (place, name) in State::FLAGS.iter().enumerate() {
        let flags: Vec<bool> = steps.iter().map(|step| step.state.flags()[place]).collect();
        columns.set_item(name, flags.into_pyarray(py))?;
    }
    for (place, name) in Control::NUMBERS.iter().enumerate() {
        columns.set_item(name, numbers(&|step| step.control.numbers()[place]))?;
    }
    // As `pdk export` names them; not a number at frames without.
    for (place, name) in Step::OBSERVED.into_iter().enumerate() {
        columns
            .set_item(name, numbers(&|step| step.observed.map_or(f64::NAN, |observed| observed[place])))?;
    }
    for (place, name) in Step::APPLIED.into_iter().enumerate() {
        columns.set_item(
            name,
            numbers(&|step| step.applied.map_or(f64::NAN, |applied| applied.numbers()[place])),
        )?;
    }
    let hashes: Vec<u64> = steps.iter().map(|step| step.frame_hash).collect();
    columns.set_item("frame_hash", hashes.into_pyarray(py))?;
    Ok(columns)
}

/// What happened in a trace: times in seconds and texts.
#[pyfunction]
pub fn trace_events(
    py: Python<'_>,
    trace: PathBuf,
    scenario: &str,
    digest: String,
) -> PyResult<Vec<(f64, String)>> {
    detached(py, || {
        let mut events = Vec::new();
        for entry in TraceReader::of(&trace, owner(scenario, digest)?)? {
            if let Entry::Event(event) = entry? {
                events.push((event.time(), event.text));
            }
        }
        Ok(events)
    })
}

/// Numbers of frames, and the frames as one array.
type Frames<'py> = (Bound<'py, PyArray1<u64>>, Bound<'py, PyArray<u8, numpy::Ix4>>);

/// The recorded frames of a topic of a trace: their numbers, and an array of frames x height x width x 3.
#[pyfunction]
pub fn trace_frames<'py>(
    py: Python<'py>,
    trace: PathBuf,
    scenario: &str,
    digest: String,
    topic: &str,
) -> PyResult<Frames<'py>> {
    let topic = match topic {
        "raw" => ImageTopic::Raw,
        "perturbed" => ImageTopic::Perturbed,
        other => return Err(mistake(py, format!("`topic` is `{other}`, but has to be raw or perturbed"))),
    };
    let (numbers, pixels, [height, width]) =
        detached(py, || decoded(&trace, owner(scenario, digest)?, topic))?;
    let array = made(py, [numbers.len(), height, width, 3]);
    // SAFETY: the array was made just now, and nothing else refers to it.
    unsafe { bytes(&array) }.copy_from_slice(&pixels);
    Ok((numbers.into_pyarray(py), array))
}

/// Numbers, all pixels, and the size of a frame.
fn decoded(trace: &Path, owner: Owner, topic: ImageTopic) -> Result<(Vec<u64>, Vec<u8>, [usize; 2])> {
    let (mut numbers, mut pixels, mut size) = (Vec::new(), Vec::new(), None);
    for entry in TraceReader::of(trace, owner)? {
        let Entry::Image(image) = entry? else { continue };
        if image.topic != topic {
            continue;
        }
        let frame = image.decode()?;
        let own = [frame.height(), frame.width()];
        if *size.get_or_insert(own) != own {
            return Err(Error::new(format!("the frames of {} have several sizes", trace.display())));
        }
        numbers.push(image.sequence);
        pixels.extend_from_slice(frame.data());
    }
    Ok((numbers, pixels, size.unwrap_or_default()))
}
