//! Makes sure that what is in the tree works, and says what it needs and how large it is.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use object::Endianness;
use object::elf::FileHeader64;
use object::read::elf::FileHeader;
use pdk_model::error::{Error, Place, Result};
use serde_json::Value;

use crate::Profile;
use crate::compile::{DRIVER_LIBRARY, GLIBC};
use crate::project::{Project, output};
use crate::tree::{EXECUTABLE, LIBRARIES};

/// Checks the tree, and reports on it.
///
/// # Errors
/// If pdk does not find a part of itself, or the packages are slower or need a newer system than they should.
pub fn run(project: &Project, tree: &Path, profile: Profile) -> Result<String> {
    let files = files(project, tree);
    let mut report = String::new();
    let mut glibc = Version::default();
    for file in &files {
        let content = fs::read(file).place(file.display())?;
        let needed = newest_glibc(&content).place(file.display())?;
        let name = file.strip_prefix(tree).unwrap_or(file);
        // Writing to a text cannot fail.
        let _ = writeln!(report, "{:>11} bytes, glibc {needed:<6} {}", content.len(), name.display());
        glibc = glibc.max(needed);
    }
    let _ = write!(report, "needs glibc {glibc}");
    if profile == Profile::Dist && glibc > Version::parse(GLIBC).unwrap_or_default() {
        return Err(Error::new(format!("the packages need glibc {glibc}, but have to run with {GLIBC}")));
    }
    if project.runs_here() {
        doctor(&tree.join(EXECUTABLE), profile)?;
    } else {
        let machine = project.target().machine();
        let _ =
            write!(report, "\nnot tried, because it is for {machine}; run `pdk doctor` on such a machine");
    }
    Ok(report)
}

/// The executable and the libraries.
fn files(project: &Project, tree: &Path) -> Vec<PathBuf> {
    let library = |name: &str| tree.join(LIBRARIES).join(format!("lib{}.so", name.replace('-', "_")));
    let libraries = project.plugins().into_iter().map(|plugin| library(&plugin.name));
    [tree.join(EXECUTABLE), tree.join("lib").join(DRIVER_LIBRARY)].into_iter().chain(libraries).collect()
}

/// Asks pdk itself, in an environment without anything of the user's.
fn doctor(executable: &Path, profile: Profile) -> Result<()> {
    let said = output(Command::new(executable).args(["doctor", "--json"]).env_clear())?;
    let findings: Vec<Value> = serde_json::from_slice(&said).place("pdk doctor")?;
    let state = |subject: &str| {
        let finding = findings.iter().find(|finding| finding["subject"] == subject);
        finding.map_or(&Value::Null, |finding| &finding["state"])
    };
    for subject in ["libraries", "components", "sdk"] {
        if state(subject) != "ok" {
            return Err(Error::new(format!(
                "{} doctor reports a problem with its {subject}",
                executable.display()
            )));
        }
    }
    if profile == Profile::Dist && state("video") != "ok" {
        return Err(Error::new(
            "H.264 has no assembly, because nasm was missing when it was compiled; `cargo clean --profile dist -p openh264-sys2 -p pdk-video \
             --target x86_64-unknown-linux-gnu` and begin again",
        ));
    }
    Ok(())
}

/// The version of a library, as its symbols have it.
#[derive(Debug, Default, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Version(Vec<u32>);

impl Version {
    fn parse(text: &str) -> Option<Self> {
        text.split('.').map(|part| part.parse().ok()).collect::<Option<_>>().map(Self)
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts: Vec<String> = self.0.iter().map(u32::to_string).collect();
        f.pad(&parts.join("."))
    }
}

/// The newest glibc that a file asks for.
fn newest_glibc(file: &[u8]) -> object::Result<Version> {
    let header = FileHeader64::<Endianness>::parse(file)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, file)?;
    let mut newest = Version::default();
    let Some((mut libraries, names)) = sections.gnu_verneed(endian, file)? else { return Ok(newest) };
    let names = sections.strings(endian, file, names)?;
    while let Some((_, mut symbols)) = libraries.next()? {
        while let Some(symbol) = symbols.next()? {
            let name = String::from_utf8_lossy(symbol.name(endian, names)?).into_owned();
            if let Some(version) = name.strip_prefix("GLIBC_").and_then(Version::parse) {
                newest = newest.max(version);
            }
        }
    }
    Ok(newest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_glibc_is_found() {
        let own = fs::read(std::env::current_exe().unwrap()).unwrap();
        let needed = newest_glibc(&own).unwrap();
        assert!(needed >= Version::parse("2.17").unwrap(), "{needed}");
        assert!(newest_glibc(b"no library").is_err());
        let version = |text: &str| Version::parse(text).unwrap();
        assert!(version("2.9") < version("2.28") && version("2.28") < version("2.28.1"));
        assert_eq!(Version::parse("PRIVATE"), None);
    }
}
