//! Opens files that users name. What is no regular file may never end, or never begin; and what is read whole has to fit into
//! memory, whatever its size is said to be.

use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::OFlags;

use crate::error::{Error, Place, Result};

/// Opens a regular file to read it, and tells how many bytes it has. A pipe or a device is refused and not waited for.
///
/// # Errors
/// Where there is no such file, it cannot be read, or it is something else.
pub fn open(path: &Path) -> Result<(File, u64)> {
    open_if_there(path)?.ok_or_else(|| Error::new("it does not exist"))
}

/// As [`open`]; none where there is no such file.
///
/// # Errors
/// Where it cannot be read, or is something else than a regular file.
pub fn open_if_there(path: &Path) -> Result<Option<(File, u64)>> {
    let metadata = match std::fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(Error::from(error).at("it cannot be read")),
    };
    // Some devices do something when they are opened, so this is asked before; and once more behind, for what was
    // exchanged meanwhile. To open a pipe would wait for its writer.
    check(&metadata)?;
    let flags = OFlags::NONBLOCK.bits() as i32;
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path).place("it cannot be read")?;
    let metadata = file.metadata().place("it cannot be read")?;
    check(&metadata)?;
    Ok(Some((file, metadata.len())))
}

/// Reads a regular file whole.
///
/// # Errors
/// As [`open`], and where it has more than `largest` bytes.
pub fn read(path: &Path, largest: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path)?;
    let mut bytes = Vec::with_capacity(length.min(largest) as usize);
    // The length is not believed: files of the system have none, and others may grow.
    file.take(largest + 1).read_to_end(&mut bytes).place("it cannot be read")?;
    match bytes.len() as u64 > largest {
        true => Err(Error::new(format!(
            "it has more than {}, which is too large for what it is to be",
            Size(largest)
        ))),
        false => Ok(bytes),
    }
}

/// Reads a regular file of UTF-8 whole.
///
/// # Errors
/// As [`read`], and where it is not UTF-8.
pub fn read_text(path: &Path, largest: u64) -> Result<String> {
    let text = String::from_utf8(read(path, largest)?);
    text.map_err(|error| {
        Error::new(format!("it is not text: byte {} is not UTF-8", error.utf8_error().valid_up_to()))
    })
}

fn check(metadata: &Metadata) -> Result<()> {
    let kind = metadata.file_type();
    match kind.is_file() {
        true => Ok(()),
        false => {
            Err(Error::new(format!("it is {}, and only regular files are read; name a file", name(kind))))
        }
    }
}

fn name(kind: FileType) -> &'static str {
    match kind {
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a pipe",
        kind if kind.is_socket() => "a socket",
        _ => "a device",
    }
}

/// Bytes as people write them.
struct Size(u64);

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            bytes if bytes >= 1 << 20 => write!(f, "{} MiB", bytes >> 20),
            bytes => write!(f, "{} KiB", bytes >> 10),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder that goes with the test.
    struct Folder(std::path::PathBuf);

    impl Folder {
        fn new() -> Self {
            let folder = std::env::temp_dir().join(format!("pdk-sdk-file-{}", std::process::id()));
            let _ = std::fs::remove_dir_all(&folder);
            std::fs::create_dir(&folder).unwrap();
            Self(folder)
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            std::fs::remove_dir_all(&self.0).unwrap();
        }
    }

    #[test]
    fn regular_files_are_read_and_everything_else_is_refused_and_not_waited_for() {
        let folder = Folder::new();
        let path = |name: &str| folder.0.join(name);
        assert!(std::process::Command::new("mkfifo").arg(path("fifo")).status().unwrap().success());
        std::os::unix::fs::symlink("/dev/zero", path("zero")).unwrap();
        std::fs::create_dir(path("folder")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
        for (name, kind) in
            [("fifo", "a pipe"), ("zero", "a device"), ("folder", "a folder"), ("socket", "a socket")]
        {
            let expected = format!("it is {kind}, and only regular files are read; name a file");
            assert_eq!(open(&path(name)).unwrap_err().to_string(), expected);
            assert_eq!(read(&path(name), 1 << 20).unwrap_err().to_string(), expected);
        }
        assert_eq!(open(&path("none")).unwrap_err().to_string(), "it does not exist");
        assert!(open_if_there(&path("none")).unwrap().is_none());
        std::fs::write(path("some"), "seven b").unwrap();
        std::os::unix::fs::symlink(path("some"), path("link")).unwrap();
        assert_eq!(open(&path("link")).unwrap().1, 7);
        assert_eq!(read_text(&path("link"), 7).unwrap(), "seven b");
        std::fs::write(path("large"), vec![0xff; 2048]).unwrap();
        let error = |largest| read_text(&path("large"), largest).unwrap_err().to_string();
        assert_eq!(error(1024), "it has more than 1 KiB, which is too large for what it is to be");
        assert_eq!(error(2048), "it is not text: byte 0 is not UTF-8");
        // It has no length, and no end that is far.
        assert!(!read(Path::new("/proc/self/maps"), 1 << 20).unwrap().is_empty());
    }
}
