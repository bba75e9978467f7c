//! The workspace: what it is called, where it lies, what is built from it.

use std::path::{Path, PathBuf};
use std::process::Command;

use cargo_metadata::{Metadata, MetadataCommand, Package};
use clap::ValueEnum;
use pdk_model::error::{Error, Place, Result};

/// The package with the extension module for Python.
const PYTHON: &str = "pdk-python";
/// The package with the executable.
pub const EXECUTABLE: &str = "pdk";

/// A system that packages are for: Linux with glibc, on one of these processors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// Intel and AMD
    #[value(name = "x86-64")]
    X86,
    /// ARM with 64 bits
    #[value(name = "aarch64")]
    Arm,
}

impl Target {
    /// The system of this machine, for which packages are made unless another one is named.
    pub const HERE: Self = if cfg!(target_arch = "aarch64") { Self::Arm } else { Self::X86 };

    /// The system as Rust calls it.
    pub fn triple(self) -> &'static str {
        match self {
            Self::X86 => "x86_64-unknown-linux-gnu",
            Self::Arm => "aarch64-unknown-linux-gnu",
        }
    }

    /// The processor as the names of archives and wheels have it.
    pub fn machine(self) -> &'static str {
        match self {
            Self::X86 => "x86_64",
            Self::Arm => "aarch64",
        }
    }

    /// The processor as Debian calls it.
    pub fn debian(self) -> &'static str {
        match self {
            Self::X86 => "amd64",
            Self::Arm => "arm64",
        }
    }
}

/// The workspace.
pub struct Project {
    metadata: Metadata,
    target: Target,
}

impl Project {
    /// The workspace that this program was built from, and the system that packages are for.
    ///
    /// # Errors
    /// If cargo cannot read it.
    pub fn for_target(target: Target) -> Result<Self> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
        let mut command = MetadataCommand::new();
        command.manifest_path(manifest).other_options(["--filter-platform".into(), target.triple().into()]);
        Ok(Self { metadata: command.exec().place("cargo cannot read the workspace")?, target })
    }

    /// The system that packages are for.
    pub fn target(&self) -> Target {
        self.target
    }

    /// Whether what is compiled runs on this machine.
    pub fn runs_here(&self) -> bool {
        self.target == Target::HERE
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
        Ok(format!("pdk-{}-{}-linux", self.executable()?.version, self.target.machine()))
    }
}

/// Installs a tool of Cargo below `target/pdk-dist`, if it is not there yet, and returns it.
///
/// # Errors
/// If Cargo cannot install it.
pub fn install(project: &Project, name: &str, version: &str, options: &[&str]) -> Result<PathBuf> {
    let tools = project.out().join("tools");
    let tool = tools.join("bin").join(name);
    // Cargo does nothing if this version is installed, but has to ask the package index for that.
    let is_there = output(Command::new(&tool).arg("--version"));
    if !is_there.is_ok_and(|said| String::from_utf8_lossy(&said).contains(version)) {
        let mut install = Command::new("cargo");
        install.args(["install", name, "--locked", "--version", version, "--root"]).arg(&tools);
        succeed(install.args(options))?;
    }
    Ok(tool)
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
