//! The folder in which keyed clips are kept between runs.
//!
//! A file's name is a hash of everything it depends on, so a file is never out of date. Files are written under another
//! name and renamed when they are whole, and one thread of one process makes a file while the others that want it wait: so
//! several processes can fill the folder at once. When the folder grows beyond [`LARGEST`] bytes, the files that were used
//! least recently go.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use pdk_sdk::cache::VARIABLE;
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::turn::{Turn, take_turn};

/// Bytes that the folder holds, and one clip more where a single one is larger.
pub const LARGEST: u64 = 8 << 30;
const ENDING: &str = "clip";
/// Lies beside a file while it is made.
const TURN: &str = "turn";
/// A file that is being made for longer than this was left by a process that was killed.
const ABANDONED: Duration = Duration::from_secs(24 * 3600);

/// The folder for keyed clips, in the one for all that is kept.
///
/// # Errors
/// As [`pdk_sdk::cache::cache`].
#[cfg(not(test))]
pub fn folder() -> Result<PathBuf> {
    Ok(pdk_sdk::cache::cache()?.folder.join("overlays"))
}

/// Tests keep clear of the user's cache.
#[cfg(test)]
pub fn folder() -> Result<PathBuf> {
    Ok(std::env::temp_dir().join(format!("pdk-overlay-tests-{}", std::process::id())))
}

/// The file for what has this hash.
pub fn file(folder: &Path, hash: &blake3::Hash) -> PathBuf {
    folder.join(format!("{}.{ENDING}", &hash.to_hex()[..32]))
}

/// Gives what `find` finds at a path. If that is an error, the file is made with `write`, which gets an empty one that can
/// be read and written, and then found. Of all threads and processes that want the file, one makes it and the others wait
/// for that; what cannot be made for the one cannot for those who waited either.
///
/// # Errors
/// If the folder cannot be written, with what can be done; or the error of `write`, or of `find` in the end.
pub fn find_or_create<T>(
    path: &Path,
    find: impl Fn() -> Result<T>,
    write: impl FnOnce(File) -> Result<()>,
) -> Result<T> {
    loop {
        if let Ok(found) = find() {
            return Ok(found);
        }
        let folder = folder_of(path);
        pdk_sdk::cache::make(folder).place(unwritable(folder))?;
        match take_turn(&path.with_extension(TURN)).place(unwritable(folder))? {
            Turn::Ours(turn) => {
                // It may have come into being before the turn was taken.
                if let Ok(found) = find() {
                    return Ok(found);
                }
                let made = create(path, write).and_then(|()| find());
                if let Err(error) = &made {
                    turn.fail(error);
                }
                return made;
            }
            Turn::Over => {}
            Turn::Failed(reason) => return Err(reason),
        }
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new("."))
}

fn unwritable(folder: &Path) -> String {
    format!(
        "the folder for prepared clips {} cannot be written; {VARIABLE} can name another",
        folder.display()
    )
}

/// Makes a file with `write`. No reader ever sees a part of it.
fn create(path: &Path, write: impl FnOnce(File) -> Result<()>) -> Result<()> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let folder = folder_of(path);
    let number = COUNTER.fetch_add(1, Ordering::Relaxed);
    let unfinished = path.with_extension(format!("{}-{number}.part", std::process::id()));
    let options = File::options().read(true).write(true).create(true).truncate(true).open(&unfinished);
    let result = write(options.place(unwritable(folder))?)
        .and_then(|()| std::fs::rename(&unfinished, path).place(unwritable(folder)));
    if result.is_err() {
        // The error counts, not whether its leftovers could be cleared away.
        let _ = std::fs::remove_file(&unfinished);
    }
    result?;
    shrink(folder, path, LARGEST);
    Ok(())
}

/// Notes that a file is used.
pub fn touch(path: &Path) {
    // If this fails, the file only looks older than it is.
    let _ = File::options().append(true).open(path).and_then(|file| file.set_modified(SystemTime::now()));
}

/// Removes the files that were used least recently until at most `largest` bytes are left, but never `kept`. What cannot
/// be removed stays: another process may have been faster.
fn shrink(folder: &Path, kept: &Path, largest: u64) {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let Ok(metadata) = entry.metadata() else { continue };
        let used = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        let ending = path.extension().unwrap_or_default();
        if (ending == "part" || ending == TURN) && used.elapsed().is_ok_and(|age| age > ABANDONED) {
            let _ = std::fs::remove_file(path);
        } else if ending == ENDING {
            files.push((used, metadata.len(), path));
        }
    }
    files.sort();
    let mut total: u64 = files.iter().map(|(_, length, _)| length).sum();
    for (_, length, path) in files {
        if total > largest && path != kept {
            let _ = std::fs::remove_file(path);
            total -= length;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::sync::Mutex;
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new").join("a.clip");
        let whole = || Ok(std::fs::read(&path)?);
        let result = find_or_create(&path, whole, |mut file| {
            file.write_all(b"half")?;
            assert!(!path.exists());
            Err(Error::new("stopped"))
        });
        assert_eq!(result.unwrap_err().to_string(), "stopped");
        let left = || std::fs::read_dir(path.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path());
        let left = || left().filter(|path| path.file_name().unwrap() != "CACHEDIR.TAG").count();
        assert_eq!(left(), 0);
        let found = find_or_create(&path, whole, |mut file| Ok(file.write_all(b"whole")?)).unwrap();
        assert_eq!(found, b"whole");
        let again = find_or_create(&path, whole, |_| panic!("it is there")).unwrap();
        assert_eq!(again, found);
        assert_eq!(left(), 1);
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_named_with_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let path = file.join("a.clip");
        let find = || Ok(std::fs::read(&path)?);
        let error = find_or_create(&path, find, |_| Ok(())).unwrap_err().to_string();
        assert!(
            error.contains(&file.display().to_string()) && error.contains("PDK_CACHE can name another"),
            "{error}"
        );
    }

    #[test]
    fn the_files_used_least_recently_go_first() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let old = |name: &str, hours: u64| {
            std::fs::write(path(name), [0; 10]).unwrap();
            let time = SystemTime::now() - Duration::from_secs(hours * 3600);
            File::options().append(true).open(path(name)).unwrap().set_modified(time).unwrap();
        };
        old("a.clip", 5);
        old("b.clip", 4);
        old("c.clip", 3);
        old("d.clip", 2);
        old("left.part", 30);
        old("left.turn", 30);
        old("busy.part", 1);
        old("busy.turn", 1);
        old("other", 90);
        touch(&path("b.clip"));
        shrink(folder.path(), &path("a.clip"), 20);
        let mut left: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(left, ["a.clip", "b.clip", "busy.part", "busy.turn", "other"]);
    }

    #[test]
    fn several_files_are_made_at_once_and_each_by_one_alone() {
        let folder = tempfile::tempdir().unwrap();
        let (to_first, first) = channel();
        let (to_second, second) = channel();
        let ends = [("a.clip", to_second, first), ("b.clip", to_first, second)]
            .map(|(name, to, from): (_, Sender<()>, Receiver<()>)| (name, Mutex::new(Some((to, from)))));
        let make = |name: &str, ends: &Mutex<Option<(Sender<()>, Receiver<()>)>>| {
            let path = folder.path().join(name);
            let find = || Ok(std::fs::read(&path)?);
            let made = find_or_create(&path, find, |mut file| {
                // Each is done only when the other has begun.
                let (to, from) = ends.lock().unwrap().take().expect("it is made twice");
                to.send(()).unwrap();
                from.recv_timeout(Duration::from_secs(20)).expect("the other waits");
                Ok(file.write_all(name.as_bytes())?)
            });
            assert_eq!(made.unwrap(), name.as_bytes());
        };
        std::thread::scope(|scope| {
            for (name, ends) in &ends {
                for _ in 0..3 {
                    scope.spawn(|| make(name, ends));
                }
            }
        });
    }
}
