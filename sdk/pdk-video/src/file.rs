//! Opens files that users name. What is no regular file may never end, or never begin.

use std::fs::{File, FileType, Metadata, OpenOptions};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use rustix::fs::OFlags;

/// Opens a regular file to read it, and tells how many bytes it has. A pipe or a device is refused and not waited for.
///
/// # Errors
/// Where there is no such file, it cannot be read, or it is something else.
pub fn regular_file(path: &Path) -> Result<(File, u64)> {
    let unreadable = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => Error::new("it does not exist"),
        _ => Error::from(error).at("it cannot be read"),
    };
    // Some devices do something when they are opened, so this is asked before; and once more behind, for what was
    // exchanged meanwhile. To open a pipe would wait for its writer.
    check(&std::fs::metadata(path).map_err(unreadable)?)?;
    let flags = OFlags::NONBLOCK.bits() as i32;
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path).map_err(unreadable)?;
    let metadata = file.metadata().place("it cannot be read")?;
    check(&metadata)?;
    Ok((file, metadata.len()))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Reader;

    #[test]
    fn what_is_no_regular_file_is_refused_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let made = std::process::Command::new("mkfifo").arg(path("fifo.mp4")).status().unwrap();
        assert!(made.success());
        std::os::unix::fs::symlink("/dev/zero", path("zero.mp4")).unwrap();
        std::fs::create_dir(path("folder.mp4")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket.mp4")).unwrap();
        for (name, kind) in [
            ("fifo.mp4", "a pipe"),
            ("zero.mp4", "a device"),
            ("folder.mp4", "a folder"),
            ("socket.mp4", "a socket"),
        ] {
            let expected = format!("it is {kind}, and only regular files are read; name a file");
            assert_eq!(regular_file(&path(name)).unwrap_err().to_string(), expected);
            assert_eq!(Reader::open_file(&path(name)).err().unwrap().to_string(), expected);
        }
        assert_eq!(regular_file(&path("none.mp4")).unwrap_err().to_string(), "it does not exist");
        std::fs::write(path("some.mp4"), "seven b").unwrap();
        std::os::unix::fs::symlink(path("some.mp4"), path("link.mp4")).unwrap();
        assert_eq!(regular_file(&path("link.mp4")).unwrap().1, 7);
    }
}
