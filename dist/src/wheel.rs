//! The Python package: a wheel with the tree beside the modules, which maturin makes.
//!
//! ```text
//! pdk_perturb/             the modules of sdk/python, and the extension module
//! pdk_perturb/installation the tree
//! pdk_driver.py            for drivers in another process, and pdk_simulator.py for simulators
//! ```

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use pdk_model::error::{Error, Place, Result};
use toml_edit::{DocumentMut, value};
use walkdir::WalkDir;

use crate::Profile;
use crate::compile::GLIBC;
use crate::project::{Project, output, succeed};

/// The folder of the package in the workspace.
const SOURCE: &str = "sdk/python";
/// What of it becomes part of the wheel.
const PARTS: [&str; 6] =
    ["pyproject.toml", "README.md", "LICENSE", "pdk_driver.py", "pdk_simulator.py", "pdk_perturb"];
/// Where the tree lies in the wheel, which the package knows.
const INSTALLATION: &str = "pdk_perturb/installation";

/// Makes the wheel, and returns it. The extension module is compiled here.
///
/// # Errors
/// If maturin is missing or fails, or a file cannot be written.
pub fn pack(project: &Project, tree: &Path, profile: Profile) -> Result<PathBuf> {
    let maturin = maturin()?;
    let folder = project.out().join("wheel");
    if folder.exists() {
        fs::remove_dir_all(&folder).place(folder.display())?;
    }
    let source = project.root().join(SOURCE);
    for part in PARTS {
        copy(&source.join(part), &folder.join(part))?;
    }
    copy(tree, &folder.join(INSTALLATION))?;
    name_manifest(&folder.join("pyproject.toml"), &source.join("Cargo.toml"))?;

    let wheels = folder.join("wheels");
    let (program, arguments) = maturin.split_first().unwrap_or((&"maturin", &[]));
    let mut command = Command::new(program);
    command.current_dir(&folder).args(arguments).arg("build").arg("--out").arg(&wheels);
    match profile {
        Profile::Release => command.args(["--release", "--compatibility", "linux"]),
        Profile::Dist => {
            let compatibility = format!("manylinux_{}", GLIBC.replace('.', "_"));
            command.args([
                "--profile",
                "dist",
                "--zig",
                "--target",
                project.target().triple(),
                "--compatibility",
                &compatibility,
                "--compression-level",
                "9",
            ])
        }
    };
    succeed(&mut command)?;
    let made = fs::read_dir(&wheels).place(wheels.display())?.filter_map(|entry| Some(entry.ok()?.path()));
    let made = made.into_iter().next().ok_or_else(|| Error::new("maturin has made no wheel"))?;
    let wheel = project.out().join(made.file_name().unwrap_or_default());
    fs::rename(&made, &wheel).place(wheel.display())?;
    Ok(wheel)
}

/// How maturin is started.
fn maturin() -> Result<&'static [&'static str]> {
    const WAYS: [&[&str]; 2] = [&["maturin"], &["python3", "-m", "maturin"]];
    let works = |way: &&[&str]| output(Command::new(way[0]).args(&way[1..]).arg("--version")).is_ok();
    WAYS.into_iter().find(works).ok_or_else(|| {
        Error::new("maturin is missing, which makes the Python package; `pip install maturin` installs it")
    })
}

/// Copies a file, or a folder with all that is in it; what may be executed still may.
fn copy(from: &Path, to: &Path) -> Result<()> {
    for entry in WalkDir::new(from).sort_by_file_name() {
        let entry = entry.place(from.display())?;
        let place = entry.path().strip_prefix(from).place(from.display())?;
        // A link to a file is copied as the file.
        if !entry.path().is_file() || place.components().any(|part| part.as_os_str() == "__pycache__") {
            continue;
        }
        let place = if place.as_os_str().is_empty() { to.to_owned() } else { to.join(place) };
        place.parent().map_or(Ok(()), fs::create_dir_all).place(place.display())?;
        fs::copy(entry.path(), &place).place(place.display())?;
    }
    Ok(())
}

/// Says in the copy where the crate of the extension module lies.
fn name_manifest(project: &Path, manifest: &Path) -> Result<()> {
    let text = fs::read_to_string(project).place(project.display())?;
    let mut document: DocumentMut = text.parse().place(project.display())?;
    document["tool"]["maturin"]["manifest-path"] = value(manifest.to_string_lossy().into_owned());
    fs::write(project, document.to_string()).place(project.display())
}
