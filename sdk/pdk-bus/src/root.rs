//! The root of a bus: a folder of its own with a lock that its owner holds, and who owns which at this moment.
//!
//! The lock tells the living from the dead, because the system gives it back at any end of a process. Its owner
//! holds it alone; who only looks takes it together with others, so lookers neither hinder each other nor look
//! like an owner. A root that is just being made has no configuration yet and is not looked at, except by a
//! sweep; where that comes between folder and lock, the maker notices and takes another root. Only the maker
//! makes the lock file, and only once: a root that was claimed as dead never gets an owner again.

use std::{
    fs::{self, DirBuilder, File, OpenOptions, TryLockError},
    io::{self, ErrorKind, Write},
    os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt},
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use rustix::{
    fs::OFlags,
    rand::{GetRandomFlags, getrandom},
};

use crate::{
    base,
    error::{Error, Result},
    layout::{
        ANNOUNCEMENT_FILE, CONFIG_FILE, LOCK_FILE, UNFINISHED_ANNOUNCEMENT_FILE, UNFINISHED_CONFIG_FILE,
        check_run_id, parse_root, prefix, root_name,
    },
    removal::delete,
};

/// How often a sweep may come between before something else must be wrong.
const ATTEMPTS: usize = 100;

/// The root of a living bus. Dropping it deletes the folder and the shared memory.
#[derive(Debug)]
pub(crate) struct Root {
    path: PathBuf,
    lock: File,
}

impl Root {
    /// Makes a root, which no tap sees before [`finish`](Self::finish).
    pub(crate) fn create(base: &Path, run: &str, slot: u32) -> Result<Self> {
        check_run_id(run)?;
        let run_folder = base.join(run);
        let failed = |error: &dyn std::fmt::Display| {
            Error::new(format!(
                "the folder of slot {slot} cannot be made in {} ({error}): check that it can be written and has space",
                run_folder.display()
            ))
        };
        for _ in 0..ATTEMPTS {
            base::make(base)?;
            base::make(&run_folder)?;
            let path = run_folder.join(root_name(slot, random().map_err(|error| failed(&error))?));
            match DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => (),
                Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::AlreadyExists) => {
                    continue;
                }
                Err(error) => return Err(failed(&error)),
            }
            if let Some(lock) = own(&path).map_err(|error| failed(&error))? {
                let root = Self { path, lock };
                root.write_files().map_err(|error| failed(&error))?;
                return Ok(root);
            }
        }
        Err(failed(&format!("other processes swept it away {ATTEMPTS} times")))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// iceoryx2's configuration as long as the bus is not complete.
    pub(crate) fn unfinished_config(&self) -> PathBuf {
        self.path.join(UNFINISHED_CONFIG_FILE)
    }

    /// Shows the complete bus to taps.
    pub(crate) fn finish(&self) -> Result<()> {
        fs::rename(self.unfinished_config(), self.path.join(CONFIG_FILE)).map_err(|error| {
            Error::new(format!(
                "the bus in {} cannot be completed ({error}): start it again, and end what removes its files",
                self.path.display()
            ))
        })
    }

    /// Writes what the owner announces; a reader finds all of it or what was there before.
    pub(crate) fn announce(&self, text: &str) -> io::Result<()> {
        let unfinished = self.path.join(UNFINISHED_ANNOUNCEMENT_FILE);
        let mut file = options().write(true).create(true).truncate(true).open(&unfinished)?;
        file.write_all(text.as_bytes())?;
        fs::rename(unfinished, self.path.join(ANNOUNCEMENT_FILE))
    }

    fn write_files(&self) -> io::Result<()> {
        let started = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or(Duration::ZERO);
        write!(&self.lock, "{} {}", std::process::id(), started.as_nanos())?;
        let quoted = |text: &str| format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""));
        let (path, prefix) = (self.path.to_str().unwrap_or_default(), prefix(&self.path).unwrap_or_default());
        let text = format!(
            "# The bus of a running pdk process: load this file to tap it with iceoryx2.\n\
             [global]\n\
             root-path = {}\n\
             prefix = {}\n\n\
             [global.node]\n\
             # A tap that ends does not wait for one that was killed; the next one that opens clears up.\n\
             cleanup-dead-nodes-on-destruction = false\n",
            quoted(path),
            quoted(&prefix)
        );
        let mut file = options().write(true).create_new(true).open(self.unfinished_config())?;
        file.write_all(text.as_bytes())
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        // What cannot be deleted now is deleted by the next sweep.
        let _ = delete(std::slice::from_ref(&self.path));
        // Not left to the closing of the file, which a process that another thread is just starting may have open too.
        let _ = self.lock.unlock();
    }
}

/// Takes the lock of a root that was just made; `None` where a sweep was faster.
fn own(root: &Path) -> io::Result<Option<File>> {
    let path = root.join(LOCK_FILE);
    let lock = match options().write(true).create_new(true).open(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        lock => lock?,
    };
    match lock.try_lock() {
        Ok(()) => (),
        Err(TryLockError::WouldBlock) => return Ok(None),
        Err(TryLockError::Error(error)) => return Err(error),
    }
    // The sweep may have been through already: then this is the lock of a root that is no more.
    let ours = lock.metadata()?;
    let is_there =
        fs::symlink_metadata(&path).is_ok_and(|found| (found.dev(), found.ino()) == (ours.dev(), ours.ino()));
    Ok(is_there.then_some(lock))
}

/// A root whose owner is dead.
#[derive(Debug)]
pub(crate) struct DeadRoot {
    pub(crate) path: PathBuf,
    _lock: Option<File>,
}

impl DeadRoot {
    /// `None` where the owner lives, or nothing is left.
    pub(crate) fn claim(path: PathBuf) -> Option<Self> {
        let lock_file = path.join(LOCK_FILE);
        let is_missing =
            |lock: &io::Result<File>| lock.as_ref().is_err_and(|e| e.kind() == ErrorKind::NotFound);
        let mut lock = options().open(&lock_file);
        if is_missing(&lock) {
            // An empty folder holds nothing that its maker could lose.
            if fs::remove_dir(&path).is_ok() {
                return None;
            }
            // It is not empty: either the lock has just been made, or a process died while deleting the rest.
            lock = options().open(&lock_file);
        }
        if is_missing(&lock) {
            return Some(Self { path, _lock: None });
        }
        let lock = lock.ok()?;
        lock.try_lock_shared().ok()?;
        Some(Self { path, _lock: Some(lock) })
    }
}

/// The lock of a root, to look at it.
#[derive(Debug)]
pub(crate) struct Watch(File);

impl Watch {
    pub(crate) fn open(root: &Path) -> io::Result<Self> {
        options().open(root.join(LOCK_FILE)).map(Self)
    }

    /// Whether the owner of the root lives.
    pub(crate) fn is_alive(&self) -> bool {
        match self.0.try_lock_shared() {
            Ok(()) => {
                // The lock is given back at the end of the process anyway.
                let _ = self.0.unlock();
                false
            }
            Err(TryLockError::WouldBlock) => true,
            Err(TryLockError::Error(_)) => false,
        }
    }
}

/// How the files of a root are opened: for this user, and never through a link.
pub(crate) fn options() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).mode(0o600).custom_flags(OFlags::NOFOLLOW.bits() as i32);
    options
}

/// A complete bus whose owner lives.
#[derive(Debug)]
pub(crate) struct LivingRoot {
    pub(crate) run: String,
    pub(crate) slot: u32,
    pub(crate) path: PathBuf,
    pub(crate) process: u32,
    /// Since the Unix epoch.
    pub(crate) started: Duration,
}

/// The complete buses whose owners live, of one run or of all, the newest first.
pub(crate) fn living(base: &Path, run: Option<&str>) -> Result<Vec<LivingRoot>> {
    let mut living: Vec<_> = all(base, run)?.into_iter().filter_map(look).collect();
    living.sort_by(|a, b| b.started.cmp(&a.started).then_with(|| a.path.cmp(&b.path)));
    Ok(living)
}

fn look(path: PathBuf) -> Option<LivingRoot> {
    if !path.join(CONFIG_FILE).exists() || !Watch::open(&path).ok()?.is_alive() {
        return None;
    }
    let owner = fs::read_to_string(path.join(LOCK_FILE)).ok()?;
    let (process, started) = owner.split_once(' ')?;
    Some(LivingRoot {
        run: path.parent()?.file_name()?.to_str()?.to_owned(),
        slot: parse_root(&path)?.0,
        process: process.parse().ok()?,
        started: Duration::from_nanos(started.parse().ok()?),
        path,
    })
}

/// All roots of one run or of all, in whatever state.
///
/// # Errors
/// If the base is not this user's alone, or cannot be read.
pub(crate) fn all(base: &Path, run: Option<&str>) -> Result<Vec<PathBuf>> {
    if !base::is_there(base)? {
        return Ok(Vec::new());
    }
    let runs = match run {
        Some(run) => {
            check_run_id(run)?;
            vec![base.join(run)]
        }
        None => folders(base)?,
    };
    let mut roots = Vec::new();
    for run in runs {
        roots.extend(folders(&run)?.into_iter().filter(|root| parse_root(root).is_some()));
    }
    Ok(roots)
}

/// The folders in a folder, without symbolic links. None if it is not there: the last bus may just have gone.
pub(crate) fn folders(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => {
            return Err(Error::new(format!(
                "the buses in {} cannot be listed ({error}): check that it can be read",
                folder.display()
            )));
        }
    };
    let is_folder = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_dir());
    Ok(entries.flatten().filter(is_folder).map(|entry| entry.path()).collect())
}

fn random() -> io::Result<u64> {
    let mut bytes = [0; 8];
    // So few bytes come whole or not at all.
    getrandom(&mut bytes, GetRandomFlags::empty())?;
    Ok(u64::from_ne_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Folder;

    #[test]
    fn a_dropped_root_is_dead_even_while_a_starting_process_holds_its_files() {
        let folder = Folder::new();
        let root = Root::create(folder.path(), "run", 0).unwrap();
        root.finish().unwrap();
        let watch = Watch::open(root.path()).unwrap();
        assert!(watch.is_alive());
        // What a process has between its fork and its exec: the same open file.
        let held = root.lock.try_clone().unwrap();
        drop(root);
        assert!(!watch.is_alive());
        drop(held);
    }
}
