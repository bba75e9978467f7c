//! What was run, from the manifest.

use pdk_record::manifest::Manifest;
use pdk_terminal::shell::quoted;
use serde_json::Value;

use crate::view::{Component, Setup};

/// What a run is called.
pub fn title(manifest: &Manifest) -> String {
    manifest.pipeline.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// What has to be equal for two runs to be equal.
pub fn setup(manifest: &Manifest) -> Setup {
    let machine = &manifest.machine;
    let settings = manifest.settings.as_object();
    let settings =
        settings.map(|table| table.iter().map(|(key, value)| (key.clone(), text(value))).collect());
    Setup {
        version: manifest.pdk.clone(),
        seed: manifest.seed,
        pipeline: manifest.pipeline.path.display().to_string(),
        source: manifest.pipeline.source.clone(),
        modules: manifest
            .pipeline
            .modules
            .iter()
            .map(|module| (module.name.clone(), module.source.clone()))
            .collect(),
        command: command(manifest),
        settings: settings.unwrap_or_default(),
        components: manifest
            .components
            .iter()
            .map(|component| Component {
                kind: component.kind.to_string(),
                name: component.name.clone(),
                version: component.version,
                info: component.info.iter().map(|(k, v)| format!("{k} {v}")).collect::<Vec<_>>().join(", "),
                file: component.file.path.display().to_string(),
                hash: component.file.blake3.clone(),
            })
            .collect(),
        files: manifest
            .files
            .iter()
            .map(|file| (file.path.display().to_string(), file.blake3.clone()))
            .collect(),
        machine: format!("{} on {}, {} processors", machine.system, machine.architecture, machine.processors),
    }
}

/// A setting as the command line takes it.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// The command that repeats a run. The manifest does not tell defaults from what was set, so it names all settings.
fn command(manifest: &Manifest) -> String {
    let pipeline = quoted(&manifest.pipeline.path.to_string_lossy());
    let text = |key: &str| manifest.settings.get(key).and_then(Value::as_str).map(quoted);
    // A gate has no pipeline: what it ran is a suite.
    let gate = match (text("old"), text("new"), text("suite")) {
        (Some(old), Some(new), Some(suite)) if pipeline.ends_with(".toml") => {
            Some(format!("pdk gate {old} {new} --suite {suite}"))
        }
        _ => None,
    };
    let is_gate = gate.is_some();
    let mut command = gate.unwrap_or_else(|| format!("pdk run {pipeline} --seed {}", manifest.seed));
    for (option, folders) in [("--plugins", &manifest.plugins), ("--drop-ins", &manifest.drop_ins)] {
        for folder in folders {
            command += &format!(" \\\n  {option} {}", quoted(&folder.to_string_lossy()));
        }
    }
    for (key, value) in manifest.settings.as_object().filter(|_| !is_gate).into_iter().flatten() {
        // An empty table may be meant as either; a list does for both.
        let value = self::text(value);
        command += &format!(" \\\n  --set {}", quoted(&format!("{key}={value}")));
    }
    command
}
