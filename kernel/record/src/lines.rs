//! Files of lines that are only ever added to. What a process that ended early left of a last line is removed.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;

/// A file of lines that is open for adding.
pub struct Lines {
    path: PathBuf,
    file: File,
    /// Up to here, in bytes, the file holds complete lines.
    complete: u64,
}

impl Lines {
    /// Opens a file, and returns the complete lines that are in it. A last line that was cut off is removed.
    ///
    /// # Errors
    /// If it cannot be read or written.
    pub fn open(path: &Path) -> Result<(Self, Vec<u8>)> {
        let failed = |error| write_error(path, &error);
        // What is there has to be a file: to write to a pipe would wait for its reader.
        file::open_if_there(path).place(path.display())?;
        let file = File::options().create(true).append(true).open(path).map_err(failed)?;
        let mut text = fs::read(path).map_err(failed)?;
        let complete = complete(&text);
        if complete < text.len() {
            file.set_len(complete as u64).map_err(failed)?;
            text.truncate(complete);
        }
        // What is there counts from now on, and the process that wrote it may have ended before it was on the disk.
        file.sync_all().map_err(failed)?;
        sync_folder(path);
        Ok((Self { path: path.to_owned(), file, complete: complete as u64 }, text))
    }

    /// Goes on with the file that has taken the place of this one, and holds this many bytes of complete lines.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn replaced(&mut self, complete: u64) -> Result<()> {
        let opened = File::options().append(true).open(&self.path);
        self.file = opened.map_err(|error| write_error(&self.path, &error))?;
        self.complete = complete;
        Ok(())
    }

    /// The length of the file in bytes.
    pub fn length(&self) -> u64 {
        self.complete
    }

    /// Forgets what lies behind this length.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn truncate(&mut self, length: u64) -> Result<()> {
        self.file.set_len(length).map_err(|error| write_error(&self.path, &error))?;
        self.complete = length;
        Ok(())
    }

    /// Adds lines, each with its line feed. If that fails, what was written of them is taken back, so that the file holds
    /// complete lines only.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn add(&mut self, lines: &[u8]) -> Result<()> {
        match self.file.write_all(lines) {
            Ok(()) => {
                self.complete += lines.len() as u64;
                Ok(())
            }
            Err(error) => {
                // The first error is the one to report; a second one here would say the same.
                let _ = self.file.set_len(self.complete);
                Err(write_error(&self.path, &error))
            }
        }
    }

    /// Makes sure that the lines survive a power cut.
    ///
    /// # Errors
    /// If the disk does not take them.
    pub fn sync(&mut self) -> Result<()> {
        self.file.sync_data().map_err(|error| write_error(&self.path, &error))
    }
}

/// Makes sure that a file that was made or renamed is there after a power cut; some file systems cannot.
pub fn sync_folder(path: &Path) {
    let folder =
        path.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    if let Some(Ok(folder)) = folder.map(File::open) {
        let _ = folder.sync_all();
    }
}

/// How many bytes of a text are complete lines.
pub fn complete(text: &[u8]) -> usize {
    text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1)
}

/// What went wrong with writing, and what to do.
pub fn write_error(path: &Path, error: &std::io::Error) -> Error {
    let remedy = match error.kind() {
        std::io::ErrorKind::StorageFull
        | std::io::ErrorKind::QuotaExceeded
        | std::io::ErrorKind::FileTooLarge => {
            "; free some space and run again, what was recorded so far is kept"
        }
        std::io::ErrorKind::PermissionDenied | std::io::ErrorKind::ReadOnlyFilesystem => {
            "; choose another folder with --out"
        }
        _ => "",
    };
    Error::new(format!("cannot write {} ({error}){remedy}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_was_cut_off_is_removed() {
        let path = std::env::temp_dir().join(format!("pdk-lines-{}.jsonl", std::process::id()));
        let (mut lines, before) = Lines::open(&path).unwrap();
        assert!(before.is_empty());
        lines.add(b"one\ntwo\n").unwrap();
        lines.add(b"thr").unwrap();
        drop(lines);
        let (mut lines, before) = Lines::open(&path).unwrap();
        assert_eq!((before.as_slice(), lines.length()), (&b"one\ntwo\n"[..], 8));
        lines.truncate(4).unwrap();
        lines.add(b"2\n").unwrap();
        lines.sync().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one\n2\n");
        fs::remove_file(path).unwrap();
    }
}
