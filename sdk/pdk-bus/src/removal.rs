//! Takes what buses left off the machine: their folders, and their files in /dev/shm.
//!
//! Both are recognised by their names alone and are only deleted, never opened. So it does not matter what state they
//! are in, and nothing here can wait.

use std::{
    collections::HashSet,
    fs,
    io::{self, ErrorKind},
    path::{Path, PathBuf},
};

use crate::{
    error::{Error, Result},
    layout::{CONFIG_FILE, LOCK_FILE, SHARED_MEMORY, parse_root, prefix},
};

/// Takes the bus with the given root off the machine without asking it: for a process that has to end while
/// another of its threads is still inside the bus. Its memory stays mapped, so that the thread does not crash, and
/// the lock stays with the process. The process should end right after: what the bus makes from now on, where a
/// tap is just being opened, would be left.
///
/// # Errors
/// If `root` is not the root of a bus, or something in it cannot be deleted.
pub fn remove(root: &Path) -> Result<()> {
    if parse_root(root).is_none() {
        return Err(Error::new(format!(
            "{} is not the root of a bus, so nothing was removed: use what `Bus::root` returns",
            root.display()
        )));
    }
    delete(&[root.to_owned()]).map(drop)
}

/// Deletes the roots with everything in them and their shared memory. Several processes may do so at the same
/// time; returns how many roots went through this one.
pub(crate) fn delete(roots: &[PathBuf]) -> Result<usize> {
    let mut deleted = 0;
    let mut failed = None;
    let mut note = |path: &Path, result: io::Result<()>| match result {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            failed.get_or_insert_with(|| {
                Error::new(format!(
                    "what a bus left at {} cannot be removed ({error}): remove it by hand",
                    path.display()
                ))
            });
        }
        _ => (),
    };

    // Without this file no tap begins to open the bus, and one that has begun gives up.
    for root in roots {
        let config = root.join(CONFIG_FILE);
        note(&config, fs::remove_file(&config));
    }
    let prefixes: HashSet<String> = roots.iter().filter_map(|root| prefix(root)).collect();
    for file in shared_memory(|prefix| prefixes.contains(prefix)) {
        note(&file, fs::remove_file(&file));
    }
    for root in roots {
        for entry in fs::read_dir(root).into_iter().flatten().flatten() {
            if entry.file_name() == LOCK_FILE {
                continue;
            }
            let path = entry.path();
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            note(&path, if is_folder { remove_folder(&path) } else { fs::remove_file(&path) });
        }
        // The lock goes last: a root that is half deleted is found and deleted again.
        if fs::remove_file(root.join(LOCK_FILE)).is_ok() {
            deleted += 1;
        }
        note(root, ignore_full(fs::remove_dir(root)));
        if let Some(run) = root.parent() {
            note(run, ignore_full(fs::remove_dir(run)));
        }
    }
    failed.map_or(Ok(deleted), Err)
}

/// The files in /dev/shm whose prefix, with its last `_`, is wanted.
pub(crate) fn shared_memory(mut wanted: impl FnMut(&str) -> bool) -> Vec<PathBuf> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| {
        let name = entry.file_name();
        let name = name.to_str().unwrap_or_default();
        name.match_indices('_').nth(1).is_some_and(|(end, _)| wanted(&name[..=end]))
    });
    ours.map(|entry| entry.path()).collect()
}

/// A tap that closes meanwhile, or another sweep, may be at work in the same folder.
fn remove_folder(folder: &Path) -> io::Result<()> {
    const ATTEMPTS: usize = 20;
    for _ in 1..ATTEMPTS {
        match fs::remove_dir_all(folder) {
            Err(error) if error.kind() == ErrorKind::DirectoryNotEmpty => (),
            result => return result,
        }
    }
    fs::remove_dir_all(folder)
}

/// Another process may have put something in; it also takes care of it.
fn ignore_full(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == ErrorKind::DirectoryNotEmpty => Ok(()),
        result => result,
    }
}
