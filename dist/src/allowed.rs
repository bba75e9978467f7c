//! Makes sure that every dependency has a licence and a source that `deny.toml` allows.
//!
//! cargo-deny checks the same, and more, from the same file. It takes minutes to build, and this takes none.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use cargo_metadata::Package;
use pdk_model::error::{Error, Place, Result};
use spdx::{Expression, ParseMode};
use toml_edit::{DocumentMut, Item};

use crate::project::Project;

/// The file with the rules, in the workspace.
const RULES: &str = "deny.toml";

/// Checks all dependencies, those of tests and builds too.
///
/// # Errors
/// If one of them is not allowed, with its name, or the rules cannot be read.
pub fn check(project: &Project) -> Result<()> {
    let rules = Rules::read(&project.root().join(RULES))?;
    let elsewhere = project.metadata().packages.iter().filter(|package| package.source.is_some());
    let wrong: Vec<String> = elsewhere.filter_map(|package| rules.objection(package)).collect();
    if wrong.is_empty() { Ok(()) } else { Err(Error::new(wrong.join("\n"))) }
}

/// What is allowed.
struct Rules {
    licences: BTreeSet<String>,
    /// Licences that one crate may have besides.
    exceptions: BTreeMap<String, BTreeSet<String>>,
    registries: BTreeSet<String>,
}

impl Rules {
    fn read(file: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(file).place(file.display())?;
        Self::parse(&text).place(file.display())
    }

    fn parse(text: &str) -> Result<Self> {
        let document: DocumentMut = text.parse().place("it is not TOML")?;
        let licences = texts(document.get("licenses").and_then(|table| table.get("allow")))
            .ok_or_else(|| Error::new("it has no list `allow` in [licenses]"))?;
        let registries = texts(document.get("sources").and_then(|table| table.get("allow-registry")))
            .ok_or_else(|| Error::new("it has no list `allow-registry` in [sources]"))?;
        let mut exceptions = BTreeMap::new();
        let listed = document.get("licenses").and_then(|table| table.get("exceptions"));
        for exception in listed.and_then(Item::as_array).into_iter().flatten() {
            let table = exception.as_inline_table();
            let name = table.and_then(|table| table.get("crate")?.as_str());
            let allowed = table.and_then(|table| table.get("allow")?.as_array());
            let (Some(name), Some(allowed)) = (name, allowed) else {
                return Err(Error::new("an exception in [licenses] has no `crate` or no list `allow`"));
            };
            let allowed = allowed.iter().filter_map(|licence| licence.as_str().map(str::to_owned));
            exceptions.insert(name.to_owned(), allowed.collect());
        }
        Ok(Self { licences, exceptions, registries })
    }

    /// Why a crate is not allowed; none if it is.
    fn objection(&self, package: &Package) -> Option<String> {
        let name = format!("{} {}", package.name, package.version);
        let source = package.source.as_ref().map(ToString::to_string).unwrap_or_default();
        if !self.registries.iter().any(|registry| source.strip_prefix("registry+") == Some(registry)) {
            return Some(format!("{name} comes from {source}, which {RULES} does not allow"));
        }
        let Some(licence) = &package.license else {
            return Some(format!("{name} names no licence; take another crate"));
        };
        if self.allows(&package.name, licence) {
            return None;
        }
        Some(format!(
            "{name} has the licence {licence}, which {RULES} does not allow; take another crate, or add it there"
        ))
    }

    /// Whether one of the choices that an SPDX expression leaves is allowed.
    fn allows(&self, name: &str, licence: &str) -> bool {
        let Ok(expression) = Expression::parse_mode(licence, ParseMode::LAX) else { return false };
        let exceptions = self.exceptions.get(name);
        expression.evaluate(|part| {
            let part = part.to_string();
            self.licences.contains(&part) || exceptions.is_some_and(|allowed| allowed.contains(&part))
        })
    }
}

fn texts(list: Option<&Item>) -> Option<BTreeSet<String>> {
    let list = list?.as_array()?;
    Some(list.iter().filter_map(|text| text.as_str().map(str::to_owned)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Target;

    #[test]
    fn all_dependencies_have_allowed_licences_and_sources() {
        check(&Project::for_target(Target::HERE).unwrap()).unwrap();
    }

    #[test]
    fn what_is_not_allowed_is_named() {
        let rules = r#"
            [licenses]
            allow = ["MIT", "Apache-2.0 WITH LLVM-exception"]
            exceptions = [{ crate = "odd", allow = ["MPL-2.0"] }]
            [sources]
            allow-registry = ["https://example.org/index"]
        "#;
        let rules = Rules::parse(rules).unwrap();
        assert!(rules.allows("a", "GPL-3.0-only OR MIT") && rules.allows("a", "MIT/Apache-2.0"));
        assert!(rules.allows("a", "Apache-2.0 WITH LLVM-exception") && !rules.allows("a", "Apache-2.0"));
        assert!(!rules.allows("a", "MIT AND GPL-3.0-only") && !rules.allows("a", "no licence at all"));
        assert!(rules.allows("odd", "MPL-2.0") && !rules.allows("a", "MPL-2.0"));
        let project = Project::for_target(Target::HERE).unwrap();
        let package = project.metadata().packages.iter().find(|package| package.source.is_some()).unwrap();
        let objection = rules.objection(package).unwrap();
        assert!(objection.contains("crates.io-index, which deny.toml does not allow"), "{objection}");
        assert!(Rules::parse("[licenses]").is_err());
    }
}
