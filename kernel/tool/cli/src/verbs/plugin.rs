//! `pdk plugin`: the plugins that a user has installed.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use pdk_components::catalog::PluginRecord;
use pdk_components::inspection;
use pdk_components::installation;
use pdk_components::loader::Plugin;
use pdk_components::registry::Registry;
use pdk_components::search_path::{is_script, user_folder};
use pdk_lua::perturbation::Source;
use pdk_notice::println;
use pdk_record::files::FileRecord;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::suggest;
use pdk_terminal::table::table;
use serde_json::{Value, json};

use super::{Global, print_json};

/// Arguments of `pdk plugin`
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Install a plugin, or a perturbation in Lua, for this user
    Add {
        /// The plugin's library, or the file of a perturbation in Lua
        file: PathBuf,
        /// Take the place of one of the same name
        #[arg(long)]
        replace: bool,
    },
    /// List what is installed
    List,
    /// Remove what is installed
    Remove {
        /// Its name, as `pdk plugin list` shows it
        name: String,
    },
}

/// Adds, lists or removes.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let folder = user_folder().ok_or_else(|| {
        Error::new("there is no folder for your plugins, because neither XDG_DATA_HOME nor HOME is set; set one of them")
    })?;
    match &arguments.verb {
        Verb::Add { file, replace } => add(global, &folder, file, *replace),
        Verb::List => list(global, &folder),
        Verb::Remove { name } => remove(&folder, name),
    }
}

/// Something that is or can be installed.
struct Installable {
    record: PluginRecord,
    components: Vec<(Kind, String)>,
}

impl Installable {
    /// Loads a file into this process.
    fn load(file: &Path) -> Result<Self> {
        let key = |description: &Description| (description.kind, description.name.clone());
        if is_script(file) {
            let description = pdk_lua::description(&Source::read(file)?)?;
            let (name, version) = (description.name.clone(), description.version.to_string());
            let record = PluginRecord { name, version, homepage: String::new(), built_in: false };
            return Ok(Self { record, components: vec![key(&description)] });
        }
        // What it does when it is opened, it first does to another process.
        inspection::inspect(&[file.to_owned()])?.into_iter().flatten().next().map_or(Ok(()), Err)?;
        let plugin = Plugin::load(file)?;
        let components = plugin.description.components.iter().map(key).collect();
        Ok(Self { record: plugin.record(false), components })
    }

    /// The name of the file under which it is installed: one for each name, so that it is found without loading it.
    fn file_name(&self, file: &Path) -> String {
        let PluginRecord { name, .. } = &self.record;
        if is_script(file) { format!("{name}.lua") } else { library_name(name) }
    }

    fn listed(&self) -> String {
        let names: Vec<_> = self.components.iter().map(|(kind, name)| format!("{kind} `{name}`")).collect();
        names.join(", ")
    }
}

/// The file name of the library of a package, as Cargo names it.
fn library_name(name: &str) -> String {
    let (prefix, ending) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_EXTENSION);
    format!("{prefix}{}.{ending}", name.replace('-', "_"))
}

fn add(global: &Global, folder: &Path, file: &Path, replace: bool) -> Result<()> {
    let shown = file.display();
    let file = fs::canonicalize(file).place(format_args!("cannot find {shown}"))?;
    if !file.is_file() {
        return Err(Error::new(format!(
            "{shown} is not a file; name the library of a plugin, or a Lua file"
        )));
    }
    let new = Installable::load(&file)?;
    let PluginRecord { name, version, .. } = &new.record;
    let target = folder.join(new.file_name(&file));
    if target.exists() {
        if FileRecord::of(&target)?.blake3 == FileRecord::of(&file)?.blake3 {
            println!("{name} {version} is installed already, in {}.", target.display());
            return Ok(());
        }
        if !replace {
            return Err(Error::new(format!(
                "another {name} is installed already, in {}; put {shown} in its place with --replace, or remove that with \
                 `pdk plugin remove {name}`",
                target.display()
            )));
        }
    }
    refuse_taken(&global.registry()?, &new, &file, &target)?;
    copy(&file, &target)?;
    println!("Installed {name} {version} in {}: {}.", target.display(), new.listed());
    Ok(())
}

/// Refuses what would be left out, because something else has the name of one of its components.
fn refuse_taken(registry: &Registry, new: &Installable, file: &Path, target: &Path) -> Result<()> {
    let libraries = installation::libraries()?;
    for (kind, name) in &new.components {
        let Ok(taken) = registry.catalog().get(*kind, name) else { continue };
        let same = |path: &Path| fs::canonicalize(path).is_ok_and(|path| path == taken.file);
        // A library of pdk's, or a script within it.
        let built_in = taken.blake3.is_some() || libraries.contains(&taken.file);
        if same(file) && !built_in || same(target) {
            continue;
        }
        let remedy = if built_in { "which comes with pdk; rename yours" } else { "rename one of the two" };
        return Err(Error::new(format!(
            "{} is not installed, because there is a {kind} `{name}` already, in {}, {remedy}",
            new.record.name,
            taken.file.display()
        )));
    }
    Ok(())
}

/// Copies a file: it is there as a whole or not at all, and a process that has the old one loaded keeps that.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let copied = to.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| {
        let mut from = fs::File::open(from)?;
        pdk_sdk::file::write_with(to, |file| std::io::copy(&mut from, file).map(drop))
    });
    copied.place(format_args!("cannot write {}", to.display()))
}

fn list(global: &Global, folder: &Path) -> Result<()> {
    let mut found = Vec::new();
    for file in installed(folder)? {
        let loaded = Installable::load(&file);
        // The whole path, because it does not depend on the working directory.
        let record = FileRecord { path: file.clone(), ..FileRecord::of(&file)? };
        found.push((record, loaded));
    }
    if global.json {
        let entry = |(file, loaded): &(FileRecord, Result<Installable>)| -> Value {
            match loaded {
                Ok(Installable { record, components }) => json!({
                    "name": record.name,
                    "version": record.version,
                    "homepage": record.homepage,
                    "components": components.iter().map(|(kind, name)| json!({ "kind": kind, "name": name })).collect::<Vec<_>>(),
                    "file": file,
                }),
                Err(error) => {
                    json!({ "name": name_of(&file.path), "error": error.to_string(), "file": file })
                }
            }
        };
        return print_json(&found.iter().map(entry).collect());
    }
    if found.is_empty() {
        println!("Nothing is installed in {}; `pdk plugin add FILE` installs a plugin.", folder.display());
        return Ok(());
    }
    let mut table = table(["plugin", "version", "components", "file"]);
    for (file, loaded) in &found {
        let path = file.path.display().to_string();
        match loaded {
            Ok(Installable { record: PluginRecord { name, version, .. }, .. }) => {
                let listed = loaded.as_ref().map(Installable::listed).unwrap_or_default();
                table.add_row([name.clone(), version.clone(), listed, path])
            }
            Err(error) => {
                table.add_row([name_of(&file.path), "-".to_owned(), format!("cannot be used: {error}"), path])
            }
        };
    }
    println!("{table}");
    Ok(())
}

fn remove(folder: &Path, name: &str) -> Result<()> {
    let known = installed(folder)?;
    let file_name = |file: &&PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let wanted = [name.to_owned(), library_name(name), format!("{name}.lua")];
    let found: Vec<_> = known.iter().filter(|file| wanted.contains(&file_name(file))).collect();
    match found.as_slice() {
        [file] => {
            fs::remove_file(file).place(format_args!("cannot remove {}", file.display()))?;
            println!("Removed {}.", file.display());
            Ok(())
        }
        [] => {
            let names: Vec<_> = known.iter().map(|file| name_of(file)).collect();
            let hint = suggest::hint(name, names.iter().map(String::as_str));
            Err(Error::new(format!("no plugin `{name}` is installed in {}; {hint}", folder.display())))
        }
        [first, ..] => Err(Error::new(format!(
            "a library and a script are installed under the name {name}; name the file, such as {}",
            file_name(first)
        ))),
    }
}

/// The libraries and scripts in a folder, by name.
fn installed(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => {
            return Err(Error::new(format!("the folder {} cannot be read ({error})", folder.display())));
        }
    };
    let fits = |file: &PathBuf| {
        let library = file.extension().is_some_and(|ending| ending == std::env::consts::DLL_EXTENSION);
        file.is_file() && (library || is_script(file))
    };
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).filter(fits).collect();
    files.sort();
    Ok(files)
}

/// The name under which a file is installed, without loading it.
fn name_of(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let prefix = if is_script(file) { "" } else { std::env::consts::DLL_PREFIX };
    stem.strip_prefix(prefix).unwrap_or(&stem).to_owned()
}
