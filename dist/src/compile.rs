//! Compiles the executable and the libraries.
//!
//! What is shipped has to run on older distributions than the one at hand, so it is linked against the symbols of an older glibc.
//! Zig's linker knows those of every version, and cargo-zigbuild makes cargo use it. Zig's C++ library and unwinder are linked
//! into each file, so that glibc is all that a machine needs.

use std::path::PathBuf;
use std::process::Command;

use pdk_model::error::{Error, Place, Result};

use crate::Profile;
use crate::project::{EXECUTABLE, Project, TARGET, output, succeed};

/// The glibc of Debian 10, Ubuntu 18.10 and RHEL 8.
pub const GLIBC: &str = "2.28";

/// The library for drivers in C and C++, as the linker looks for it.
pub const DRIVER_LIBRARY: &str = "libpdkdriver.so";

/// What was compiled.
pub struct Compiled {
    /// The executable.
    pub executable: PathBuf,
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
    let target = project.metadata().target_directory.as_std_path();
    let folder = match profile {
        Profile::Release => {
            // The very command that builds the workspace, so that nothing is compiled with other features.
            command.args(["build", "--release"]);
            target.join("release")
        }
        Profile::Dist => {
            require_tools()?;
            command.args(["zigbuild", "--profile", "dist", "--target", &format!("{TARGET}.{GLIBC}")]);
            command.args(["--package", EXECUTABLE, "--package", "pdk-driver-c"]);
            for plugin in project.plugins() {
                command.args(["--package", plugin.name.as_str()]);
            }
            target.join(TARGET).join("dist")
        }
    };
    succeed(&mut command)?;
    let library = |name: &str| folder.join(format!("lib{}.so", name.replace('-', "_")));
    let libraries = project.plugins().iter().map(|plugin| library(&plugin.name)).collect();
    Ok(Compiled {
        executable: folder.join(EXECUTABLE),
        libraries,
        driver_library: folder.join(DRIVER_LIBRARY),
    })
}

/// Makes sure that everything is there before the first file is compiled.
fn require_tools() -> Result<()> {
    let run = |program: &str, arguments: &[&str]| output(Command::new(program).args(arguments)).map(drop);
    run("nasm", &["-v"]).map_err(|_| {
        Error::new("nasm is missing, without which H.264 has no assembly; install it, on Debian with `apt install nasm`")
    })?;
    let remedy = "`pip install cargo-zigbuild ziglang` installs both; --profile release does without, for machines like this one";
    run("cargo-zigbuild", &["--version"]).place(format_args!("cargo-zigbuild is missing ({remedy})"))?;
    // Where cargo-zigbuild looks for it too.
    run("zig", &["version"])
        .or_else(|_| run("python3", &["-m", "ziglang", "version"]))
        .place(format_args!("zig is missing ({remedy})"))
}
