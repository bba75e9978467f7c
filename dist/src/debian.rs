//! The Debian package, which cargo-deb makes of the tree. What it says of itself stands in the manifest of the executable's
//! package.

use std::path::PathBuf;
use std::process::Command;

use pdk_model::error::Result;

use crate::project::{EXECUTABLE, Project, install, succeed};

/// The version of cargo-deb.
const VERSION: &str = "3.8.0";

/// Makes the package, and returns it. Installs cargo-deb below `target/pdk-dist` if it is not there yet.
///
/// # Errors
/// If cargo-deb cannot be installed or fails.
pub fn pack(project: &Project) -> Result<PathBuf> {
    let tool = install(project, "cargo-deb", VERSION, &[])?;
    let package = project.out().join(format!(
        "pdk_{}_{}.deb",
        project.executable()?.version,
        project.target().debian()
    ));
    let mut pack = Command::new(tool);
    pack.current_dir(project.root()).args(["--no-build", "--no-strip", "--package", EXECUTABLE, "--output"]);
    pack.arg(&package);
    if !project.runs_here() {
        pack.args(["--target", project.target().triple()]);
    }
    succeed(&mut pack)?;
    Ok(package)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::GLIBC;
    use crate::project::Target;

    #[test]
    fn the_package_asks_for_the_glibc_that_is_compiled_for() {
        let project = Project::for_target(Target::HERE).unwrap();
        let metadata = &project.executable().unwrap().metadata["deb"];
        assert_eq!(metadata["depends"], format!("libc6 (>= {GLIBC})"));
    }
}
