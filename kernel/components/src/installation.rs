//! What an installation of pdk consists of, and where its parts lie, seen from the executable.
//!
//! | part | archive, Debian package | source tree, or copies in a folder |
//! |---|---|---|
//! | the executable | `PREFIX/bin/pdk` | `FOLDER/pdk` |
//! | the libraries with the built-in components | `PREFIX/lib/pdk` | `FOLDER` |
//! | the source of the SDK | `PREFIX/share/pdk/sdk` | `sdk` in a folder above |
//!
//! The Python package holds an archive's tree, and names the executable in it ([`set_executable`]).
//!
//! Scripts, networks and clips are part of the executable and the libraries, so that nothing else has to be found.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use pdk_sdk::error::{Error, Place, Result};

use crate::product::{self, Product};

/// The executable, where the running one is another program.
static EXECUTABLE: OnceLock<PathBuf> = OnceLock::new();

/// Says where the executable lies, for another program that has the kernel inside, such as Python. The first call counts.
pub fn set_executable(file: PathBuf) {
    EXECUTABLE.get_or_init(|| file);
}

/// The executable of pdk: the running one, unless [`set_executable`] has named another.
///
/// # Errors
/// If the system does not tell it.
pub fn executable() -> Result<PathBuf> {
    match EXECUTABLE.get() {
        Some(file) => Ok(file.clone()),
        None => std::env::current_exe().place("cannot find the pdk executable"),
    }
}

/// The folder of the executable, without symbolic links.
///
/// # Errors
/// If the system does not tell it.
pub fn executable_folder() -> Result<PathBuf> {
    let unknown = "the folder of the pdk executable is not known";
    let executable = std::fs::canonicalize(executable()?).place(unknown)?;
    let folder = executable.parent().ok_or_else(|| Error::new(unknown))?;
    // Test executables lie one folder below the libraries.
    let folder = folder.parent().filter(|_| folder.ends_with("deps")).unwrap_or(folder);
    Ok(folder.to_owned())
}

/// The folder of the built-in libraries.
///
/// # Errors
/// As [`executable_folder`].
pub fn library_folder() -> Result<PathBuf> {
    Ok(library_folder_of(&executable_folder()?))
}

fn library_folder_of(executables: &Path) -> PathBuf {
    let installed = executables.parent().map(|prefix| prefix.join("lib/pdk"));
    installed.filter(|folder| folder.is_dir()).unwrap_or_else(|| executables.to_owned())
}

/// The libraries of the built-in plugins. They are built together with the executable, and all of them have to be there.
///
/// # Errors
/// If one of them is missing, with the remedy.
pub fn libraries() -> Result<Vec<PathBuf>> {
    libraries_in(product::get(), &library_folder()?)
}

fn libraries_in(product: &Product, folder: &Path) -> Result<Vec<PathBuf>> {
    let (found, missing): (Vec<_>, Vec<_>) =
        product.libraries().map(|name| folder.join(name)).partition(|file| file.is_file());
    if missing.is_empty() {
        return Ok(found);
    }
    let names = missing.iter().filter_map(|file| file.file_name()).map(|name| name.to_string_lossy());
    let names = names.collect::<Vec<_>>().join(", ");
    let shown = folder.display();
    Err(Error::new(format!(
        "pdk is not complete: it does not find {} of its {} libraries in {shown} ({names}); unpack the whole archive or install the Python \
         package again, copy them there together with the executable, or build them with `cargo build --release`",
        missing.len(),
        product.plugins.len()
    )))
}

/// The folder with the source of the SDK: one folder for each of its crates, such as `pdk-sdk`.
///
/// # Errors
/// If there is none, with the remedy.
pub fn sdk() -> Result<PathBuf> {
    sdk_of(&executable_folder()?)
}

fn sdk_of(executables: &Path) -> Result<PathBuf> {
    let installed = executables.parent().map(|prefix| prefix.join("share/pdk/sdk"));
    let above = executables.ancestors().map(|folder| folder.join("sdk"));
    let found = installed.into_iter().chain(above).find(|folder| folder.join("pdk-sdk/Cargo.toml").is_file());
    found.ok_or_else(|| {
        Error::new(format!(
            "the source of the SDK is missing: it lies neither in ../share/pdk/sdk, seen from {}, nor in a folder above; unpack \
             the whole archive of pdk, or name the folder of the crate pdk-sdk with --sdk",
            executables.display()
        ))
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    static PRODUCT: Product = Product {
        plugins: &["one", "two"],
        perturbations: &[],
        pipelines: &[],
        scales: &[],
        suites: &[],
        modules: &[],
        domain: "",
        first_pipeline: "",
        examples: &[],
        samples: &[],
    };

    #[test]
    fn parts_are_found_in_an_installation_and_in_a_source_tree() {
        let folder = std::env::temp_dir().join(format!("pdk-installation-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        let write = |file: &Path| {
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "").unwrap();
        };
        let installed = folder.join("prefix/bin");
        fs::create_dir_all(&installed).unwrap();
        assert_eq!(library_folder_of(&installed), installed);
        let error = libraries_in(&PRODUCT, &installed).unwrap_err().to_string();
        let count = PRODUCT.plugins.len();
        assert!(error.contains(&format!("{count} of its {count} libraries in")), "{error}");
        assert!(sdk_of(&installed).unwrap_err().to_string().contains("--sdk"));

        let libraries = folder.join("prefix/lib/pdk");
        PRODUCT.libraries().for_each(|name| write(&libraries.join(name)));
        write(&folder.join("prefix/share/pdk/sdk/pdk-sdk/Cargo.toml"));
        assert_eq!(library_folder_of(&installed), libraries);
        assert_eq!(libraries_in(&PRODUCT, &libraries).unwrap().len(), count);
        assert_eq!(sdk_of(&installed).unwrap(), folder.join("prefix/share/pdk/sdk"));
        fs::remove_file(libraries.join("libpdk_two.so")).unwrap();
        let error = libraries_in(&PRODUCT, &libraries).unwrap_err().to_string();
        assert!(error.contains(&format!("1 of its {count} libraries")) && error.contains("(libpdk_two.so)"));

        write(&folder.join("tree/sdk/pdk-sdk/Cargo.toml"));
        assert_eq!(sdk_of(&folder.join("tree/target/release")).unwrap(), folder.join("tree/sdk"));
        fs::remove_dir_all(folder).unwrap();
    }
}
