//! The Python package. Its own tests, in sdk/python/tests, run against the installed package.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pdk_model::perturbation::MODIFIERS;
use pdk_tests::{built, repository, temp};

/// A command that has to succeed, with what it said if it does not.
#[track_caller]
fn succeed(command: &mut Command) {
    let output = command.stdin(Stdio::null()).output().unwrap();
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
}

/// Whether Python is there and imports these modules.
fn imports(modules: &str) -> bool {
    let found =
        Command::new("python3").args(["-c", &format!("import {modules}")]).stderr(Stdio::null()).status();
    let found = found.is_ok_and(|status| status.success());
    if !found {
        eprintln!("skipped: python3 does not import {modules}");
    }
    found
}

#[test]
fn the_declarations_are_up_to_date() {
    if imports("json") {
        let script = repository().join("sdk/python/stubs.py");
        succeed(Command::new("python3").arg(script).arg(built("pdk")).arg("--check"));
    }
}

#[test]
fn the_declarations_have_all_modifiers() {
    let text =
        std::fs::read_to_string(repository().join("sdk/python/pdk_perturb/perturbations.pyi")).unwrap();
    for modifier in MODIFIERS.iter().filter(|modifier| modifier.name != "level") {
        assert!(text.contains(&format!("    {}: ", modifier.name)), "{}", modifier.name);
    }
}

/// The wheel that `pdk-dist` made of what is built.
fn wheel() -> Option<PathBuf> {
    const REMEDY: &str =
        "make one with `cargo run --release -p pdk-dist -- --profile release --no-package --wheel`";
    let changed = |file: &Path| file.metadata().and_then(|file| file.modified()).ok();
    let folder = repository().join("target/pdk-dist");
    let wheels = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let newest = wheels
        .filter(|file| file.extension().is_some_and(|ending| ending == "whl"))
        .max_by_key(|file| changed(file));
    match &newest {
        None => eprintln!("skipped: there is no wheel; {REMEDY}"),
        Some(file) if changed(file) < changed(&built("pdk")) => {
            eprintln!("skipped: {} is older than what is built; {REMEDY}", file.display());
            return None;
        }
        Some(_) => {}
    }
    newest
}

#[test]
fn the_package_passes_its_tests() {
    let Some(wheel) = wheel().filter(|_| imports("numpy, PIL, pip, pytest")) else { return };
    let folder = temp();
    let site = folder.path().join("site");
    let pip = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target"];
    succeed(Command::new("python3").args(pip).arg(&site).arg(wheel));
    let tests: &Path = &repository().join("sdk/python/tests");
    let options = ["-m", "pytest", "-q", "-p", "no:cacheprovider"];
    let mut command = Command::new("python3");
    command.args(options).arg(tests).current_dir(folder.path());
    succeed(command.env("PYTHONPATH", &site).env("PYTHONDONTWRITEBYTECODE", "1"));
}
