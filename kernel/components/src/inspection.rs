//! Opens libraries in a process that dies afterwards, before they are opened where they are needed.
//!
//! To open a library runs its initialisers, which may crash, hang, exit or change how numbers are rounded; and of a damaged file the
//! system makes what it can. A library that comes through this is opened again, every other one is refused by name, and nothing
//! of it stays. So that starting pdk takes no longer than before, what came through is noted in the user's cache.

use std::fs::{self, File};
use std::io::{Read, Seek, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use pdk_sdk::SDK_VERSION;
use pdk_sdk::cache::cache;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use serde::{Deserialize, Serialize};

use crate::elf;
use crate::installation;
use crate::loader::Plugin;
use pdk_supervise::supervisor::{DEFAULT_MEMORY, End, LOOK, Limits, Supervised};

/// The hidden verb that inspects the libraries that it is given.
pub const VERB: &str = "inspect";

/// How long a library may take to be opened.
const PATIENCE: Duration = Duration::from_secs(20);
/// The folder in the cache with a note for each library that was found good.
const NOTES: &str = "inspected-plugins";
/// Notes that are kept.
const MOST_NOTES: usize = 1000;

static ENABLED: AtomicBool = AtomicBool::new(false);

/// Declares that the executable has the [`VERB`]. Without that, as in unit tests, nothing is inspected.
pub fn enable() {
    ENABLED.store(true, Ordering::Relaxed);
}

/// What the process says of a library.
#[derive(Serialize, Deserialize)]
struct Said {
    refused: Option<String>,
}

/// Inspects libraries: for each the reason why it cannot be used, if there is one.
///
/// # Errors
/// If no process can be started.
pub fn inspect(libraries: &[PathBuf]) -> Result<Vec<Option<Error>>> {
    if !ENABLED.load(Ordering::Relaxed) {
        return Ok(libraries.iter().map(|_| None).collect());
    }
    let notes = Notes::of_user();
    let mut reasons: Vec<Option<Error>> = libraries.iter().map(|_| None).collect();
    let unknown = |(number, library): (usize, &PathBuf)| {
        let mark = mark(library)?;
        (!notes.has(&mark)).then_some((number, mark))
    };
    let mut open: Vec<(usize, String)> = libraries.iter().enumerate().filter_map(unknown).collect();
    // All at once, until one of them ends the process after it was opened, such as when the process leaves: then one by one.
    let mut at_once = open.len();
    while !open.is_empty() {
        let paths: Vec<&Path> =
            open.iter().take(at_once).map(|(number, _)| libraries[*number].as_path()).collect();
        let (mut said, end) = in_a_process(&paths)?;
        if said.len() >= paths.len()
            && let Some(end) = &end
        {
            if paths.len() > 1 {
                at_once = 1;
                continue;
            }
            said = vec![Said { refused: Some(format!("plugin {}: {end}", paths[0].display())) }];
        }
        let (done, asked) = (said.len().min(open.len()), paths.len());
        for ((number, mark), Said { refused }) in open.drain(..done).zip(said) {
            match refused {
                Some(reason) => reasons[number] = Some(Error::new(reason)),
                None => notes.add(&mark),
            }
        }
        // What is left was not come to, because the first of it ended the process.
        if done < asked {
            let (number, _) = open.remove(0);
            let reason = end.unwrap_or_else(|| Error::new("it cannot be inspected"));
            reasons[number] = Some(reason.at(format_args!("plugin {}", libraries[number].display())));
        }
    }
    Ok(reasons)
}

/// Whether a library has been opened on this machine before by this user, and has not changed since.
pub fn is_known(library: &Path) -> bool {
    mark(library).is_some_and(|mark| Notes::of_user().has(&mark))
}

/// Opens libraries in a process: what that says of those that it comes to, and how it ended if it did not come to the end.
fn in_a_process(libraries: &[&Path]) -> Result<(Vec<Said>, Option<Error>)> {
    const CANNOT: &str = "cannot start a process to inspect plugins";
    let mut command = Command::new(installation::executable()?);
    // Not a pipe, which something that a library starts could hold open.
    let mut output = File::from(
        rustix::fs::memfd_create("pdk-inspection", rustix::fs::MemfdFlags::CLOEXEC).place(CANNOT)?,
    );
    command.arg(VERB).args(libraries).stdin(Stdio::null()).stderr(Stdio::null());
    command.stdout(output.try_clone().place(CANNOT)?);
    // SAFETY: between fork and exec it makes one system call, and touches no memory.
    unsafe {
        command.pre_exec(|| {
            let end = rustix::process::Signal::KILL;
            Ok(rustix::process::set_parent_process_death_signal(Some(end))?)
        });
    }
    let limits = Limits { patience: PATIENCE, memory: DEFAULT_MEMORY };
    let mut process = Supervised::start(command, limits, false).place(CANNOT)?;
    let started = Instant::now();
    let end = loop {
        if let Some(end) = process.look().place(CANNOT)? {
            break end;
        }
        std::thread::sleep((started.elapsed() / 20).clamp(Duration::from_micros(500), LOOK));
    };
    let mut text = String::new();
    output.rewind().and_then(|()| output.read_to_string(&mut text)).place(CANNOT)?;
    let said = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let reason = match end {
        End::Done(_) => None,
        // Which library it was is known.
        End::Late(_, patience) => Some(Error::of(
            ErrorKind::Late,
            format!("opening it has not come back for {} s", patience.as_secs_f64()),
        )),
        end => Some(Error::of(end.kind(), end.said(&[]).replacen("a component", "opening it", 1))),
    };
    Ok((said, reason))
}

/// What the process does: opens libraries, one after the other, and says what came of each.
///
/// # Errors
/// If standard output is closed.
pub fn serve(libraries: &[PathBuf]) -> Result<()> {
    const CANNOT: &str = "cannot set up the files of the inspection";
    let mut output = File::from(std::io::stdout().as_fd().try_clone_to_owned().place(CANNOT)?);
    // What a library writes is not an answer.
    let nothing = File::options().write(true).open("/dev/null").place(CANNOT)?;
    rustix::stdio::dup2_stdout(&nothing).place(CANNOT)?;
    for library in libraries {
        let refused = look(library).err().map(|error| error.to_string());
        let mut line = serde_json::to_vec(&Said { refused })?;
        line.push(b'\n');
        output.write_all(&line).place(CANNOT)?;
    }
    Ok(())
}

/// Opens a library that does not reach into the memory of others.
fn look(library: &Path) -> Result<()> {
    // What cannot be read is refused by the loader, which says why.
    if elf::strays(library).unwrap_or(false) {
        return Err(Error::new(format!(
            "plugin {}: is damaged: it changes memory outside of itself when it is loaded; build or copy it again",
            library.display()
        )));
    }
    Plugin::load(library).map(drop)
}

/// Tells a library from every other one, and from itself after a change: its time of change cannot be set back by anyone, so its
/// content need not be read. None if it is not there.
fn mark(library: &Path) -> Option<String> {
    let library = library.canonicalize().ok()?;
    let file = library.metadata().ok()?;
    Some(format!(
        "{} {} {} {} {}.{} {}.{}",
        library.display(),
        file.dev(),
        file.ino(),
        file.len(),
        file.mtime(),
        file.mtime_nsec(),
        file.ctime(),
        file.ctime_nsec()
    ))
}

/// The libraries that came through, a file for each: processes that start at the same time do not take each other's notes away.
/// Without the folder everything is inspected each time.
struct Notes {
    folder: Option<PathBuf>,
}

impl Notes {
    fn of_user() -> Self {
        Self { folder: cache().ok().map(|cache| cache.folder.join(NOTES)) }
    }

    /// The file of a mark, for this version of pdk.
    fn file(&self, mark: &str) -> Option<PathBuf> {
        let name = blake3::hash(format!("{SDK_VERSION} {mark}").as_bytes()).to_hex();
        self.folder.as_ref().map(|folder| folder.join(name.as_str()))
    }

    fn has(&self, mark: &str) -> bool {
        self.file(mark).is_some_and(|file| file.exists())
    }

    /// If that fails, the library is inspected again the next time.
    fn add(&self, mark: &str) {
        let (Some(folder), Some(file)) = (&self.folder, self.file(mark)) else { return };
        let _ = fs::create_dir_all(folder).and_then(|()| fs::write(&file, mark));
        let Ok(listed) = fs::read_dir(folder) else { return };
        let others: Vec<_> =
            listed.flatten().map(|entry| entry.path()).filter(|other| *other != file).collect();
        let Some(surplus) = (others.len() + 1).checked_sub(MOST_NOTES).filter(|surplus| *surplus > 0) else {
            return;
        };
        let dated =
            others.into_iter().filter_map(|other| Some((other.metadata().ok()?.modified().ok()?, other)));
        let mut dated: Vec<_> = dated.collect();
        dated.sort();
        for (_, oldest) in dated.iter().take(surplus) {
            let _ = fs::remove_file(oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processes_that_start_at_the_same_time_keep_each_others_notes() {
        let folder = tempfile::tempdir().unwrap();
        let of_one = || Notes { folder: Some(folder.path().join("notes")) };
        let (first, second) = (of_one(), of_one());
        assert!(!first.has("a") && !second.has("b"));
        first.add("a");
        second.add("b");
        for notes in [first, second, of_one()] {
            assert!(notes.has("a") && notes.has("b") && !notes.has("c"));
        }
    }

    #[test]
    fn the_oldest_notes_make_way() {
        let folder = tempfile::tempdir().unwrap();
        let notes = Notes { folder: Some(folder.path().to_owned()) };
        notes.add("oldest");
        let file = File::options().write(true).open(notes.file("oldest").unwrap()).unwrap();
        file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap();
        // In any order of their names.
        for number in 1..MOST_NOTES {
            notes.add(&number.to_string());
        }
        assert!(notes.has("oldest"));
        notes.add("newest");
        assert!(!notes.has("oldest") && notes.has("newest"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), MOST_NOTES);
    }
}
