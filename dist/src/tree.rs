//! The tree of files as it lies below `/usr`, or wherever an archive is unpacked.
//!
//! ```text
//! bin/pdk
//! lib/pdk/                             the libraries with the built-in components
//! lib/libpdkdriver.so                  drivers in C and C++, with include/pdk_driver.h
//! share/pdk/sdk/                       the SDK's source, and the Lua types in sdk/lua
//! share/doc/pdk/                       licences, changes, the worker protocol, examples, the recipe of the networks
//! share/man/man1/
//! share/bash-completion/completions/   and those of zsh and fish
//! ```

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use pdk_model::error::{Place, Result};

use crate::compile::{Compiled, DRIVER_LIBRARY};
use crate::project::{Project, output, succeed};
use crate::{Profile, licences, sdk};

/// The executable in the tree.
pub const EXECUTABLE: &str = "bin/pdk";
/// The folder of the libraries.
pub const LIBRARIES: &str = "lib/pdk";

/// What a driver in C or C++ includes, in the workspace.
const DRIVER_HEADER: &str = "sdk/pdk-driver-c/include/pdk_driver.h";

/// Completions by shell, and where each looks for them.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "share/bash-completion/completions/pdk"),
    ("zsh", "share/zsh/site-functions/_pdk"),
    ("fish", "share/fish/vendor_completions.d/pdk.fish"),
];

/// Documents by their places in the workspace and below `share/doc/pdk`.
const DOCUMENTS: [(&str, &str); 9] = [
    ("LICENSE", "LICENSE"),
    ("CHANGELOG.md", "CHANGELOG.md"),
    ("docs/worker-protocol.md", "worker-protocol.md"),
    ("scripts/training/collect.lua", "training/collect.lua"),
    ("scripts/training/train.py", "training/train.py"),
    ("scripts/training/networks.py", "training/networks.py"),
    ("scripts/training/records.py", "training/records.py"),
    ("scripts/training/quantise.py", "training/quantise.py"),
    ("scripts/training/requirements.txt", "training/requirements.txt"),
];

/// Short pipelines, in the workspace.
const EXAMPLES: &str = "scripts/examples";

/// Files to try commands with, as they are named in the documents.
pub const FILES_TO_TRY: &str = "docs/examples";

/// Lays out the tree anew, and returns its folder.
///
/// # Errors
/// If a file is missing or cannot be written.
pub fn lay_out(project: &Project, compiled: &Compiled, profile: Profile) -> Result<PathBuf> {
    let tree = project.out().join("tree");
    if tree.exists() {
        fs::remove_dir_all(&tree).place(tree.display())?;
    }
    put(&compiled.executable, &tree.join(EXECUTABLE), 0o755)?;
    for library in &compiled.libraries {
        put(library, &tree.join(LIBRARIES).join(library.file_name().unwrap_or_default()), 0o644)?;
    }
    put(&compiled.driver_library, &tree.join("lib").join(DRIVER_LIBRARY), 0o644)?;
    put(&project.root().join(DRIVER_HEADER), &tree.join("include/pdk_driver.h"), 0o644)?;
    sdk::copy(project.root(), &tree.join("share/pdk/sdk"))?;
    let documents = tree.join("share/doc/pdk");
    for (from, to) in DOCUMENTS {
        put(&project.root().join(from), &documents.join(to), 0o644)?;
    }
    copy(&project.root().join(EXAMPLES), &documents.join("examples"))?;
    copy(&project.root().join(FILES_TO_TRY), &documents.join(FILES_TO_TRY))?;
    write(&documents.join("THIRD-PARTY-LICENSES.txt"), licences::page(project, profile)?.as_bytes())?;
    for (shell, place) in COMPLETIONS {
        write(&tree.join(place), &output(Command::new(&compiled.runnable).args(["completions", shell]))?)?;
    }
    succeed(Command::new(&compiled.runnable).arg("man").arg(tree.join("share/man/man1")))?;
    Ok(tree)
}

/// Puts the files of a folder, and of the folders in it, into another one.
fn copy(from: &Path, to: &Path) -> Result<()> {
    for entry in fs::read_dir(from).place(from.display())? {
        let entry = entry.place(from.display())?;
        let (path, to) = (entry.path(), to.join(entry.file_name()));
        match path.is_dir() {
            true => copy(&path, &to)?,
            false => put(&path, &to, 0o644)?,
        }
    }
    Ok(())
}

fn put(from: &Path, to: &Path, mode: u32) -> Result<()> {
    write(to, &fs::read(from).place(from.display())?)?;
    fs::set_permissions(to, fs::Permissions::from_mode(mode)).place(to.display())
}

fn write(file: &Path, content: &[u8]) -> Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all).place(file.display())?;
    fs::write(file, content).place(file.display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Target;

    #[test]
    fn programs_in_python_are_shipped_with_the_modules_beside_them() {
        let project = Project::for_target(Target::HERE).unwrap();
        let mut modules = 0;
        for (program, shipped) in DOCUMENTS.iter().filter(|(from, _)| from.ends_with(".py")) {
            let text = fs::read_to_string(project.root().join(program)).unwrap();
            let imported = text.lines().filter_map(|line| {
                let names = line.strip_prefix("import ").or_else(|| line.strip_prefix("from "))?;
                names.split([' ', '.', ',']).next()
            });
            for name in imported {
                let module = Path::new(program).with_file_name(format!("{name}.py"));
                if project.root().join(&module).is_file() {
                    let beside = Path::new(shipped).with_file_name(format!("{name}.py"));
                    let is_shipped =
                        |(from, to): &(&str, &str)| Path::new(from) == module && Path::new(to) == beside;
                    assert!(DOCUMENTS.iter().any(is_shipped), "{program} imports {}", module.display());
                    modules += 1;
                }
            }
        }
        assert!(modules >= 4, "{modules}");
    }
}
