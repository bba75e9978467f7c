//! Finds ONNX Runtime's shared library on the machine.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;

/// The variable that names the library.
const VARIABLE: &str = "PDK_ONNXRUNTIME";

/// How to come by the library.
const REMEDY: &str = "`pip install onnxruntime` makes it available, or set PDK_ONNXRUNTIME to its shared library \
                          (libonnxruntime.so)";

/// What to do if the executor of pdk cannot run a model.
pub fn alternative() -> String {
    format!("ONNX Runtime may be able to: {REMEDY}")
}

/// Where to look.
pub struct Search {
    /// What the environment variable says.
    named: Option<PathBuf>,
    /// The folders into which Python packages are installed, the nearest first.
    packages: Vec<PathBuf>,
}

/// A library that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// Where it is.
    pub path: PathBuf,
    /// The minor version that its name says; nothing if it says none.
    minor: Option<u32>,
}

impl Search {
    /// Looks where the environment says: `PDK_ONNXRUNTIME`, then the packages of the active virtual or Conda
    /// environment, of each Python on the path, of the user, and of the system.
    pub fn from_environment() -> Self {
        let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let path = variable("PATH").unwrap_or_default();
        Self {
            named: variable(VARIABLE).map(PathBuf::from),
            packages: package_folders(&prefixes(
                [variable("VIRTUAL_ENV"), variable("CONDA_PREFIX")].into_iter().flatten(),
                &path,
                variable("HOME").map(PathBuf::from).as_deref(),
            )),
        }
    }

    /// The library to use; nothing if there is none that is recent enough.
    ///
    /// # Errors
    /// If the environment variable names a file that is not there.
    pub fn find(&self) -> Result<Option<Found>> {
        if let Some(path) = &self.named {
            return if path.is_file() {
                Ok(Some(Found { path: path.clone(), minor: None }))
            } else {
                Err(Error::new(format!("{VARIABLE} names `{}`, which is not a file", path.display())))
            };
        }
        Ok(self.installed().find(Found::recent))
    }

    /// The library, where the user asks for it.
    ///
    /// # Errors
    /// If it is not there, with what to do.
    pub fn require(&self) -> Result<PathBuf> {
        if let Some(found) = self.find()? {
            return Ok(found.path);
        }
        Err(Error::new(match self.installed().next() {
            Some(old) => format!(
                "the ONNX Runtime at `{}` is too old: version 1.{} or later is needed; `pip install --upgrade \
                 onnxruntime` replaces it",
                old.path.display(),
                ort::MINOR_VERSION
            ),
            None => format!("ONNX Runtime is not installed: {REMEDY}"),
        }))
    }

    fn installed(&self) -> impl Iterator<Item = Found> {
        self.packages.iter().flat_map(|folder| libraries(&folder.join("onnxruntime/capi")))
    }
}

impl Found {
    fn recent(&self) -> bool {
        self.minor.is_none_or(|minor| minor >= ort::MINOR_VERSION)
    }
}

/// The folders under which a Python keeps its `lib`.
fn prefixes(active: impl Iterator<Item = OsString>, path: &OsString, home: Option<&Path>) -> Vec<PathBuf> {
    let mut prefixes: Vec<PathBuf> = active.map(PathBuf::from).collect();
    for folder in std::env::split_paths(path) {
        let python = folder.join("python3");
        // A virtual environment's Python is a link to the real one, and both have packages.
        let real = python.canonicalize().ok();
        let programs = real.map(|real| [python, real]).into_iter().flatten();
        prefixes.extend(programs.filter_map(|program| Some(program.parent()?.parent()?.to_path_buf())));
    }
    if let Some(home) = home {
        prefixes.push(home.join(".local"));
        prefixes.extend(sorted(&home.join(".pyenv/versions")));
    }
    prefixes.extend(["/usr/local", "/usr"].map(PathBuf::from));
    prefixes
}

/// The folders of packages under these prefixes, each once.
fn package_folders(prefixes: &[PathBuf]) -> Vec<PathBuf> {
    let mut folders = Vec::new();
    for prefix in prefixes {
        let lib = prefix.join("lib");
        for python in sorted(&lib).into_iter().filter(|entry| {
            entry.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with("python3"))
        }) {
            folders.extend(["site-packages", "dist-packages"].map(|packages| python.join(packages)));
        }
        // On Windows.
        folders.push(prefix.join("Lib/site-packages"));
    }
    let mut kept: Vec<PathBuf> = Vec::new();
    for folder in folders {
        if folder.is_dir() && !kept.contains(&folder) {
            kept.push(folder);
        }
    }
    kept
}

/// The libraries in the package's own folder.
fn libraries(folder: &Path) -> Vec<Found> {
    let library = |path: PathBuf| {
        let name = path.file_name()?.to_str()?;
        let rest = name.strip_prefix(std::env::consts::DLL_PREFIX)?.strip_prefix("onnxruntime.")?;
        let is_library = rest.split('.').any(|part| part == std::env::consts::DLL_EXTENSION);
        let mut numbers = rest.split('.').filter_map(|part| part.parse::<u32>().ok());
        let minor = numbers.nth(1);
        is_library.then_some(Found { path, minor })
    };
    sorted(folder).into_iter().filter_map(library).collect()
}

/// What a folder contains, the last name first, so that newer versions come before older ones; nothing if there
/// is not such a folder.
fn sorted(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .map(|entries| entries.flatten().map(|entry| entry.path()).collect())
        .unwrap_or_default();
    entries.sort();
    entries.reverse();
    entries
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;
    use tempfile::TempDir;

    /// An environment with a library of this name in its `onnxruntime` package.
    fn environment(library: &str) -> TempDir {
        let dir = TempDir::new().unwrap();
        let capi = dir.path().join("lib/python3.11/site-packages/onnxruntime/capi");
        std::fs::create_dir_all(&capi).unwrap();
        for name in [library, "libonnxruntime_providers_shared.so", "onnxruntime_pybind11_state.so"] {
            std::fs::write(capi.join(name), "").unwrap();
        }
        dir
    }

    fn search(environments: &[&TempDir]) -> Search {
        let prefixes: Vec<_> = environments.iter().map(|dir| dir.path().to_path_buf()).collect();
        Search { named: None, packages: package_folders(&prefixes) }
    }

    #[test]
    fn the_nearest_recent_package_is_taken() {
        let (old, recent) =
            (environment("libonnxruntime.so.1.16.3"), environment("libonnxruntime.so.1.31.1"));
        let found = search(&[&old, &recent]).find().unwrap().unwrap();
        assert!(found.path.starts_with(recent.path()) && found.path.ends_with("libonnxruntime.so.1.31.1"));
        assert_eq!(found.minor, Some(31));
        let unversioned = environment("libonnxruntime.so");
        let found = search(&[&unversioned, &recent]).find().unwrap().unwrap();
        assert!(found.path.starts_with(unversioned.path()));
    }

    #[test]
    fn a_missing_or_old_library_is_reported_with_the_remedy() {
        assert_eq!(search(&[]).find().unwrap(), None);
        let missing = search(&[]).require().unwrap_err().to_string();
        assert!(missing.starts_with("ONNX Runtime is not installed: `pip install onnxruntime`"), "{missing}");
        let old = environment("libonnxruntime.so.1.16.3");
        assert_eq!(search(&[&old]).find().unwrap(), None);
        let error = search(&[&old]).require().unwrap_err().to_string();
        assert!(
            error.contains("is too old") && error.contains("1.16.3") && error.contains("--upgrade"),
            "{error}"
        );
    }

    #[test]
    fn the_variable_comes_first_and_has_to_name_a_file() {
        let dir = environment("libonnxruntime.so.1.31.1");
        let file = dir.path().join("mine.so");
        let named = |path: &Path| Search { named: Some(path.to_path_buf()), ..search(&[&dir]) };
        let error = named(&file).find().unwrap_err().to_string();
        assert!(error.starts_with("PDK_ONNXRUNTIME names `") && error.ends_with("which is not a file"));
        assert!(named(&file).require().is_err());
        std::fs::write(&file, "").unwrap();
        assert_eq!(named(&file).require().unwrap(), file);
    }

    #[test]
    fn a_python_on_the_path_leads_to_its_packages_and_to_those_of_the_real_one() {
        let (real, environment) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        for dir in [&real, &environment] {
            std::fs::create_dir(dir.path().join("bin")).unwrap();
        }
        std::fs::write(real.path().join("bin/python3"), "").unwrap();
        std::os::unix::fs::symlink(real.path().join("bin/python3"), environment.path().join("bin/python3"))
            .unwrap();
        let path = environment.path().join("bin").into_os_string();
        let found = prefixes([OsString::from("/active")].into_iter(), &path, Some(Path::new("/home/me")));
        let expected = [Path::new("/active"), environment.path(), &real.path().canonicalize().unwrap()];
        assert_eq!(found[..3], expected.map(Path::to_path_buf));
        assert!(found.contains(&PathBuf::from("/home/me/.local")) && found.contains(&PathBuf::from("/usr")));
    }
}
