//! The source of the SDK as a workspace of its own, for the authors of plugins.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use pdk_model::error::{Error, Place, Result};
use toml_edit::{Array, DocumentMut, Item, TableLike, Value};
use walkdir::WalkDir;

/// The folder of the SDK in the workspace.
const FOLDER: &str = "sdk";
const MANIFEST: &str = "Cargo.toml";
/// The Python package in it, which needs the kernel, and what authors of drivers and simulators use of it.
const PYTHON: &str = "python";
const FOR_AUTHORS: [&str; 4] =
    ["pdk_driver.py", "pdk_simulator.py", "examples/function.py", "examples/model.py"];

/// Copies the SDK from the workspace at `root`, and gives it a manifest that says what the workspace's says of it.
///
/// # Errors
/// If something cannot be read or written, or a manifest is not what is expected.
pub fn copy(root: &Path, into: &Path) -> Result<()> {
    let folder = root.join(FOLDER);
    copy_files(&folder, into)?;
    for part in FOR_AUTHORS {
        let (from, to) = (folder.join(PYTHON).join(part), into.join(PYTHON).join(part));
        to.parent().map_or(Ok(()), fs::create_dir_all).place(to.display())?;
        fs::copy(&from, &to).place(from.display())?;
    }
    let mut crates = BTreeSet::new();
    let mut needed = BTreeSet::new();
    for entry in fs::read_dir(&folder).place(folder.display())? {
        let path = entry.place(folder.display())?.path();
        if path.join(MANIFEST).is_file() && !path.ends_with(PYTHON) {
            crates.insert(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
            needed.extend(inherited(&read(&path.join(MANIFEST))?));
        }
    }
    let manifest = workspace(read(&root.join(MANIFEST))?, &crates, &needed)?;
    let file = into.join(MANIFEST);
    fs::write(&file, manifest.to_string()).place(file.display())
}

/// Copies all files of a folder that belong to its source, but for the Python package.
fn copy_files(from: &Path, into: &Path) -> Result<()> {
    let other = ["target", "proptest-regressions", PYTHON];
    let source = |name: &str| !other.contains(&name) && !name.starts_with('.');
    let walk = WalkDir::new(from).sort_by_file_name().into_iter();
    for entry in walk.filter_entry(|entry| entry.file_name().to_str().is_some_and(source)) {
        let entry = entry.place(from.display())?;
        let target = into.join(entry.path().strip_prefix(from).place(from.display())?);
        match entry.file_type().is_dir() {
            true => fs::create_dir_all(&target).place(target.display())?,
            false => fs::copy(entry.path(), &target).map(drop).place(target.display())?,
        }
    }
    Ok(())
}

fn read(path: &Path) -> Result<DocumentMut> {
    fs::read_to_string(path).place(path.display())?.parse().place(path.display())
}

/// The dependencies that a crate has from its workspace.
fn inherited(manifest: &DocumentMut) -> Vec<String> {
    let tables = ["dependencies", "dev-dependencies", "build-dependencies"];
    let tables = tables.into_iter().filter_map(|name| manifest.get(name)?.as_table_like());
    let names = tables.flat_map(|table| table.iter()).filter(|(_, item)| {
        item.as_table_like().and_then(|table| table.get("workspace")).and_then(Item::as_bool) == Some(true)
    });
    names.map(|(name, _)| name.to_owned()).collect()
}

/// The manifest of the workspace with these crates alone, which lie beside it.
fn workspace(
    mut manifest: DocumentMut,
    crates: &BTreeSet<String>,
    needed: &BTreeSet<String>,
) -> Result<DocumentMut> {
    let wrong = || Error::new("the workspace's Cargo.toml has no [workspace.dependencies]");
    manifest.remove("profile");
    let workspace = manifest.get_mut("workspace").and_then(Item::as_table_like_mut).ok_or_else(wrong)?;
    workspace.remove("default-members");
    workspace.insert("members", Item::Value(Value::Array(crates.iter().collect::<Array>())));
    let dependencies =
        workspace.get_mut("dependencies").and_then(Item::as_table_like_mut).ok_or_else(wrong)?;
    let all: Vec<String> = dependencies.iter().map(|(name, _)| name.to_owned()).collect();
    for name in all {
        let path = dependencies.get(&name).and_then(Item::as_table_like).and_then(|table| table.get("path"));
        let path = path.and_then(Item::as_str).map(ToOwned::to_owned);
        let own = path.as_deref().and_then(|path| path.strip_prefix(FOLDER)?.strip_prefix('/'));
        match (own, dependencies.get_mut(&name).and_then(Item::as_table_like_mut)) {
            (Some(own), Some(dependency)) => set_path(dependency, own),
            _ if needed.contains(&name) && path.is_none() => {}
            _ => drop(dependencies.remove(&name)),
        }
    }
    Ok(manifest)
}

fn set_path(dependency: &mut dyn TableLike, path: &str) {
    dependency.insert("path", Item::Value(path.into()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::{Project, Target};

    #[test]
    fn the_modules_for_drivers_and_simulators_are_copied() {
        let folder = std::env::temp_dir().join(format!("pdk-sdk-{}", std::process::id()));
        copy(Project::for_target(Target::HERE).unwrap().root(), &folder).unwrap();
        for module in ["pdk_driver.py", "pdk_simulator.py"] {
            assert!(folder.join(PYTHON).join(module).is_file(), "{module}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_manifest_speaks_of_the_sdk_alone() {
        let manifest = r#"
            [workspace]
            members = ["kernel/*", "sdk/pdk-a", "sdk/pdk-b"]
            default-members = ["kernel/*"]
            [workspace.package]
            version = "1.2.3"
            [workspace.dependencies]
            pdk-loop = { path = "kernel/loop" }
            pdk-a = { path = "sdk/pdk-a", version = "1.2.3" }
            pdk-b = { path = "sdk/pdk-b" }
            libm = "0.2"
            clap = "1"
            [profile.release]
            lto = true
        "#;
        let a: DocumentMut = r#"
            [dependencies]
            libm.workspace = true
            pdk-b = { workspace = true }
            other = "1"
        "#
        .parse()
        .unwrap();
        let needed: BTreeSet<String> = inherited(&a).into_iter().collect();
        assert_eq!(needed, BTreeSet::from(["libm".to_owned(), "pdk-b".to_owned()]));
        let crates = BTreeSet::from(["pdk-a".to_owned(), "pdk-b".to_owned()]);
        let made = workspace(manifest.parse().unwrap(), &crates, &needed).unwrap();
        let workspace = made["workspace"].as_table().unwrap();
        assert_eq!(workspace["members"].to_string().trim(), r#"["pdk-a", "pdk-b"]"#);
        let dependencies = workspace["dependencies"].as_table().unwrap();
        let names: Vec<_> = dependencies.iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["pdk-a", "pdk-b", "libm"]);
        assert_eq!(dependencies["pdk-a"]["path"].as_str(), Some("pdk-a"));
        assert_eq!(workspace["package"]["version"].as_str(), Some("1.2.3"));
        assert!(made.get("profile").is_none() && workspace.get("default-members").is_none());
    }
}
