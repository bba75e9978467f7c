//! Chains that are kept from one call to the next.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use pdk_chain::chain::Chain;
use pdk_components::registry::{Registry, is_mask_script};
use pdk_components::search_path::is_script;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::region::Region;
use pdk_record::manifest::components_of_all;
use pdk_sdk::describe::ParameterType;
use pyo3::prelude::*;

use crate::components::{check_levels, make, registry, searches};
use crate::failure::detached;

/// Chains that are kept. Each may hold textures and clips at the size of the last image.
const MOST_KEPT: usize = 64;

/// The one that was used last is at the end.
static KEPT: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// Needs the interpreter, see the crate's documentation.
fn all_kept(_: Python<'_>) -> MutexGuard<'static, Vec<Kept>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A chain for some calls, with what decides whether it can be used again.
pub struct Kept {
    /// The chain itself.
    pub chain: Chain,
    /// What it is, without its levels.
    key: String,
    /// The files that it was made from, as they were then.
    files: Files,
    /// The number of searches before it was made.
    searches: u64,
}

/// Files, each with what tells one version of it from another.
struct Files(Vec<(PathBuf, Option<Version>)>);

/// When a file was changed last, in seconds and nanoseconds, its size, and its inode.
type Version = (i64, i64, u64, u64);

impl Files {
    /// The files that perturbations are made from, as they are now.
    fn of(registry: &Registry, perturbations: &[AppliedPerturbation]) -> Self {
        let mut paths = Vec::new();
        for applied in perturbations {
            if let Some(Region::Mask(path)) = &applied.region {
                paths.push(PathBuf::from(path));
            }
        }
        for (kind, component) in components_of_all(perturbations) {
            if is_mask_script(kind, &component.name) {
                paths.push(PathBuf::from(&component.name));
                continue;
            }
            // What there is not is refused when the chain is made.
            let Ok(entry) = registry.catalog().get(kind, &component.name) else { continue };
            // A library stays as it was loaded.
            if !entry.is_built_in() && (entry.base.is_some() || is_script(&entry.file)) {
                paths.push(entry.file.clone());
            }
            let described = entry.description.parameters.iter();
            let named = described.filter(|parameter| parameter.kind == ParameterType::Path);
            let named = named.filter_map(|parameter| component.parameters.get(&parameter.name)?.as_str());
            paths.extend(named.map(PathBuf::from));
            // Such as the weights beside a network. What cannot be listed cannot be made either.
            let beside = registry.input_files(kind, &component.name, &component.parameters);
            for group in beside.unwrap_or_default() {
                paths.extend(group.names.iter().map(|name| group.folder.join(name)));
            }
        }
        paths.sort();
        paths.dedup();
        let dated = |path: PathBuf| {
            let version = version(&path);
            (path, version)
        };
        Self(paths.into_iter().map(dated).collect())
    }

    fn are_unchanged(&self) -> bool {
        self.0.iter().all(|(path, known)| version(path) == *known)
    }
}

/// The version of a file; none if it cannot be read, or is part of pdk and so never changes.
fn version(path: &Path) -> Option<Version> {
    let found = path.metadata().ok()?;
    Some((found.mtime(), found.mtime_nsec(), found.size(), found.ino()))
}

/// What tells chains apart that cannot be made from each other.
fn key(perturbations: &[AppliedPerturbation]) -> String {
    // All but the level, at which a chain can begin again.
    let without_levels: Vec<_> = perturbations.iter().map(|applied| applied.clone().at_level(0.0)).collect();
    format!("{without_levels:?}")
}

/// A chain for some calls: one that is kept, or a new one.
pub fn take(py: Python<'_>, perturbations: &[AppliedPerturbation], seed: u64) -> PyResult<Kept> {
    let key = key(perturbations);
    loop {
        // The number comes before the components, so that a search in between makes the chain one that is not kept.
        let searches = searches(py);
        drop_of_earlier_searches(py, searches);
        let found = {
            let mut kept = all_kept(py);
            let place = kept.iter().rposition(|kept| kept.key == key);
            place.map(|place| kept.remove(place))
        };
        let Some(mut kept) = found else {
            let registry = registry(py)?;
            // The files come before the chain, so that one that changes in between is read again.
            let files = detached(py, || Ok(Files::of(&registry, perturbations)))?;
            let chain = make(py, perturbations, seed)?;
            return Ok(Kept { chain, key, files, searches });
        };
        if !kept.files.are_unchanged() {
            py.detach(|| drop(kept));
            continue;
        }
        // Of the same scale, but maybe at a level that it does not reach.
        check_levels(py, perturbations)?;
        kept.chain.begin_again(perturbations, seed);
        return Ok(kept);
    }
}

/// Keeps a chain for later. One that has failed is not to be kept: its instances may be of no more use.
pub fn keep(py: Python<'_>, chain: Kept) {
    let dropped = if chain.searches == searches(py) {
        let mut kept = all_kept(py);
        kept.push(chain);
        (kept.len() > MOST_KEPT).then(|| kept.remove(0))
    } else {
        Some(chain)
    };
    if dropped.is_some() {
        // What a component does at its end takes its time.
        py.detach(|| drop(dropped));
    }
}

/// Drops the chains that were made before components were searched for the last time.
fn drop_of_earlier_searches(py: Python<'_>, searches: u64) {
    let dropped: Vec<Kept> = {
        let mut kept = all_kept(py);
        let (now, earlier) = kept.drain(..).partition(|kept| kept.searches == searches);
        *kept = now;
        earlier
    };
    if !dropped.is_empty() {
        py.detach(|| drop(dropped));
    }
}
