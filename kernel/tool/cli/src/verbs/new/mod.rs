//! `pdk new`: writes a working starting point.

use std::fs;
use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use pdk_components::catalog::Catalog;
use pdk_components::installation;
use pdk_components::product;
use pdk_notice::println;
use pdk_sdk::SDK_VERSION;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Place, Result};

use self::template::{Crate, What};
use super::Global;

mod network;
mod template;

/// What a template may need besides the SDK: how its source names it, and the line for the manifest.
const FROM_ELSEWHERE: [(&str, &str); 2] = [
    ("image::", r#"image = { version = "0.25", default-features = false, features = ["jpeg", "png"] }"#),
    ("libm::", r#"libm = "0.2""#),
];

/// The types that `pdk_sdk::export!` names, which an own type of the same name would stand in for.
const OF_EXPORT: [&str; 5] = ["Components", "Exported", "LibHeader", "Package", "Registration"];

/// Arguments of `pdk new`
#[derive(clap::Args)]
pub struct Arguments {
    /// What to write
    what: What,
    /// Its name: lower-case letters, digits and underscores; for a network, its ONNX file
    name: String,
    /// The folder to write to [default: the working directory; for a network, that of its file]
    #[arg(short, long, alias = "output", value_name = "DIR")]
    out: Option<PathBuf>,
    /// The folder of the pdk-sdk crate that a plugin builds against [default: the one that comes with pdk]
    #[arg(long, value_name = "DIR")]
    sdk: Option<PathBuf>,
    /// Write a perturbation or a mask in Rust; other components are in Rust anyway
    #[arg(long)]
    rust: bool,
    /// Begin a pipeline with a copy of this one that comes with pdk
    #[arg(long, value_name = "PIPELINE", value_parser = PossibleValuesParser::new(product::get().pipelines.iter().map(|script| script.name)))]
    from: Option<String>,
}

/// Writes the files and says what to do with them.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if arguments.what == What::Network {
        return network::write(arguments);
    }
    let name = &arguments.name;
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(fits) {
        return Err(Error::new(format!(
            "`{name}` is not a name; use lower-case letters, digits and underscores, with a letter first"
        )));
    }
    if arguments.from.is_some() && arguments.what != What::Pipeline {
        return Err(Error::new("--from is for pipelines; leave it out, or write `pdk new pipeline`"));
    }
    if let Some(kind) = arguments.what.kind() {
        refuse_taken(global.registry()?.catalog(), kind, name)?;
    }
    let folder = arguments.out.clone().unwrap_or_default();
    match (arguments.what.script(), arguments.what.package()) {
        (Some([source, attempt]), _) if !arguments.rust => {
            let file = folder.join(format!("{name}.lua"));
            write(&file, source, arguments)?;
            let attempt = attempt.replace("{{folder}}", &shown(&folder));
            let attempt = filled(&attempt, name);
            println!("Wrote {}. Try it:\n  {attempt}", file.display());
            Ok(())
        }
        (_, Some(package)) => write_crate(&folder.join(name), &package, arguments),
        (_, None) => write_pipeline(&folder.join(format!("{name}.lua")), arguments),
    }
}

/// Writes a small pipeline, or the copy of one that comes with pdk.
fn write_pipeline(file: &Path, arguments: &Arguments) -> Result<()> {
    if arguments.rust {
        return Err(Error::new("--rust is for components; a pipeline is a script, so leave it out"));
    }
    let copied =
        product::get().pipelines.iter().find(|script| Some(script.name) == arguments.from.as_deref());
    write(file, copied.map_or(product::get().first_pipeline, |script| script.source), arguments)?;
    println!("Wrote {}. Try it:\n  pdk run {}", file.display(), file.display());
    Ok(())
}

/// Writes the crate of a plugin.
fn write_crate(folder: &Path, package: &Crate, arguments: &Arguments) -> Result<()> {
    let (name, shown) = (&arguments.name, folder.display());
    if folder.exists() {
        return Err(Error::new(format!("{shown} exists already; choose another name")));
    }
    let Crate { source, readme, kind, attempt } = package;
    let sdk = sdk_folder(arguments)?;
    let adapter =
        source.contains("pdk_adapter::").then(|| ("pdk-adapter", sdk.with_file_name("pdk-adapter")));
    let mut dependencies = String::new();
    let mut patches = String::new();
    for (_, line) in FROM_ELSEWHERE.iter().filter(|(module, _)| source.contains(module)) {
        dependencies.push_str(line);
        dependencies.push('\n');
    }
    for (part, folder) in adapter.into_iter().chain([("pdk-sdk", sdk)]) {
        dependencies.push_str(&format!("{part} = {SDK_VERSION:?}\n"));
        patches.push_str(&format!("{part} = {{ path = {:?} }}\n", folder.to_string_lossy()));
    }
    let manifest = include_str!("../../../templates/Cargo.toml.txt")
        .replace("{{dependencies}}", &dependencies)
        .replace("{{patches}}", &patches);
    let readme = readme.replace("{{kind}}", kind).replace("{{try}}", attempt);
    for (file, text) in [
        ("Cargo.toml", manifest.as_str()),
        ("src/lib.rs", source),
        ("README.md", &readme),
        (".gitignore", "/target\n"),
    ] {
        write(&folder.join(file), text, arguments)?;
    }
    let library = format!("target/release/lib{name}.{}", std::env::consts::DLL_EXTENSION);
    println!("Wrote {shown}. Build, test, check and install it:");
    println!("  cd {shown} && cargo test --release && cargo build --release");
    println!("  pdk check {library} && pdk plugin add {library}");
    Ok(())
}

/// Refuses the name of a component that is there already: one of the two would be left out.
fn refuse_taken(catalog: &Catalog, kind: Kind, name: &str) -> Result<()> {
    match catalog.get(kind, name) {
        Ok(taken) => Err(Error::new(format!(
            "there is a {kind} `{name}` already, in {}; choose another name",
            taken.file.display()
        ))),
        Err(_) => Ok(()),
    }
}

/// A template with the name of what is new, and with the components of the product that it is tried with.
fn filled(template: &str, name: &str) -> String {
    let samples = product::get().samples.iter();
    samples
        .fold(template.replace("{{name}}", name), |text, (place, component)| text.replace(place, component))
}

/// Writes a file from a template; never over one that is there.
fn write(file: &Path, template: &str, arguments: &Arguments) -> Result<()> {
    let text = filled(template, &arguments.name).replace("{{type}}", &type_name(&arguments.name, template));
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder).place(format_args!("cannot make the folder {}", folder.display()))?;
    }
    if file.symlink_metadata().is_ok() {
        return Err(Error::new(format!(
            "cannot write {}: it exists already; choose another name or --out",
            file.display()
        )));
    }
    pdk_sdk::file::write(file, text.as_bytes()).place(format_args!("cannot write {}", file.display()))
}

/// The folder of the crate pdk-sdk: its source comes with pdk, unless the user names another.
fn sdk_folder(arguments: &Arguments) -> Result<PathBuf> {
    match &arguments.sdk {
        Some(folder) if !folder.join("Cargo.toml").is_file() => Err(Error::new(format!(
            "--sdk: {} is not a crate; name the folder with the Cargo.toml of pdk-sdk",
            folder.display()
        ))),
        Some(folder) => fs::canonicalize(folder).place(folder.display()),
        None => Ok(installation::sdk()?.join("pdk-sdk")),
    }
}

/// `salt_spray` as a type: `SaltSpray`. A name that the source has for something else, such as `Driver`, becomes `MyDriver`.
fn type_name(name: &str, source: &str) -> String {
    let capital = |word: &str| {
        let mut letters = word.chars();
        letters
            .next()
            .map(|first| first.to_ascii_uppercase().to_string() + letters.as_str())
            .unwrap_or_default()
    };
    let name: String = name.split('_').map(capital).collect();
    match words(source).chain(OF_EXPORT).any(|word| word == name) {
        true => format!("My{name}"),
        false => name,
    }
}

fn words(source: &str) -> impl Iterator<Item = &str> {
    source.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
}

fn shown(folder: &Path) -> String {
    if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_type_of_a_component_is_not_one_that_its_source_names() {
        for (what, name, expected) in [
            (What::Driver, "driver", "MyDriver"),
            (What::Driver, "self", "MySelf"),
            (What::Simulator, "state", "MyState"),
            (What::Simulator, "frame_mut", "MyFrameMut"),
            (What::Dataset, "row", "MyRow"),
            (What::Search, "option", "MyOption"),
            (What::Adapter, "value", "MyValue"),
            (What::Perturbation, "package", "MyPackage"),
            (What::Perturbation, "salt_spray", "SaltSpray"),
        ] {
            assert_eq!(type_name(name, what.package().unwrap().source), expected);
        }
    }

    #[test]
    fn the_types_that_the_macro_names_are_known() {
        let source = include_str!("../../../../../../sdk/pdk-sdk/src/export.rs");
        let (_, code) = source.split_once("macro_rules! export").unwrap();
        let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        let is_type = |word: &&str| {
            word.starts_with(|c: char| c.is_ascii_uppercase())
                && word.contains(|c: char| c.is_ascii_lowercase())
        };
        let mut types: Vec<&str> = lines.flat_map(words).filter(is_type).collect();
        types.sort_unstable();
        types.dedup();
        assert_eq!(types, OF_EXPORT);
    }
}
