//! The source distribution of the Python package: the workspace, with a build backend that makes the wheel as `pdk-dist` does.
//!
//! `pip install pdk_perturb-VERSION.tar.gz` compiles everything, which takes a toolchain for Rust, a C++ compiler and many minutes.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::Command;

use flate2::Compression;
use flate2::write::GzEncoder;
use pdk_model::error::{Error, Place, Result};
use tar::{Builder, Header, HeaderMode};
use toml_edit::{Array, DocumentMut, Item, Table, Value, value};

use crate::project::{Project, output};
use crate::tree::FILES_TO_TRY;

/// The description of the Python package in the workspace.
const DESCRIPTION: &str = "sdk/python/pyproject.toml";
/// The folder of the build backend, and its module in there.
const BACKEND: (&str, &str) = ("dist/python", "pdk_build");
/// Pictures of documents, which nothing is compiled from.
const PICTURES: [&str; 3] = ["jpg", "png", "gif"];

/// Packs the files that git knows, and returns the archive.
///
/// # Errors
/// If git is missing, or a file cannot be read or written.
pub fn pack(project: &Project) -> Result<PathBuf> {
    let file = project.root().join(DESCRIPTION);
    let text = fs::read_to_string(&file).place(file.display())?;
    let mut description: DocumentMut = text.parse().place(file.display())?;
    let version = project.python()?.version.to_string();
    let readme = file.with_file_name("README.md");
    let readme = fs::read_to_string(&readme).place(readme.display())?;
    let information = information(&description, &version, &readme).place(file.display())?;
    let name = text_of(&description, "name").place(file.display())?.replace('-', "_");
    build_by_backend(&mut description, &version);

    let title = format!("{name}-{version}");
    let path = project.out().join(format!("{title}.tar.gz"));
    fs::create_dir_all(project.out()).place(project.out().display())?;
    let file = File::create(&path).place(path.display())?;
    let mut archive = Builder::new(GzEncoder::new(BufWriter::new(file), Compression::best()));
    archive.mode(HeaderMode::Deterministic);
    for (name, text) in [("PKG-INFO", information), ("pyproject.toml", description.to_string())] {
        let mut header = Header::new_gnu();
        header.set_mode(0o644);
        header.set_size(text.len() as u64);
        archive.append_data(&mut header, format!("{title}/{name}"), text.as_bytes()).place(path.display())?;
    }
    for name in sources(project)? {
        let file = project.root().join(&name);
        archive.append_path_with_name(&file, format!("{title}/{name}")).place(file.display())?;
    }
    let file = archive.into_inner().and_then(GzEncoder::finish).place(path.display())?;
    file.into_inner().place(path.display())?;
    Ok(path)
}

/// The files that the packages are made of.
fn sources(project: &Project) -> Result<Vec<String>> {
    let listed = output(Command::new("git").arg("-C").arg(project.root()).args(["ls-files", "-z"]))
        .place("cannot list the files of the workspace; make the source distribution in a clone")?;
    let listed = String::from_utf8_lossy(&listed).into_owned();
    let files = listed.split('\0').filter(|name| !name.is_empty() && !is_picture(name));
    // A file that was deleted and not committed is listed too.
    Ok(files.filter(|name| project.root().join(name).is_file()).map(str::to_owned).collect())
}

/// Whether a file is a picture that only documents show. The packages have those of the files to try.
fn is_picture(name: &str) -> bool {
    let is_document = name.starts_with("docs/") && !Path::new(name).starts_with(FILES_TO_TRY);
    is_document && name.rsplit('.').next().is_some_and(|ending| PICTURES.contains(&ending))
}

fn text_of<'a>(description: &'a DocumentMut, key: &str) -> Result<&'a str> {
    let text = description.get("project").and_then(|project| project.get(key)?.as_str());
    text.ok_or_else(|| Error::new(format!("[project] has no `{key}`")))
}

/// What package indexes and pip read, in the format of Python's core metadata.
fn information(description: &DocumentMut, version: &str, readme: &str) -> Result<String> {
    let mut lines = vec![
        "Metadata-Version: 2.4".to_owned(),
        format!("Name: {}", text_of(description, "name")?),
        format!("Version: {version}"),
        format!("Summary: {}", text_of(description, "description")?),
        format!("License-Expression: {}", text_of(description, "license")?),
        format!("Requires-Python: {}", text_of(description, "requires-python")?),
    ];
    let project = description.get("project");
    let list = |item: Option<&Item>| -> Vec<String> {
        let list = item.and_then(Item::as_array).into_iter().flatten();
        list.filter_map(|entry| entry.as_str().map(str::to_owned)).collect()
    };
    let listed = |key: &str| list(project.and_then(|project| project.get(key)));
    lines.extend(listed("classifiers").iter().map(|entry| format!("Classifier: {entry}")));
    lines.extend(listed("dependencies").iter().map(|entry| format!("Requires-Dist: {entry}")));
    let extras = project.and_then(|project| project.get("optional-dependencies")?.as_table_like());
    for (extra, entries) in extras.into_iter().flat_map(|extras| extras.iter()) {
        lines.push(format!("Provides-Extra: {extra}"));
        lines.extend(
            list(Some(entries)).iter().map(|entry| format!("Requires-Dist: {entry} ; extra == '{extra}'")),
        );
    }
    lines.push("Description-Content-Type: text/markdown".to_owned());
    // The description is the body, after an empty line.
    Ok(format!("{}\n\n{readme}", lines.join("\n")))
}

/// Makes the description one that is built by the backend in the workspace.
fn build_by_backend(description: &mut DocumentMut, version: &str) {
    let mut system = Table::new();
    // The backend starts maturin.
    let requires = description.get("build-system").and_then(|system| system.get("requires")).cloned();
    system.insert("requires", requires.unwrap_or_else(|| value(Array::new())));
    system.insert("build-backend", value(BACKEND.1));
    system.insert("backend-path", Item::Value(Value::Array(Array::from_iter([BACKEND.0]))));
    description.insert("build-system", Item::Table(system));
    description.remove("tool");
    if let Some(project) = description.get_mut("project").and_then(Item::as_table_like_mut) {
        project.remove("dynamic");
        project.insert("version", value(version));
        project.insert("readme", value("sdk/python/README.md"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Target;

    #[test]
    fn the_source_distribution_holds_what_a_build_needs() {
        let project = Project::for_target(Target::HERE).unwrap();
        if output(Command::new("git").arg("-C").arg(project.root()).arg("status")).is_err() {
            eprintln!("skipped: this is not a clone");
            return;
        }
        let path = pack(&project).unwrap();
        let folder = std::env::temp_dir().join(format!("pdk-sdist-{}", std::process::id()));
        let file = flate2::read::GzDecoder::new(File::open(&path).unwrap());
        tar::Archive::new(file).unpack(&folder).unwrap();
        let root = folder.join(path.file_name().unwrap().to_str().unwrap().trim_end_matches(".tar.gz"));
        for name in ["PKG-INFO", "Cargo.lock", "dist/python/pdk_build.py", "scripts/models/dave2.onnx"] {
            assert!(root.join(name).is_file(), "{name}");
        }
        for entry in fs::read_dir(project.root().join(FILES_TO_TRY)).unwrap() {
            let name = Path::new(FILES_TO_TRY).join(entry.unwrap().file_name());
            assert!(root.join(&name).exists(), "{}", name.display());
        }
        // Cargo finds every package of the workspace, and the packages find what is shipped beside them.
        let unpacked = cargo_metadata::MetadataCommand::new()
            .manifest_path(root.join("Cargo.toml"))
            .other_options(["--offline".into(), "--no-deps".into()])
            .exec()
            .unwrap();
        assert_eq!(unpacked.packages.len(), project.metadata().workspace_members.len());
        let described = fs::read_to_string(root.join("pyproject.toml")).unwrap();
        let described: DocumentMut = described.parse().unwrap();
        assert_eq!(described["build-system"]["backend-path"][0].as_str(), Some(BACKEND.0));
        assert_eq!(
            described["project"]["version"].as_str(),
            Some(project.python().unwrap().version.to_string().as_str())
        );
        let information = fs::read_to_string(root.join("PKG-INFO")).unwrap();
        assert!(information.contains("\nRequires-Dist: pandas>=1.5 ; extra == 'pandas'\n"), "{information}");
        assert!(
            information.contains("\nDescription-Content-Type: text/markdown\n\n# pdk-perturb\n"),
            "{information}"
        );
        fs::remove_dir_all(folder).unwrap();
    }
}
