//! Whose turn it is to make a file: that of one thread of one process. The others wait until it is made.
//!
//! The turn is a lock on a file beside it, which the system gives back when a process ends, however that comes about. A turn
//! that is over is removed, with its lock still held: a process that waited for it sees that and need not take it. What went wrong
//! is written there before.

use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json;

/// What came of waiting for a turn.
pub enum Turn {
    /// It is ours until it is dropped.
    Ours(Ours),
    /// Another had it, and is done.
    Over,
    /// Another had it, and could not make the file, for this reason.
    Failed(Error),
}

/// A turn that is held.
pub struct Ours {
    file: File,
    path: PathBuf,
}

/// Takes the turn, or waits until its holder is done.
///
/// # Errors
/// If the file at the path cannot be made or read.
pub fn take_turn(path: &Path) -> Result<Turn> {
    wait(open(path)?, path)
}

fn open(path: &Path) -> Result<File> {
    Ok(File::options().read(true).write(true).create(true).truncate(false).open(path)?)
}

fn wait(mut file: File, path: &Path) -> Result<Turn> {
    loop {
        match file.lock() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            // A file system without locks: what is made twice is the same, and is only made twice.
            Ok(()) | Err(_) => break,
        }
    }
    let here = match std::fs::metadata(path) {
        Ok(here) => is_same(&here, &file.metadata()?),
        Err(error) if error.kind() == ErrorKind::NotFound => false,
        Err(error) => return Err(error.into()),
    };
    if here {
        // A process that was killed may have written a part of a reason.
        file.set_len(0)?;
        return Ok(Turn::Ours(Ours { file, path: path.to_owned() }));
    }
    let mut reason = String::new();
    file.read_to_string(&mut reason)?;
    Ok(match reason.is_empty() {
        true => Turn::Over,
        false => Turn::Failed(serde_json::from_str(&reason).unwrap_or_else(|_| Error::new(reason))),
    })
}

fn is_same(one: &Metadata, other: &Metadata) -> bool {
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

impl Ours {
    /// Tells those who wait why the file could not be made.
    pub fn fail(mut self, reason: &Error) {
        // If this cannot be written, they find out for themselves.
        let _ = serde_json::to_writer(&mut self.file, reason);
    }
}

impl Drop for Ours {
    fn drop(&mut self) {
        // If it cannot be removed, the next one takes it over. The lock is given back here and not when the file is
        // closed, because a program that is being started may have it open for a moment.
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ours(turn: Turn) -> Ours {
        match turn {
            Turn::Ours(ours) => ours,
            Turn::Over => panic!("it is over"),
            Turn::Failed(reason) => panic!("{reason}"),
        }
    }

    #[test]
    fn a_waiting_thread_gets_the_result_and_the_next_one_begins_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.turn");
        let first = ours(take_turn(&path).unwrap());
        let (one, two) = (open(&path).unwrap(), open(&path).unwrap());
        assert!(matches!(one.try_lock(), Err(std::fs::TryLockError::WouldBlock)));
        let reason = Error::of(pdk_sdk::error::ErrorKind::Configuration, "the disk is full");
        first.fail(&reason);
        for waiting in [one, two] {
            assert!(matches!(wait(waiting, &path).unwrap(), Turn::Failed(found) if found == reason));
        }
        let second = ours(take_turn(&path).unwrap());
        let waiting = open(&path).unwrap();
        drop(second);
        assert!(matches!(wait(waiting, &path).unwrap(), Turn::Over));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_a_killed_process_left_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.turn");
        std::fs::write(&path, "half a rea").unwrap();
        let turn = ours(take_turn(&path).unwrap());
        let waiting = open(&path).unwrap();
        drop(turn);
        assert!(matches!(wait(waiting, &path).unwrap(), Turn::Over));
    }
}
