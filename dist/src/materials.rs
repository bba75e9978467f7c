//! The bill of materials: everything that is compiled into pdk, in the format CycloneDX.

use std::collections::BTreeMap;

use cargo_metadata::Package;
use pdk_model::error::{Error, Place, Result};
use serde_json::{Value, json};
use spdx::Expression;
use toml_edit::DocumentMut;

use crate::licences::compiled_in;
use crate::project::Project;

/// The bill of materials as JSON.
///
/// # Errors
/// If the dependencies cannot be read, or one of them names no licence.
pub fn bill(project: &Project) -> Result<String> {
    let executable = project.executable()?;
    let checksums = checksums(project)?;
    let components = compiled_in(project)?
        .into_iter()
        .map(|package| component(package, &checksums))
        .collect::<Result<Vec<Value>>>()?;
    let bill = json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": purl(executable),
                "name": executable.name,
                "version": executable.version.to_string(),
                "licenses": [{ "expression": executable.license }],
            },
            "properties": [{ "name": "target", "value": project.target().triple() }],
        },
        "components": components,
    });
    Ok(serde_json::to_string_pretty(&bill)? + "\n")
}

fn component(package: &Package, checksums: &BTreeMap<String, String>) -> Result<Value> {
    let name = format!("{} {}", package.name, package.version);
    let licence =
        package.license.as_deref().ok_or_else(|| Error::new(format!("the crate {name} names no licence")))?;
    // Old manifests have `MIT/Apache-2.0`, which is not an expression.
    let licence = Expression::canonicalize(licence).place(&name)?.unwrap_or_else(|| licence.to_owned());
    let checksum = checksums.get(&name).ok_or_else(|| {
        Error::new(format!("Cargo.lock has no checksum of {name}; run `cargo update --locked`"))
    })?;
    let mut component = json!({
        "type": "library",
        "bom-ref": purl(package),
        "name": package.name,
        "version": package.version.to_string(),
        "purl": purl(package),
        "licenses": [{ "expression": licence }],
        "hashes": [{ "alg": "SHA-256", "content": checksum }],
    });
    if let Some(home) = &package.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": home }]);
    }
    Ok(component)
}

/// The name of a crate as other tools have it.
fn purl(package: &Package) -> String {
    format!("pkg:cargo/{}@{}", package.name, package.version)
}

/// The SHA-256 of the crates from elsewhere, by name and version.
fn checksums(project: &Project) -> Result<BTreeMap<String, String>> {
    let file = project.root().join("Cargo.lock");
    let text = std::fs::read_to_string(&file).place(file.display())?;
    let document: DocumentMut = text.parse().place(file.display())?;
    let packages = document.get("package").and_then(|packages| packages.as_array_of_tables());
    let packages = packages.ok_or_else(|| Error::new(format!("{} lists no packages", file.display())))?;
    let text = |table: &toml_edit::Table, key: &str| table.get(key)?.as_str().map(str::to_owned);
    Ok(packages
        .iter()
        .filter_map(|package| {
            let name = format!("{} {}", text(package, "name")?, text(package, "version")?);
            Some((name, text(package, "checksum")?))
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Target;

    #[test]
    fn the_bill_has_every_crate_with_its_licence_and_hash() {
        let project = Project::for_target(Target::HERE).unwrap();
        let bill: Value = serde_json::from_str(&bill(&project).unwrap()).unwrap();
        let components = bill["components"].as_array().unwrap();
        assert_eq!(components.len(), compiled_in(&project).unwrap().len());
        let found = |name: &str| components.iter().find(|component| component["name"] == name);
        let blake3 = found("blake3").unwrap();
        assert_eq!(blake3["purl"], format!("pkg:cargo/blake3@{}", blake3["version"].as_str().unwrap()));
        assert!(found("proptest").is_none() && found("pdk-session").is_none());
        for component in components {
            let licence = component["licenses"][0]["expression"].as_str().unwrap();
            assert!(Expression::parse(licence).is_ok(), "{component}");
            assert_eq!(component["hashes"][0]["content"].as_str().unwrap().len(), 64, "{component}");
        }
    }
}
