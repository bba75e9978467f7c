//! `pdk new`: writes a working starting point.

use std::fs;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use pdk_components::catalog::Catalog;
use pdk_components::installation;
use pdk_components::product;
use pdk_notice::println;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Place, Result};

use super::Global;

/// Arguments of `pdk new`
#[derive(clap::Args)]
pub struct Arguments {
    /// What to write
    what: What,
    /// Its name: lower-case letters, digits and underscores
    name: String,
    /// The folder to write to [default: the working directory]
    #[arg(short, long, alias = "output", value_name = "DIR")]
    out: Option<PathBuf>,
    /// The folder of the pdk-sdk crate that a plugin builds against [default: the one that comes with pdk]
    #[arg(long, value_name = "DIR")]
    sdk: Option<PathBuf>,
    /// Begin a pipeline with a copy of this one that comes with pdk
    #[arg(long, value_name = "PIPELINE", value_parser = PossibleValuesParser::new(product::get().pipelines.iter().map(|script| script.name)))]
    from: Option<String>,
}

#[derive(Clone, Copy, ValueEnum)]
enum What {
    /// A perturbation in Lua: one file
    Perturbation,
    /// A plugin in Rust with a perturbation: a crate of its own
    Plugin,
    /// A plugin in Rust with a simulator: a crate of its own
    Simulator,
    /// A plugin in Rust with an adapter to a simulator that is a program of its own: a crate of its own
    Adapter,
    /// A plugin in Rust with a driver: a crate of its own
    Driver,
    /// A pipeline in Lua: one file
    Pipeline,
}

/// Writes the files and says what to do with them.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let name = &arguments.name;
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(fits) {
        return Err(Error::new(format!(
            "`{name}` is not a name; use lower-case letters, digits and underscores, with a letter first"
        )));
    }
    if arguments.from.is_some() && !matches!(arguments.what, What::Pipeline) {
        return Err(Error::new("--from is for pipelines; leave it out, or write `pdk new pipeline`"));
    }
    if let Some(kind) = arguments.what.kind() {
        refuse_taken(global.registry()?.catalog(), kind, name)?;
    }
    let folder = arguments.out.clone().unwrap_or_default();
    match arguments.what {
        What::Perturbation => {
            let file = folder.join(format!("{name}.lua"));
            write(&file, include_str!("../../templates/perturbation.lua"), arguments)?;
            println!("Wrote {}. Try it:", file.display());
            println!("  pdk --plugins {} perturb IMAGE --with {name}@2 -o out.png", shown(&folder));
        }
        What::Pipeline => {
            let file = folder.join(format!("{name}.lua"));
            let copied =
                product::get().pipelines.iter().find(|script| Some(script.name) == arguments.from.as_deref());
            let template = copied.map_or(product::get().first_pipeline, |script| script.source);
            write(&file, template, arguments)?;
            println!("Wrote {}. Try it:\n  pdk run {}", file.display(), file.display());
        }
        What::Plugin | What::Simulator | What::Adapter | What::Driver => {
            write_crate(&folder.join(name), arguments)?;
        }
    }
    Ok(())
}

impl What {
    /// The kind of the component that is written; none for a pipeline.
    fn kind(self) -> Option<Kind> {
        match self {
            What::Perturbation | What::Plugin => Some(Kind::Perturbation),
            What::Simulator | What::Adapter => Some(Kind::Simulator),
            What::Driver => Some(Kind::Driver),
            What::Pipeline => None,
        }
    }
}

/// Writes the crate of a plugin.
fn write_crate(folder: &Path, arguments: &Arguments) -> Result<()> {
    let (name, shown) = (&arguments.name, folder.display());
    if folder.exists() {
        return Err(Error::new(format!("{shown} exists already; choose another name")));
    }
    let (source, readme) = match arguments.what {
        What::Simulator => (
            include_str!("../../templates/simulator/lib.rs.txt"),
            include_str!("../../templates/simulator/README.md"),
        ),
        What::Adapter => (
            include_str!("../../templates/adapter/lib.rs.txt"),
            include_str!("../../templates/adapter/README.md"),
        ),
        What::Driver => (
            include_str!("../../templates/driver/lib.rs.txt"),
            include_str!("../../templates/driver/README.md"),
        ),
        What::Plugin | What::Perturbation | What::Pipeline => (
            include_str!("../../templates/plugin/lib.rs.txt"),
            include_str!("../../templates/plugin/README.md"),
        ),
    };
    let sdk = sdk_folder(arguments)?;
    let dependency = |folder: PathBuf| format!("{{ path = {:?} }}", folder.to_string_lossy());
    let mut dependencies = format!("pdk-sdk = {}\n", dependency(sdk.clone()));
    if source.contains("pdk_adapter::") {
        dependencies =
            format!("pdk-adapter = {}\n{dependencies}", dependency(sdk.with_file_name("pdk-adapter")));
    }
    if source.contains("libm::") {
        dependencies = format!("libm = \"0.2\"\n{dependencies}");
    }
    let package =
        include_str!("../../templates/plugin/Cargo.toml.txt").replace("{{dependencies}}", &dependencies);
    for (file, text) in [
        ("Cargo.toml", package.as_str()),
        ("src/lib.rs", source),
        ("README.md", readme),
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

/// Writes a file from a template; never over one that is there.
fn write(file: &Path, template: &str, arguments: &Arguments) -> Result<()> {
    let text = template.replace("{{name}}", &arguments.name).replace("{{type}}", &type_name(&arguments.name));
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

/// `salt_spray` as a type: `SaltSpray`.
fn type_name(name: &str) -> String {
    let capital = |word: &str| {
        let mut letters = word.chars();
        letters
            .next()
            .map(|first| first.to_ascii_uppercase().to_string() + letters.as_str())
            .unwrap_or_default()
    };
    name.split('_').map(capital).collect()
}

fn shown(folder: &Path) -> String {
    if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }
}
