//! The components of the process, and chains of them.

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pdk_chain::chain::Chain;
use pdk_components::inspection;
use pdk_components::installation;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_notice::printable;
use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;

use crate::failure::detached;

/// What all calls share.
struct State {
    plugins: Vec<PathBuf>,
    drop_ins: Vec<PathBuf>,
    /// Found when it is first needed.
    registry: Option<Arc<Registry>>,
    /// How often components were searched.
    searches: u64,
}

static STATE: Mutex<State> =
    Mutex::new(State { plugins: Vec::new(), drop_ins: Vec::new(), registry: None, searches: 0 });

/// Needs the interpreter, see the crate's documentation.
fn state(_: Python<'_>) -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says where the executable of pdk lies, beside whose folder everything else is found.
#[pyfunction]
pub fn install(executable: PathBuf) {
    // It inspects plugins, so that one that crashes when it is opened is refused and does not end the interpreter.
    inspection::enable();
    pdk_components::product::set(&pdk_product::PRODUCT);
    installation::set_executable(executable);
}

/// Looks for components in these folders besides the usual places from now on.
#[pyfunction]
#[pyo3(signature = (plugins=Vec::new(), drop_ins=Vec::new()))]
pub fn search(py: Python<'_>, plugins: Vec<PathBuf>, drop_ins: Vec<PathBuf>) -> PyResult<()> {
    let registry = discover(py, &plugins, &drop_ins)?;
    let mut state = state(py);
    (state.plugins, state.drop_ins) = (plugins, drop_ins);
    state.registry = Some(registry);
    state.searches += 1;
    Ok(())
}

/// How often components were searched so far: what was made before the last time is not of today's components.
pub fn searches(py: Python<'_>) -> u64 {
    state(py).searches
}

/// The folders of the last [`search`].
#[pyfunction]
pub fn searched(py: Python<'_>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let state = state(py);
    (state.plugins.clone(), state.drop_ins.clone())
}

/// All components as JSON: what `pdk list --json` writes.
#[pyfunction]
pub fn catalog(py: Python<'_>) -> PyResult<String> {
    let registry = registry(py)?;
    detached(py, || Ok(serde_json::to_string(registry.catalog())?))
}

/// All components, found when they are first needed.
pub fn registry(py: Python<'_>) -> PyResult<Arc<Registry>> {
    let (plugins, drop_ins) = {
        let state = state(py);
        if let Some(registry) = &state.registry {
            return Ok(Arc::clone(registry));
        }
        (state.plugins.clone(), state.drop_ins.clone())
    };
    let found = discover(py, &plugins, &drop_ins)?;
    // Another thread may have been faster.
    Ok(Arc::clone(state(py).registry.get_or_insert(found)))
}

fn discover(py: Python<'_>, plugins: &[PathBuf], drop_ins: &[PathBuf]) -> PyResult<Arc<Registry>> {
    let search = SearchPath { plugins: plugins.to_vec(), drop_ins: drop_ins.to_vec(), beside: Vec::new() };
    let registry = detached(py, || Registry::discover(&search, Box::new(LuaScripts::new(&search))))?;
    let refused = registry.refused().iter().map(ToString::to_string);
    for sentence in refused.chain(registry.skipped().iter().cloned()) {
        let sentence = CString::new(printable(&sentence).replace('\0', "")).unwrap_or_default();
        PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &sentence, 2)?;
    }
    Ok(Arc::new(registry))
}

/// Checks that perturbations reach their levels, if those are on other scales than the published one.
pub fn check_levels(py: Python<'_>, perturbations: &[AppliedPerturbation]) -> PyResult<()> {
    if perturbations.iter().all(|applied| applied.level_scale.is_none()) {
        return Ok(());
    }
    let registry = registry(py)?;
    let mut checked = perturbations.iter().map(|applied| registry.catalog().level_scale(applied));
    detached(py, || checked.try_for_each(|checked| checked.map(drop)))
}

/// A new chain.
pub fn make(py: Python<'_>, perturbations: &[AppliedPerturbation], seed: u64) -> PyResult<Chain> {
    let registry = registry(py)?;
    detached(py, || Chain::new(&registry, perturbations, seed))
}
