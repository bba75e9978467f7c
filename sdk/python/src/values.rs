//! Perturbations as Python writes them: a text as on the command line, a dictionary as in a pipeline, a list of such, and keyword
//! arguments beside one of them.

use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::Result;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde_json::{Map, Number, Value};

use crate::failure::{mistake, raise};

/// The chain that an argument stands for, with parameters and modifiers given beside it.
pub fn chain(
    perturbation: &Bound<'_, PyAny>,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<AppliedPerturbation>> {
    let py = perturbation.py();
    let given = match given {
        Some(given) => table(given, true)?,
        None => Map::new(),
    };
    let listed = perturbation.cast::<PyList>().is_ok() || perturbation.cast::<PyTuple>().is_ok();
    // An intensity is one for all.
    if listed && given.keys().any(|name| name != "level") {
        let names: Vec<_> = given.keys().map(String::as_str).collect();
        return Err(mistake(
            py,
            format!(
                "`{}` beside a list of perturbations could mean any of them; write each with its own, as in {{\"name\": ..., \"{}\": ...}}",
                names.join("`, `"),
                names[0]
            ),
        ));
    }
    if listed {
        let mut chain = perturbation.try_iter()?.map(|item| one(&item?)).collect::<PyResult<Vec<_>>>()?;
        let set = |applied| merge(applied, given.clone());
        chain.iter_mut().try_for_each(set).map_err(|error| raise(py, &error))?;
        return Ok(chain);
    }
    let mut applied = one(perturbation)?;
    merge(&mut applied, given).map_err(|error| raise(py, &error))?;
    Ok(vec![applied])
}

/// The same perturbations at a level.
pub fn at_level(
    chain: &[AppliedPerturbation],
    level: &Bound<'_, PyAny>,
) -> PyResult<Vec<AppliedPerturbation>> {
    let given = Map::from_iter([("level".to_owned(), json(level)?)]);
    let mut chain = chain.to_vec();
    let set = |applied| merge(applied, given.clone());
    chain.iter_mut().try_for_each(set).map_err(|error| raise(level.py(), &error))?;
    Ok(chain)
}

/// Perturbations as they are written on the command line, one text for each.
#[pyfunction]
#[pyo3(signature = (perturbation, **parameters))]
pub fn written(
    perturbation: &Bound<'_, PyAny>,
    parameters: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<String>> {
    Ok(chain(perturbation, parameters)?.iter().map(ToString::to_string).collect())
}

fn one(value: &Bound<'_, PyAny>) -> PyResult<AppliedPerturbation> {
    let read = match value.cast::<PyString>() {
        Ok(text) => AppliedPerturbation::parse(text.to_cow()?.as_ref()),
        Err(_) => AppliedPerturbation::from_json(&json(value)?),
    };
    read.map_err(|error| raise(value.py(), &error))
}

/// Sets what is given beside a perturbation; it counts more than what stands in it.
fn merge(applied: &mut AppliedPerturbation, given: Map<String, Value>) -> Result<()> {
    if given.is_empty() {
        return Ok(());
    }
    let names: Vec<String> = given.keys().cloned().collect();
    let mut given = given;
    given.insert("name".to_owned(), applied.name.clone().into());
    let mut read = AppliedPerturbation::from_json(&Value::Object(given))?;
    for name in names {
        // What is not a modifier is a parameter of its own.
        if name != "name"
            && !applied.take_over(&name, &mut read)
            && let Some(value) = read.parameters.shift_remove(&name)
        {
            applied.parameters.insert(name, value);
        }
    }
    Ok(())
}

/// A value of Python as JSON has it.
fn json(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    let py = value.py();
    if value.is_none() {
        return Ok(Value::Null);
    }
    // Truth values come first, since they are whole numbers too.
    if let Ok(set) = value.cast::<PyBool>() {
        return Ok(Value::Bool(set.is_true()));
    }
    if value.cast::<PyInt>().is_ok() {
        return value
            .extract::<i64>()
            .map(Value::from)
            .map_err(|_| mistake(py, format!("{value} is too large a number; give one below 2^63")));
    }
    if value.cast::<PyFloat>().is_ok() {
        let number = value.extract::<f64>()?;
        return Number::from_f64(number)
            .map(Value::Number)
            .ok_or_else(|| mistake(py, format!("{number} cannot be set; give a finite number")));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::from(text.to_cow()?.into_owned()));
    }
    if let Ok(given) = value.cast::<PyDict>() {
        return table(given, false).map(Value::Object);
    }
    if value.cast::<PyList>().is_ok() || value.cast::<PyTuple>().is_ok() {
        return value.try_iter()?.map(|item| json(&item?)).collect::<PyResult<_>>().map(Value::Array);
    }
    // Paths, and numbers and arrays of numpy.
    for name in ["__fspath__", "tolist"] {
        if value.hasattr(name)? {
            return json(&value.call_method0(name)?);
        }
    }
    Err(mistake(
        py,
        format!(
            "a {} cannot be set; give a text such as \"fog_filter@2\", a number, a truth value, a list or a dictionary",
            value.get_type().name()?
        ),
    ))
}

/// A dictionary as JSON has it; what is None is left out where `sparse` says so.
fn table(given: &Bound<'_, PyDict>, sparse: bool) -> PyResult<Map<String, Value>> {
    let mut table = Map::new();
    for (key, value) in given.iter() {
        if sparse && value.is_none() {
            continue;
        }
        let key = key.cast::<PyString>().map_err(|_| {
            mistake(given.py(), format!("{key} is not a name, so it cannot be set; write names as texts"))
        })?;
        table.insert(key.to_cow()?.into_owned(), json(&value)?);
    }
    Ok(table)
}
