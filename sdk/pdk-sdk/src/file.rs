//! Opens files that users name, and writes files whole. Reading a file that is not a regular one may never end, or never begin; and what is read
//! whole has to fit into memory, whatever size the system reports.

use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;

use crate::error::{Error, Place, Result};

/// Opens a regular file to read it, and tells how many bytes it has. A pipe or a device is refused and not waited for.
///
/// # Errors
/// If there is no such file, it cannot be read, or it is something else.
pub fn open(path: &Path) -> Result<(File, u64)> {
    open_if_there(path)?.ok_or_else(|| Error::new("it does not exist"))
}

/// As [`open`]; none if there is no such file.
///
/// # Errors
/// If it cannot be read, or is something else than a regular file.
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
/// As [`open`], and if it has more than `largest` bytes.
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
/// As [`read`], and if it is not UTF-8.
pub fn read_text(path: &Path, largest: u64) -> Result<String> {
    let text = String::from_utf8(read(path, largest)?);
    text.map_err(|error| {
        Error::new(format!("it is not text: byte {} is not UTF-8", error.utf8_error().valid_up_to()))
    })
}

/// Writes a file as a whole: when this fails, or the process ends on the way, the file is what it was before.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |file| file.write_all(bytes))
}

/// As [`write()`], for content that is written piece by piece.
///
/// # Errors
/// What `fill` returns, and if the file cannot be written.
pub fn write_with<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    // A link stays, and the file that it names is replaced.
    let path = &std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let before = std::fs::metadata(path).ok();
    if before.as_ref().is_some_and(|before| !before.is_file() && !before.is_dir()) {
        // A pipe or a device, such as /dev/stdout, cannot be replaced.
        let mut file = BufWriter::new(OpenOptions::new().write(true).open(path)?);
        fill(&mut file)?;
        return Ok(file.flush()?);
    }
    let part = part_of(path);
    let written = File::create(&part).map_err(E::from).and_then(|file| {
        let mut file = BufWriter::new(file);
        fill(&mut file)?;
        let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
        if let Some(before) = before {
            file.set_permissions(before.permissions())?;
        }
        file.sync_all()?;
        Ok(std::fs::rename(&part, path)?)
    });
    if written.is_err() {
        // If it cannot be removed either, what stays does not have the name of the whole file.
        let _ = std::fs::remove_file(&part);
    }
    written
}

/// Where a file is until it is whole: beside its place, with the number of this process and `.part` behind its name.
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    name.into()
}

/// The name of the file that a part is of; none for other names.
pub fn whole_of(name: &str) -> Option<&str> {
    let (whole, process) = name.strip_suffix(".part")?.rsplit_once('.')?;
    (!process.is_empty() && process.bytes().all(|byte| byte.is_ascii_digit())).then_some(whole)
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
        fn new(name: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("pdk-sdk-{name}-{}", std::process::id()));
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
    fn a_file_is_written_whole_or_stays_what_it_was() {
        let folder = Folder::new("written");
        let path = folder.0.join("out.bin");
        let link = folder.0.join("link");
        std::os::unix::fs::symlink("out.bin", &link).unwrap();
        write(&path, b"first").unwrap();
        std::fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(0o640)).unwrap();
        let failed = write_with(&path, |file| {
            file.write_all(b"half")?;
            file.flush()?;
            assert_eq!(std::fs::read(part_of(&path)).unwrap(), b"half");
            Err(io::Error::from(ErrorKind::StorageFull))
        });
        assert_eq!(failed.unwrap_err().kind(), ErrorKind::StorageFull);
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        write(&link, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        let mode = std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(&path).unwrap().permissions());
        assert_eq!(mode & 0o777, 0o640);
        assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 2, "a part is left");
        write(Path::new("/dev/null"), b"anything").unwrap();
        let part = part_of(Path::new("a.b.json"));
        assert_eq!(whole_of(part.to_str().unwrap()), Some("a.b.json"));
        assert_eq!((whole_of("a.json.part"), whole_of("a.json")), (None, None));
    }

    #[test]
    fn regular_files_are_read_and_everything_else_is_refused_and_not_waited_for() {
        let folder = Folder::new("file");
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
