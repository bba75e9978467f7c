//! Installations of the built `pdk` away from the source tree.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::{Pdk, built, built_in_libraries, temp};

/// `pdk` with its libraries in a place where nothing of the source tree is near, and which cannot be written to.
pub struct Installation {
    place: TempDir,
    executable: PathBuf,
}

impl Installation {
    /// Everything in one folder.
    pub fn copies() -> Self {
        Self::new("anywhere", "anywhere")
    }

    /// The executable in `bin` and the libraries in `lib/pdk`, as archives have them.
    pub fn unpacked() -> Self {
        Self::new("pdk/bin", "pdk/lib/pdk")
    }

    fn new(executables: &str, libraries: &str) -> Self {
        let place = temp();
        let copy = |file: &Path, folder: &str| {
            let folder = place.path().join(folder);
            fs::create_dir_all(&folder).unwrap();
            let target = folder.join(file.file_name().unwrap());
            fs::copy(file, &target).unwrap();
            target
        };
        let executable = copy(&built("pdk"), executables);
        for library in built_in_libraries() {
            copy(&library, libraries);
        }
        let installation = Self { place, executable };
        installation.protect(0o555);
        installation
    }

    /// Where it lies.
    pub fn folder(&self) -> &Path {
        self.place.path()
    }

    /// The executable.
    pub fn executable(&self) -> &Path {
        &self.executable
    }

    /// `pdk` from here, in an empty environment.
    pub fn pdk(&self) -> Pdk {
        Pdk::program(self.executable.to_str().unwrap()).bare()
    }

    /// Sets what may be done with all folders.
    fn protect(&self, mode: u32) {
        let mut folders = vec![self.place.path().to_owned()];
        while let Some(folder) = folders.pop() {
            fs::set_permissions(&folder, Permissions::from_mode(mode)).unwrap();
            let entries = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
            folders.extend(entries.filter(|path| path.is_dir()));
        }
    }

    /// Takes a file away.
    ///
    /// # Panics
    /// If it is not there.
    pub fn remove(&self, file: &str) {
        self.protect(0o755);
        fs::remove_file(self.place.path().join(file)).unwrap();
        self.protect(0o555);
    }
}

impl Drop for Installation {
    fn drop(&mut self) {
        // Or the folder stays.
        self.protect(0o755);
    }
}
