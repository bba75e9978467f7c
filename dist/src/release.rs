//! What accompanies the packages of a release: its notes, the bill of materials, and a checksum of every file.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use pdk_model::error::{Error, Place, Result};
use sha2::{Digest, Sha256};

use crate::project::{Project, Target};
use crate::{Profile, materials};

const CHANGES: &str = "CHANGELOG.md";
/// The heading of what no version has yet.
const UNRELEASED: &str = "Unreleased";
const CHECKSUMS: &str = "SHA256SUMS";

/// Makes sure that the changes of this version are described, and returns its notes.
///
/// # Errors
/// If the changes have no section for the version. To try a release, those of the next version do.
pub fn notes(project: &Project, profile: Profile) -> Result<String> {
    let file = project.root().join(CHANGES);
    let text = fs::read_to_string(&file).place(file.display())?;
    let version = project.executable()?.version.to_string();
    let found = section(&text, &version);
    let found = found.or_else(|| section(&text, UNRELEASED).filter(|_| profile == Profile::Release));
    found.ok_or_else(|| {
        Error::new(format!(
            "{CHANGES} has no section for version {version}; write `## {version} - YEAR-MONTH-DAY` over the changes that are `{UNRELEASED}`"
        ))
    })
}

/// The text below the heading that begins with a version, up to the next one.
fn section(text: &str, version: &str) -> Option<String> {
    let is_heading = |line: &str| line.starts_with("## ");
    let named =
        |line: &&str| line.strip_prefix("## ").and_then(|rest| rest.split(' ').next()) == Some(version);
    let mut lines = text.lines().skip_while(|line| !named(line));
    lines.next()?;
    let lines: Vec<&str> = lines.take_while(|line| !is_heading(line)).collect();
    let found = lines.join("\n").trim().to_owned();
    (!found.is_empty()).then_some(found + "\n")
}

/// Puts the packages into the folder of the release in the place of earlier ones for the same system, with notes, bill of materials and checksums, and returns the folder.
///
/// # Errors
/// If a file cannot be read or written.
pub fn collect(project: &Project, packages: &[PathBuf], notes: &str) -> Result<PathBuf> {
    let version = &project.executable()?.version;
    let folder = project.out().join(format!("release-{version}"));
    fs::create_dir_all(&folder).place(folder.display())?;
    remove(&folder, project.target())?;
    for package in packages {
        let to = folder.join(package.file_name().unwrap_or_default());
        fs::copy(package, &to).place(to.display())?;
    }
    let write = |name: &str, text: &str| {
        let file = folder.join(name);
        fs::write(&file, text).place(file.display())
    };
    write("NOTES.md", notes)?;
    write(&format!("{}.cdx.json", project.title()?), &materials::bill(project)?)?;
    write(CHECKSUMS, &checksums(&folder)?)?;
    Ok(folder)
}

/// Removes the packages for a system. An earlier build may have given them other names, as maturin does for wheels.
fn remove(folder: &Path, target: Target) -> Result<()> {
    for entry in fs::read_dir(folder).place(folder.display())? {
        let entry = entry.place(folder.display())?;
        if is_for(&entry.file_name().to_string_lossy(), target) {
            fs::remove_file(entry.path()).place(entry.path().display())?;
        }
    }
    Ok(())
}

/// Whether the name of a package says that it is for this system.
fn is_for(name: &str, target: Target) -> bool {
    name.contains(target.machine()) || name.ends_with(&format!("_{}.deb", target.debian()))
}

/// The hashes of all files in a folder, as `sha256sum --check` reads them.
fn checksums(folder: &Path) -> Result<String> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).place(folder.display())? {
        let file = entry.place(folder.display())?.path();
        if file.is_file() && !file.ends_with(CHECKSUMS) {
            files.push(file);
        }
    }
    files.sort();
    let mut lines = String::new();
    for file in files {
        let content = fs::read(&file).place(file.display())?;
        for byte in Sha256::digest(content) {
            // Writing to a text cannot fail.
            let _ = write!(lines, "{byte:02x}");
        }
        let _ = writeln!(lines, "  {}", file.file_name().unwrap_or_default().to_string_lossy());
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `cargo publish --workspace` uploads every package that does not refuse it.
    #[test]
    fn only_crates_of_the_sdk_are_published() {
        let project = Project::for_target(Target::HERE).unwrap();
        let packages = project.metadata().workspace_packages().into_iter();
        let published: Vec<_> = packages.filter(|package| package.publish.is_none()).collect();
        assert!(published.len() >= 12);
        for package in published {
            assert!(
                package.manifest_path.starts_with(project.root().join("sdk")),
                "{} needs `publish = false`",
                package.name
            );
            assert!(package.documentation.is_some() && package.readme.is_some(), "{}", package.name);
            assert!(!package.keywords.is_empty() && !package.categories.is_empty(), "{}", package.name);
        }
    }

    #[test]
    fn the_notes_are_the_section_of_the_version() {
        let text = "# Changelog\n\n## Unreleased\n\n## 0.10.0 - 2026-02-01\n\n- later\n\n### more\n- x\n\n## 0.1.0\n- first\n";
        assert_eq!(section(text, "0.10.0").unwrap(), "- later\n\n### more\n- x\n");
        assert_eq!(section(text, "0.1.0").unwrap(), "- first\n");
        assert_eq!(section(text, "0.1"), None);
        assert_eq!(section(text, UNRELEASED), None, "it is empty");
    }

    #[test]
    fn packages_for_the_same_system_are_replaced_and_others_are_kept() {
        let folder = std::env::temp_dir().join(format!("pdk-release-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let replaced = [
            "pdk-0.1.0-x86_64-linux.tar.xz",
            "pdk-0.1.0-x86_64-linux.cdx.json",
            "pdk_0.1.0_amd64.deb",
            "pdk_perturb-0.1.0-cp310-abi3-linux_x86_64.whl",
            "pdk_perturb-0.1.0-cp310-abi3-manylinux_2_28_x86_64.whl",
        ];
        let kept =
            ["NOTES.md", "pdk_0.1.0_arm64.deb", "pdk_perturb-0.1.0-cp310-abi3-manylinux_2_28_aarch64.whl"];
        for name in replaced.iter().chain(&kept) {
            fs::write(folder.join(name), "").unwrap();
        }
        remove(&folder, Target::X86).unwrap();
        assert!(replaced.iter().all(|name| !folder.join(name).exists()));
        assert!(kept.iter().all(|name| folder.join(name).exists()));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn the_checksums_are_those_of_sha256sum() {
        let folder = std::env::temp_dir().join(format!("pdk-checksums-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("b"), "abc").unwrap();
        fs::write(folder.join("a"), "").unwrap();
        fs::write(folder.join(CHECKSUMS), "old").unwrap();
        let expected = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  a\n\
                        ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  b\n";
        assert_eq!(checksums(&folder).unwrap(), expected);
        fs::remove_dir_all(&folder).unwrap();
    }
}
