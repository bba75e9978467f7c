//! The licences of everything that is compiled into pdk, with their texts.
//!
//! Texts are those that the authors put beside their source. If a crate brings none, the text of the licence that its manifest
//! names is taken from the SPDX list.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;

use cargo_metadata::{DependencyKind, Package, PackageId, TargetKind};
use pdk_model::error::{Error, Place, Result};
use spdx::expression::ExpressionReq;
use spdx::{AdditionItem, Expression, ParseMode};
use walkdir::WalkDir;

use crate::Profile;
use crate::project::Project;

/// What the names of files with licences begin with, in capitals. The last two are licences of fonts.
const NAMES: [&str; 8] = ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE", "OFL", "UFL"];
/// How deep below a crate's folder they lie: foreign source has a folder of its own, and its licence in there.
const DEPTH: usize = 3;
/// A longer file is not a licence.
const LARGEST: u64 = 256 << 10;

/// What the name of a crate ends in that brings the source which a build script compiles.
const SOURCE: &str = "-src";

/// Something that is compiled in.
struct Part {
    name: String,
    /// The licence as an SPDX expression.
    licence: String,
    /// Where it comes from.
    home: String,
    texts: Vec<String>,
}

/// The page with all licences.
///
/// # Errors
/// If a crate names no licence, or names one without a text that is known.
pub fn page(project: &Project, profile: Profile) -> Result<String> {
    let mut parts = compiled_in(project)?.into_iter().map(part).collect::<Result<Vec<_>>>()?;
    let named = |name: &str, licence: &str, home: &str| -> Result<Part> {
        let texts = spdx_texts(licence).place(name)?;
        Ok(Part { name: name.to_owned(), licence: licence.to_owned(), home: home.to_owned(), texts })
    };
    parts.push(named("The Rust standard library", "MIT OR Apache-2.0", "https://github.com/rust-lang/rust")?);
    if profile == Profile::Dist {
        let licence = "Apache-2.0 WITH LLVM-exception";
        parts.push(named("libc++ and libunwind", licence, "https://github.com/llvm/llvm-project")?);
    }
    Ok(render(&parts))
}

/// The crates from elsewhere whose code is in the executable, a library or the Python package.
pub fn compiled_in(project: &Project) -> Result<Vec<&Package>> {
    let metadata = project.metadata();
    let resolve =
        metadata.resolve.as_ref().ok_or_else(|| Error::new("cargo does not list the dependencies"))?;
    let nodes: BTreeMap<&PackageId, _> = resolve.nodes.iter().map(|node| (&node.id, node)).collect();
    let mut found = BTreeSet::new();
    let mut next: Vec<&PackageId> = project.plugins().iter().map(|package| &package.id).collect();
    next.push(&project.executable()?.id);
    next.push(&project.python()?.id);
    while let Some(id) = next.pop() {
        if !found.insert(id) {
            continue;
        }
        // What a crate that brings source needs, it needs to compile it.
        let node = nodes.get(id).filter(|_| !metadata[id].name.ends_with(SOURCE));
        for dependency in node.into_iter().flat_map(|node| &node.deps) {
            let package = &metadata[&dependency.pkg];
            let is_macro = package.targets.iter().any(|target| target.kind.contains(&TargetKind::ProcMacro));
            let is_linked = dependency.dep_kinds.iter().any(|kind| match kind.kind {
                DependencyKind::Normal => !is_macro,
                DependencyKind::Build => package.name.ends_with(SOURCE),
                _ => false,
            });
            if is_linked {
                next.push(&dependency.pkg);
            }
        }
    }
    let packages = found.into_iter().map(|id| &metadata[id]);
    let mut packages: Vec<_> = packages.filter(|package| package.source.is_some()).collect();
    packages.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
    Ok(packages)
}

fn part(package: &Package) -> Result<Part> {
    let name = format!("{} {}", package.name, package.version);
    let folder = package.manifest_path.parent().ok_or_else(|| Error::new(format!("{name} has no folder")))?;
    let mut texts = texts_in(folder.as_std_path())?;
    let licence = match (&package.license, &package.license_file) {
        (Some(licence), _) => licence.clone(),
        (None, Some(file)) => format!("see {file}"),
        (None, None) => return Err(Error::new(format!("the crate {name} names no licence"))),
    };
    if texts.is_empty() {
        texts = spdx_texts(&licence).place(&name)?;
    }
    let home = package.repository.clone().or_else(|| package.homepage.clone()).unwrap_or_default();
    Ok(Part { name, licence, home, texts })
}

/// The licences that lie in a folder.
fn texts_in(folder: &Path) -> Result<Vec<String>> {
    let mut texts = Vec::new();
    for entry in WalkDir::new(folder).max_depth(DEPTH).sort_by_file_name() {
        let entry = entry.place(folder.display())?;
        let name = entry.file_name().to_string_lossy().to_uppercase();
        let is_source = [".RS", ".C", ".H", ".PY"].iter().any(|ending| name.ends_with(ending));
        let is_licence = NAMES.iter().any(|start| name.starts_with(start)) && !is_source;
        if is_licence
            && entry.file_type().is_file()
            && entry.metadata().place(folder.display())?.len() <= LARGEST
        {
            let text = fs::read(entry.path()).place(entry.path().display())?;
            let text = String::from_utf8_lossy(&text).replace("\r\n", "\n").trim().to_owned();
            if !text.is_empty() && !texts.contains(&text) {
                texts.push(text);
            }
        }
    }
    Ok(texts)
}

/// The texts of the licences of an SPDX expression.
fn spdx_texts(licence: &str) -> Result<Vec<String>> {
    let expression = Expression::parse_mode(licence, ParseMode::LAX).place(licence)?;
    let mut texts = Vec::new();
    for ExpressionReq { req, .. } in expression.requirements() {
        let unknown = || Error::new(format!("the text of the licence {req} is not known"));
        texts.push(req.license.id().ok_or_else(unknown)?.text().trim().to_owned());
        match &req.addition {
            None => {}
            Some(AdditionItem::Spdx(exception)) => texts.push(exception.text().trim().to_owned()),
            Some(AdditionItem::Other(_)) => return Err(unknown()),
        }
    }
    Ok(texts)
}

/// A list of all parts, and each text once.
fn render(parts: &[Part]) -> String {
    let mut texts: Vec<&String> = Vec::new();
    let mut page = String::from(
        "pdk itself is under the licence that lies beside this file. It contains the works below, each under its own licence. The\n\
         numbers are those of the texts that follow the list.\n\n",
    );
    for part in parts {
        let numbers: Vec<String> = part
            .texts
            .iter()
            .map(|text| {
                let known = texts.iter().position(|known| same(known, text));
                let place = known.unwrap_or_else(|| {
                    texts.push(text);
                    texts.len() - 1
                });
                (place + 1).to_string()
            })
            .collect();
        let Part { name, licence, home, .. } = part;
        // Writing to a text cannot fail.
        let _ = writeln!(page, "{name}: {licence} [{}] {home}", numbers.join(", "));
    }
    for (number, text) in (1..).zip(texts) {
        let _ = write!(page, "\n{}\n[{number}]\n\n{text}\n", "=".repeat(80));
    }
    page
}

/// Whether two texts differ in their white space alone.
fn same(a: &str, b: &str) -> bool {
    a.split_whitespace().eq(b.split_whitespace())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Target;

    #[test]
    fn everything_that_is_compiled_in_has_its_licence() {
        let project = Project::for_target(Target::HERE).unwrap();
        let page = page(&project, Profile::Dist).unwrap();
        let list = page.split("=====").next().unwrap();
        // A normal dependency, native source, a font, what the compiler adds; macros and build tools are not compiled in.
        for name in [
            "libloading 0.",
            "openh264-sys2 0.",
            "luau0-src",
            "epaint_default_fonts",
            "zstd-sys",
            "libunwind",
        ] {
            let line =
                list.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("{name}: {list}"));
            assert!(!line.contains("[]"), "{line}");
        }
        for name in ["serde_derive ", "cc 1", "nasm-rs", "pdk-session", "proptest"] {
            assert!(!list.lines().any(|line| line.starts_with(name)), "{name}");
        }
        for text in
            ["Cisco Systems", "Roblox Corporation", "Yann Collet|Meta Platforms", "SIL OPEN FONT|UBUNTU FONT"]
        {
            assert!(text.split('|').any(|text| page.contains(text)), "{text}");
        }
    }

    #[test]
    fn equal_texts_are_printed_once() {
        let part = |name: &str, text: &str| Part {
            name: name.to_owned(),
            licence: "MIT".to_owned(),
            home: String::new(),
            texts: vec![text.to_owned()],
        };
        let page = render(&[part("a", "one\n two"), part("b", "one two"), part("c", "three")]);
        assert!(page.contains("a: MIT [1]") && page.contains("b: MIT [1]") && page.contains("c: MIT [2]"));
        assert_eq!(page.matches("====\n[").count(), 2);
    }
}
