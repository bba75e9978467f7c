//! Compiles the executable and the libraries.
//!
//! What is shipped has to run on older distributions than the one at hand, so it is linked against the symbols of an older glibc.
//! Zig's linker knows those of every version, and cargo-zigbuild makes cargo use it. Zig's C++ library and unwinder are linked
//! into each file, so that glibc is all that a machine needs.

use std::path::{Path, PathBuf};
use std::process::Command;

use pdk_model::error::{Error, Place, Result};

use crate::Profile;
use crate::project::{EXECUTABLE, Project, Target, output, succeed};

/// The glibc of Debian 10, Ubuntu 18.10 and RHEL 8.
pub const GLIBC: &str = "2.28";

/// The library for drivers in C and C++, as the linker looks for it.
pub const DRIVER_LIBRARY: &str = "libpdkdriver.so";

/// What was compiled.
pub struct Compiled {
    /// The executable.
    pub executable: PathBuf,
    /// An executable that runs on this machine, which writes completions and the manual.
    pub runnable: PathBuf,
    /// The libraries with the built-in components.
    pub libraries: Vec<PathBuf>,
    /// The library for drivers in C and C++.
    pub driver_library: PathBuf,
}

/// Compiles everything.
///
/// # Errors
/// If a tool is missing, with the remedy, or something does not compile.
pub fn run(project: &Project, profile: Profile) -> Result<Compiled> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(project.root());
    let triple = project.target().triple();
    let target = project.metadata().target_directory.as_std_path();
    let folder = match profile {
        Profile::Release if !project.runs_here() => {
            return Err(Error::new(format!(
                "--profile release compiles for this machine, and not for {triple}; use --profile dist"
            )));
        }
        Profile::Release => {
            // The very command that builds the workspace, so that nothing is compiled with other features.
            command.args(["build", "--release"]);
            target.join("release")
        }
        Profile::Dist => {
            require_tools(project.target())?;
            command.args(["zigbuild", "--profile", "dist", "--target", &format!("{triple}.{GLIBC}")]);
            command.args(["--package", EXECUTABLE, "--package", "pdk-driver-c"]);
            for plugin in project.plugins() {
                command.args(["--package", plugin.name.as_str()]);
            }
            target.join(triple).join("dist")
        }
    };
    succeed(&mut command)?;
    let executable = folder.join(EXECUTABLE);
    let runnable = if project.runs_here() { executable.clone() } else { built_here(project)? };
    let library = |name: &str| folder.join(format!("lib{}.so", name.replace('-', "_")));
    let libraries = project.plugins().iter().map(|plugin| library(&plugin.name)).collect();
    Ok(Compiled { executable, runnable, libraries, driver_library: folder.join(DRIVER_LIBRARY) })
}

/// The executable that `cargo build --release` makes for this machine, with its libraries beside it.
fn built_here(project: &Project) -> Result<PathBuf> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    succeed(Command::new(cargo).current_dir(project.root()).args(["build", "--release"]))?;
    Ok(project.metadata().target_directory.as_std_path().join("release").join(EXECUTABLE))
}

/// Makes sure that everything is there before the first file is compiled.
fn require_tools(target: Target) -> Result<()> {
    let run = |program: &str, arguments: &[&str]| output(Command::new(program).args(arguments)).map(drop);
    require_standard_library(target.triple())?;
    // The assembly for ARM is compiled by the C compiler.
    if target == Target::X86 {
        run("nasm", &["-v"]).map_err(|_| {
            Error::new("nasm is missing, without which H.264 has no assembly; install it, on Debian with `apt install nasm`")
        })?;
    }
    let remedy = "`pip install cargo-zigbuild ziglang` installs both; --profile release does without, for machines like this one";
    run("cargo-zigbuild", &["--version"]).place(format_args!("cargo-zigbuild is missing ({remedy})"))?;
    // Where cargo-zigbuild looks for it too.
    run("zig", &["version"])
        .or_else(|_| run("python3", &["-m", "ziglang", "version"]))
        .place(format_args!("zig is missing ({remedy})"))
}

/// Makes sure that the compiler has the standard library of the system that packages are for.
fn require_standard_library(triple: &str) -> Result<()> {
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let printed = output(Command::new(compiler).args(["--print", "target-libdir", "--target", triple]))?;
    let folder = String::from_utf8_lossy(&printed).trim().to_owned();
    if Path::new(&folder).is_dir() {
        return Ok(());
    }
    Err(Error::new(format!(
        "Rust's standard library for {triple} is missing ({folder}); install it with `rustup target add {triple}`"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_standard_library_is_reported_with_its_remedy() {
        require_standard_library(Target::HERE.triple()).unwrap();
        let error = require_standard_library("riscv64gc-unknown-linux-gnu").unwrap_err().to_string();
        assert!(error.contains("`rustup target add riscv64gc-unknown-linux-gnu`"), "{error}");
    }
}
