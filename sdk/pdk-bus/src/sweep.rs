//! Removes the buses of processes that were killed.

use std::{fs, path::Path};

use crate::{
    base::base,
    error::Result,
    layout::check_run_id,
    removal::delete,
    root::{DeadRoot, all, folders},
};

/// Each takes an open file, of which a process may have about a thousand.
const AT_A_TIME: usize = 64;

/// Removes the folders and the shared memory of all buses of this user whose owners are dead, and returns how
/// many that were. It waits for nothing and leaves the living alone, also those that are just being made; any
/// number of processes may sweep at the same time.
///
/// # Errors
/// If the base is not this user's alone or cannot be read, or something cannot be deleted.
pub fn sweep() -> Result<usize> {
    sweep_below(&base()?, None)
}

/// Like [`sweep`], for the buses of one run.
///
/// # Errors
/// As for [`sweep`], and if `run` cannot be a run id.
pub fn sweep_run(run: &str) -> Result<usize> {
    check_run_id(run)?;
    sweep_below(&base()?, Some(run))
}

fn sweep_below(base: &Path, run: Option<&str>) -> Result<usize> {
    let mut removed = 0;
    let mut failed = None;
    for roots in all(base, run)?.chunks(AT_A_TIME) {
        let dead: Vec<_> = roots.iter().cloned().filter_map(DeadRoot::claim).collect();
        let paths: Vec<_> = dead.iter().map(|root| root.path.clone()).collect();
        if !paths.is_empty() {
            match delete(&paths) {
                Ok(deleted) => removed += deleted,
                Err(error) => failed = Some(error),
            }
        }
    }
    let runs = match run {
        Some(run) => vec![base.join(run)],
        None => folders(base)?,
    };
    for run in runs {
        // Fails where a bus is left in it. Who is about to make one notices that the folder is gone.
        let _ = fs::remove_dir(run);
    }
    failed.map_or(Ok(removed), Err)
}
