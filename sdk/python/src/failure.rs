//! Errors as exceptions.

use std::panic::{AssertUnwindSafe, catch_unwind};

use pdk_notice::printable;
use pdk_sdk::error::{self, ErrorKind};
use pyo3::prelude::*;

pyo3::create_exception!(
    pdk_perturb,
    Error,
    pyo3::exceptions::PyRuntimeError,
    "What went wrong, in one sentence; `kind` is one of failed, late, lost, nonsense, configuration, panic."
);

/// The exception for an error.
pub fn raise(py: Python<'_>, error: &error::Error) -> PyErr {
    let raised = Error::new_err(printable(error.message()).into_owned());
    let kind = serde_json::to_value(error.kind()).ok();
    let kind = kind.as_ref().and_then(|kind| kind.as_str()).unwrap_or_default();
    // Without the attribute it is still the exception with its sentence.
    let _ = raised.value(py).setattr("kind", kind);
    raised
}

/// The exception for something that the caller has to write differently.
pub fn mistake(py: Python<'_>, sentence: impl Into<String>) -> PyErr {
    raise(py, &error::Error::of(ErrorKind::Configuration, sentence))
}

/// Does work away from the interpreter, so that other threads of Python go on meanwhile. A panic is an error as well.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> error::Result<T> + Send) -> PyResult<T> {
    py.detach(|| caught(work)).map_err(|error| raise(py, &error))
}

/// The result of work; an error where it panics, which a component cannot make it do, since its panics are caught in its plugin.
pub fn caught<T>(work: impl FnOnce() -> error::Result<T>) -> error::Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no reason is given");
        Err(error::Error::of(
            ErrorKind::Panic,
            format!("pdk has a defect: {text}; please report it with this call"),
        ))
    })
}
