//! The keyword arguments of the Python package, written from what can be set for every run and what scenarios share.

use pdk_model::described::Field;
use pdk_model::perturbation::MODIFIERS;

use crate::records::SESSION_REQUEST;
use crate::run_settings::RUN_SETTINGS;

/// The module of the package that has them.
pub fn module() -> String {
    let mut text = String::from(
        "\"\"\"The keyword arguments of runs. Written by `PDK_BLESS=1 cargo test --release -p pdk-pipeline`.\"\"\"\n\n\
         from __future__ import annotations\n\n\
         from collections.abc import Mapping\n\
         from os import PathLike\n\
         from typing import Any, TypedDict\n\n\n\
         class RunSettings(TypedDict, total=False):\n    \
         \"\"\"What can be set for every run; `None` leaves a setting as it is.\"\"\"\n",
    );
    for setting in RUN_SETTINGS {
        text += &format!("\n    #: {}.\n    {}: {} | None\n", setting.help(), setting.name, setting.python);
    }
    text += "\n\nclass SessionSettings(RunSettings, total=False):\n    \
             \"\"\"The settings of a session, which include the defaults of its scenarios.\"\"\"\n";
    for field in SESSION_REQUEST.fields {
        text += &format!("\n    #: {}\n    {}: {} | None\n", field.doc, field.name, python_type(field));
    }
    text += "\n\n#: What every perturbation takes besides its level and its own parameters, with its type.\nMODIFIERS = {\n";
    // The level is a parameter of its own in Python.
    for modifier in MODIFIERS.iter().filter(|modifier| modifier.name != "level") {
        text += &format!("    \"{}\": '{}',\n", modifier.name, modifier.python);
    }
    text + "}\n"
}

/// The type in Python that a type in Luau stands for.
fn python_type(field: &Field) -> &'static str {
    match field.luau_type.trim_end_matches('?') {
        "number" if field.json.starts_with("number") => "float",
        "number" => "int",
        "(string | Component)" => "str | Mapping[str, Any]",
        text if text == "string" || text.starts_with("(\"") => "str",
        "boolean" => "bool",
        _ => "Mapping[str, Any]",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `PDK_BLESS=1` writes the file anew.
    #[test]
    fn the_committed_module_is_up_to_date() {
        let root =
            std::env::var("PDK_TEST_ROOT").unwrap_or(concat!(env!("CARGO_MANIFEST_DIR"), "/../../..").into());
        let file = std::path::Path::new(&root).join("sdk/python/pdk_perturb/_settings.py");
        if std::env::var_os("PDK_BLESS").is_some() {
            std::fs::write(&file, module()).unwrap();
        }
        let found = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(found == module(), "{} is stale; run the tests with PDK_BLESS=1", file.display());
    }
}
