//! The workspace: what it is called, where it lies, what is built from it.

use std::path::{Path, PathBuf};
use std::process::Command;

use cargo_metadata::{Metadata, MetadataCommand, Package};
use pdk_model::error::{Error, Place, Result};

/// The system that archives are for, as Rust calls it.
pub const TARGET: &str = "x86_64-unknown-linux-gnu";
/// The package with the extension module for Python.
const PYTHON: &str = "pdk-python";
/// The package with the executable.
pub const EXECUTABLE: &str = "pdk";

/// The workspace.
pub struct Project {
    metadata: Metadata,
}

impl Project {
    /// The workspace that this program was built from.
    ///
    /// # Errors
    /// If cargo cannot read it.
    pub fn here() -> Result<Self> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
        let mut command = MetadataCommand::new();
        command.manifest_path(manifest).other_options(["--filter-platform".into(), TARGET.into()]);
        Ok(Self { metadata: command.exec().place("cargo cannot read the workspace")? })
    }

    /// All packages, with those that they depend on.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The folder of the workspace.
    pub fn root(&self) -> &Path {
        self.metadata.workspace_root.as_std_path()
    }

    /// The folder that everything is written to.
    pub fn out(&self) -> PathBuf {
        self.root().join("target/pdk-dist")
    }

    /// The package with the executable.
    ///
    /// # Errors
    /// If there is none.
    pub fn executable(&self) -> Result<&Package> {
        self.named(EXECUTABLE)
    }

    fn named(&self, name: &str) -> Result<&Package> {
        let mut packages = self.metadata.workspace_packages().into_iter();
        let found = packages.find(|package| package.name.as_str() == name);
        found.ok_or_else(|| Error::new(format!("the workspace has no package `{name}`")))
    }

    /// The package with the extension module for Python.
    ///
    /// # Errors
    /// If there is none.
    pub fn python(&self) -> Result<&Package> {
        self.named(PYTHON)
    }

    /// The packages with the built-in components.
    pub fn plugins(&self) -> Vec<&Package> {
        let folder = self.root().join("plugins");
        let packages = self.metadata.workspace_packages().into_iter();
        packages.filter(|package| package.manifest_path.starts_with(&folder)).collect()
    }

    /// The name of the archive without its ending, and of the folder in it.
    ///
    /// # Errors
    /// If there is no package with the executable.
    pub fn title(&self) -> Result<String> {
        Ok(format!("pdk-{}-x86_64-linux", self.executable()?.version))
    }
}

/// Runs a program to its end, with its output where this one's goes.
///
/// # Errors
/// If it cannot be started or fails.
pub fn succeed(command: &mut Command) -> Result<()> {
    let shown = format!("{command:?}");
    eprintln!("== {shown}");
    let status = command.status().place(format_args!("cannot start {shown}"))?;
    if status.success() { Ok(()) } else { Err(Error::new(format!("{shown} failed ({status})"))) }
}

/// Runs a program to its end, and returns what it wrote to standard output.
///
/// # Errors
/// If it cannot be started or fails.
pub fn output(command: &mut Command) -> Result<Vec<u8>> {
    let shown = format!("{command:?}");
    let output = command.output().place(format_args!("cannot start {shown}"))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(Error::new(format!("{shown} failed ({}): {}", output.status, said.trim())))
}
