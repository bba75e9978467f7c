//! Processes of a run, found by the environment that they were started in, and what they leave in shared memory.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::process::LIMIT;

/// Where the system keeps what processes share.
const SHARED_MEMORY: &str = "/dev/shm";

/// A folder for the topics of one test, so that everything in it is of its runs.
pub struct BusFolder {
    folder: tempfile::TempDir,
}

impl BusFolder {
    /// Makes one.
    ///
    /// # Panics
    /// If it cannot be made.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        Self {
            folder: tempfile::Builder::new().prefix("pt").rand_bytes(4).tempdir_in(SHARED_MEMORY).unwrap(),
        }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The environment variable that tells `pdk` of it.
    pub fn variable(&self) -> (&'static str, &Path) {
        (pdk_bus::BASE_VARIABLE, self.path())
    }

    /// The processes that were started with this folder and live, but for those that are waiting for their parent only.
    pub fn processes(&self) -> Vec<Process> {
        let wanted = format!("{}={}", pdk_bus::BASE_VARIABLE, self.path().display());
        let mut found = all();
        found.retain(|process| {
            let environment = fs::read(format!("/proc/{}/environ", process.id)).unwrap_or_default();
            environment.split(|&byte| byte == 0).any(|variable| variable == wanted.as_bytes())
        });
        found
    }

    /// The folders of the buses in it, `BASE/RUN/SLOT-NAME`, and their names, as they stand in the names of files in shared memory.
    fn roots(&self) -> Vec<(PathBuf, String)> {
        let folders = |path: &Path| {
            let entries = fs::read_dir(path).into_iter().flatten().flatten();
            entries.map(|entry| entry.path()).collect::<Vec<_>>()
        };
        let named = |root: PathBuf| {
            let name = root.file_name()?.to_str()?.split_once('-')?.1.to_owned();
            Some((root, name))
        };
        folders(self.path()).iter().flat_map(|run| folders(run)).filter_map(named).collect()
    }

    /// The names of the buses in it.
    pub fn buses(&self) -> BTreeSet<String> {
        self.roots().into_iter().map(|(_, name)| name).collect()
    }

    /// The files through which the processes on its buses share memory: frames, and what the bus itself keeps.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = shared_memory(&self.buses());
        let mut folders: Vec<PathBuf> = self.roots().into_iter().map(|(root, _)| root).collect();
        while let Some(folder) = folders.pop() {
            for path in fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.sort();
        files
    }

    /// What the buses in it have in memory: their folders, and the files that belong to them.
    ///
    /// # Panics
    /// If the folder cannot be read.
    pub fn left(&self) -> Vec<PathBuf> {
        fs::read_dir(self.path()).unwrap().map(|entry| entry.unwrap().path()).collect()
    }
}

impl Drop for BusFolder {
    /// What was killed with all of its run is swept away by the next run in the same folder. Here there is none, and without the folder
    /// the owner of the files is not known.
    fn drop(&mut self) {
        for file in shared_memory(&self.buses()) {
            // A test that has failed may still have processes that take them away themselves.
            let _ = fs::remove_file(file);
        }
    }
}

/// The files of these buses in shared memory.
pub fn shared_memory(buses: &BTreeSet<String>) -> Vec<PathBuf> {
    let files = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten().map(|entry| entry.path());
    let ours = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        buses.iter().any(|bus| name.starts_with(&format!("pdk_{bus}_")))
    };
    files.filter(ours).collect()
}

/// A process.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Process {
    /// Its number.
    pub id: u32,
    /// The number of its parent.
    pub parent: u32,
    /// Its arguments, with blanks between them.
    pub command: String,
}

impl Process {
    /// Sends it a signal; it may be gone already.
    pub fn signal(&self, signal: Signal) {
        let _ = kill_process(pid(self.id), signal);
    }
}

/// All processes but those that are waiting for their parent only.
fn all() -> Vec<Process> {
    let ids = fs::read_dir("/proc").into_iter().flatten().flatten();
    let ids = ids.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    ids.filter_map(|id: u32| {
        let status = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
        // Behind the name, which is in brackets: the state and the parent.
        let mut fields = status.rsplit(')').next()?.split_whitespace();
        let (state, parent) = (fields.next()?, fields.next()?.parse().ok()?);
        let command = fs::read(format!("/proc/{id}/cmdline")).ok()?;
        let command = String::from_utf8_lossy(&command).replace('\0', " ").trim().to_owned();
        (state != "Z" && state != "X").then_some(Process { id, parent, command })
    })
    .collect()
}

fn pid(id: u32) -> Pid {
    Pid::from_raw(i32::try_from(id).unwrap()).unwrap()
}

/// Sends a child a signal.
///
/// # Panics
/// If it has been waited for.
pub fn signal(child: &Child, signal: Signal) {
    kill_process(pid(child.id()), signal).unwrap();
}

/// Sends a child a signal and waits until it has taken it: two of a kind that wait for it are one.
///
/// # Panics
/// If it does not take it, or has been waited for.
pub fn signal_taken(child: &Child, sent: Signal) {
    signal(child, sent);
    let pending = || signals(child, "ShdPnd").is_some_and(|set| set.contains(&sent));
    assert!(comes_true(LIMIT, || !pending()), "it does not take the signal");
}

/// Whether a child has something that takes a signal.
pub fn takes(child: &Child, wanted: Signal) -> bool {
    signals(child, "SigCgt").is_some_and(|set| set.contains(&wanted))
}

/// A set of signals in the state of a process, such as those that wait; none if it is gone.
fn signals(child: &Child, name: &str) -> Option<Vec<Signal>> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let set = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(":"))?;
    let set = u64::from_str_radix(set.trim(), 16).ok()?;
    let all = [Signal::INT, Signal::TERM];
    Some(all.into_iter().filter(|signal| set & 1 << (signal.as_raw() - 1) != 0).collect())
}

/// Waits for a child's end; none if it has not ended by then.
///
/// # Panics
/// If the system does not say.
pub fn ended_within(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return Some(status);
        }
        if started.elapsed() > limit {
            return None;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits until `done`; whether it came to that in time.
pub fn comes_true(limit: Duration, mut done: impl FnMut() -> bool) -> bool {
    let started = Instant::now();
    loop {
        if done() {
            return true;
        }
        if started.elapsed() > limit {
            return false;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
