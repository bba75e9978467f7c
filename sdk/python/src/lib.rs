//! The extension module of the Python package `pdk_perturb`: arrays in, perturbed arrays out.
//!
//! | module | subject |
//! |---|---|
//! | [`values`] | perturbations as Python writes them: texts, dictionaries, lists, keyword arguments |
//! | [`arrays`] | images as arrays of numpy, in place where their layout allows it |
//! | [`components`] | the components of the process, and chains of them |
//! | [`kept`] | chains that are kept from one call to the next |
//! | [`images`] | images that count for themselves, alone or in batches |
//! | [`labels`] | where points, boxes and the pixels of masks go |
//! | [`sequence`] | the frames of a sequence, one after the other |
//! | [`records`] | records of runs: ledgers and traces |
//! | [`failure`] | errors as exceptions |
//!
//! On the command line components are called in a process that another one supervises. Here that is the interpreter's: an error or a
//! panic of a component becomes an exception, but one that crashes takes the interpreter with it.
//!
//! Locks of this module are only ever taken while the thread is attached to the interpreter, and never while it waits for
//! anything. So a program that forks, as data loaders do, forks while none is held.

mod arrays;
mod components;
mod failure;
mod images;
mod kept;
mod labels;
mod records;
mod sequence;
mod values;

use pyo3::prelude::*;

/// Perturbs arrays. The package `pdk_perturb` has what users import.
#[pymodule]
fn _pdk(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Error", module.py().get_type::<failure::Error>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<sequence::Perturbation>()?;
    module.add_function(wrap_pyfunction!(components::install, module)?)?;
    module.add_function(wrap_pyfunction!(components::search, module)?)?;
    module.add_function(wrap_pyfunction!(components::searched, module)?)?;
    module.add_function(wrap_pyfunction!(components::catalog, module)?)?;
    module.add_function(wrap_pyfunction!(images::perturb, module)?)?;
    module.add_function(wrap_pyfunction!(images::identity, module)?)?;
    module.add_function(wrap_pyfunction!(labels::move_points, module)?)?;
    module.add_function(wrap_pyfunction!(labels::move_boxes, module)?)?;
    module.add_function(wrap_pyfunction!(labels::source_pixels, module)?)?;
    module.add_function(wrap_pyfunction!(records::read_ledger, module)?)?;
    module.add_function(wrap_pyfunction!(records::verdict, module)?)?;
    module.add_function(wrap_pyfunction!(records::trace_steps, module)?)?;
    module.add_function(wrap_pyfunction!(records::trace_events, module)?)?;
    module.add_function(wrap_pyfunction!(records::trace_frames, module)?)?;
    module.add_function(wrap_pyfunction!(values::written, module)?)?;
    module.add_function(wrap_pyfunction!(sequence::resume, module)?)
}
