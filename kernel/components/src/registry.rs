//! Finds components and makes instances of them.

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind as IoErrorKind;
use std::path::{Path, PathBuf};

use pdk_model::scale_file::{self, Scale};
use pdk_sdk::abi::host::Instance;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::each_kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::input_files::InputFiles;
use serde_json::{Map, Value};

use crate::catalog::{Catalog, Entry, drop_in_name};
use crate::inspection;
use crate::installation;
use crate::loader::Plugin;
use crate::product::{self, BuiltInScript};
use crate::search_path::{self, PATH_VARIABLE, SearchPath, is_script};
use pdk_supervise::calls::{self, Function};

/// Makes components from scripts. The kernel knows no script language; the program that starts it brings one along.
pub trait Scripts: Send + Sync {
    /// The description of the component in a script; none if the script is something else, such as a pipeline.
    ///
    /// # Errors
    /// If it is meant as a component and is not a valid one.
    fn describe(&self, script: Script<'_>) -> Result<Option<Description>>;

    /// Makes an instance of the component in a script, with parameters that have been checked.
    ///
    /// # Errors
    /// If it cannot be made.
    fn create(&self, script: Script<'_>, config: &Config) -> Result<Instance>;
}

/// A script that may hold a component.
#[derive(Debug, Clone, Copy)]
pub enum Script<'a> {
    /// A file.
    File(&'a Path),
    /// One that is part of pdk.
    BuiltIn(&'a BuiltInScript),
}

/// All components that were found, with what it takes to make instances of them.
pub struct Registry {
    catalog: Catalog,
    /// Where the code of each component of the catalog is, by kind and name.
    sources: Vec<((Kind, String), Source)>,
    plugins: Vec<Plugin>,
    scripts: Box<dyn Scripts>,
    /// Files that were looked at.
    seen: BTreeSet<PathBuf>,
    /// Every folder that was looked into.
    places: Vec<PathBuf>,
    refused: Vec<Error>,
    /// What plugins say and is not known here.
    skipped: Vec<String>,
    /// What lies beside a pipeline and cannot be used: the name that it would have had, and why.
    passed_over: Vec<(String, String)>,
}

enum Source {
    Plugin {
        plugin: usize,
        index: usize,
    },
    Script,
    BuiltInScript(&'static BuiltInScript),
    /// A file that another component makes a component of its own, by this parameter.
    DropIn {
        parameter: String,
    },
}

impl Registry {
    /// Loads everything that lies in the executable's own folder, in the given folders and in the usual places, in this
    /// order: pdk's own, the given ones, what `PDK_PLUGIN_PATH` names, the user's plugin folder; clips and the like come
    /// last. If two components have the same name the first one counts, so that a name of pdk's own means the same
    /// everywhere. What cannot be used is left out and listed by [`Registry::refused`].
    ///
    /// # Errors
    /// If a given folder does not exist or is something else, or a part of pdk itself is missing or cannot be used.
    pub fn discover(search: &SearchPath, scripts: Box<dyn Scripts>) -> Result<Self> {
        let given = search.plugins.iter().map(|folder| ("plugins", folder));
        let drop_ins = search.drop_ins.iter().map(|folder| ("drop-ins", folder));
        for (name, place) in given.chain(drop_ins) {
            // A plugin may be named itself.
            if let Some(mistake) = mistake(place, name == "plugins") {
                return Err(Error::new(format!("{} {mistake} correct --{name}", place.display())));
            }
        }
        // What is recorded of a run has to be found from any working directory.
        let search = &search.absolute();
        let mut registry = Self {
            catalog: Catalog::default(),
            sources: Vec::new(),
            plugins: Vec::new(),
            scripts,
            seen: BTreeSet::new(),
            places: Vec::new(),
            refused: Vec::new(),
            skipped: Vec::new(),
            passed_over: Vec::new(),
        };
        registry.add_built_in()?;
        for folder in &search.plugins {
            registry.add_place(folder)?;
        }
        for place in std::env::var_os(PATH_VARIABLE).iter().flat_map(std::env::split_paths) {
            if place.as_os_str().is_empty() {
                continue; // Nothing between two separators, or in a variable that is set to nothing.
            }
            match mistake(&place, true) {
                None => registry.add_place(&place)?,
                Some(mistake) => registry.refused.push(Error::new(format!(
                    "{PATH_VARIABLE} names {}, which {mistake} correct the variable",
                    place.display()
                ))),
            }
        }
        if let Some(place) = search_path::user_folder() {
            registry.add_place(&place)?;
        }
        for place in &search.beside {
            registry.add_beside(place);
        }
        registry.add_drop_ins(search);
        registry.add_scales(search)?;
        Ok(registry)
    }

    /// What there is.
    pub fn catalog(&self) -> &Catalog {
        &self.catalog
    }

    /// What was found but cannot be used, one sentence each.
    pub fn refused(&self) -> &[Error] {
        &self.refused
    }

    /// What plugins have or say that is not known here, one sentence each. They work without it.
    pub fn skipped(&self) -> &[String] {
        &self.skipped
    }

    /// Files beside a pipeline that cannot be used: the name that each would have had, and why. They are reported only if a pipeline asks for them.
    pub fn passed_over(&self) -> &[(String, String)] {
        &self.passed_over
    }

    /// The plugins that were loaded.
    pub fn plugins(&self) -> &[Plugin] {
        &self.plugins
    }

    /// Makes an instance of any kind.
    ///
    /// # Errors
    /// If there is no such component, or it refuses the parameters.
    pub fn create(
        &self,
        kind: Kind,
        name: &str,
        parameters: &Map<String, Value>,
    ) -> Result<(Instance, Config)> {
        if is_mask_script(kind, name) {
            return self.mask_script(Path::new(name), parameters);
        }
        let entry = self.catalog.get(kind, name)?;
        let config = Config::check(&entry.description, parameters)?;
        let label = format!("{kind} `{name}`");
        let instance = match self.source(kind, name) {
            Some(Source::Plugin { plugin, index }) => {
                calls::call(&label, Function::New, || self.plugins[*plugin].create(*index, config.values()))
            }
            Some(Source::Script) => {
                let script = Script::File(&entry.file);
                calls::call(&label, Function::New, || self.scripts.create(script, &config))
            }
            Some(Source::BuiltInScript(script)) => {
                let script = Script::BuiltIn(script);
                calls::call(&label, Function::New, || self.scripts.create(script, &config))
            }
            Some(Source::DropIn { parameter }) => {
                let base = entry.base.as_deref().unwrap_or_default();
                self.create(kind, base, &shown(entry, &config, parameter)).map(|(instance, _)| instance)
            }
            None => Err(Error::new("it is in the catalog but has no source, which is a defect in pdk")),
        };
        let instance = instance.map_err(|error| error.at(&label))?;
        if instance.kind() != kind {
            return Err(Error::new(format!(
                "{label} made a {}, which is a mistake in its plugin",
                instance.kind()
            )));
        }
        Ok((instance, config))
    }

    /// The files that an instance reads besides those that its parameters name, as far as its plugin says so.
    ///
    /// # Errors
    /// If there is no such component, it refuses the parameters, or its files cannot be listed.
    pub fn input_files(
        &self,
        kind: Kind,
        name: &str,
        parameters: &Map<String, Value>,
    ) -> Result<Vec<InputFiles>> {
        if is_mask_script(kind, name) {
            return Ok(Vec::new());
        }
        let entry = self.catalog.get(kind, name)?;
        let config = Config::check(&entry.description, parameters)?;
        let label = format!("{kind} `{name}`");
        match self.source(kind, name) {
            Some(Source::Plugin { plugin, index }) => calls::call(&label, Function::InputFiles, || {
                self.plugins[*plugin].input_files(*index, config.values())
            })
            .map_err(|error| error.at(&label)),
            Some(Source::DropIn { parameter }) => self.input_files(
                kind,
                entry.base.as_deref().unwrap_or_default(),
                &shown(entry, &config, parameter),
            ),
            // A script reads no files.
            Some(Source::Script | Source::BuiltInScript(_)) | None => Ok(Vec::new()),
        }
    }

    /// Makes the mask in a script that is named by its path.
    fn mask_script(&self, file: &Path, parameters: &Map<String, Value>) -> Result<(Instance, Config)> {
        let label = format!("{} `{}`", Kind::Mask, file.display());
        if !file.is_file() {
            let sentence = "there is no such file; name a script, or a mask that `pdk list mask` shows";
            return Err(Error::of(ErrorKind::Configuration, sentence).at(&label));
        }
        let script = Script::File(file);
        let description = calls::call(&label, Function::Load, || self.scripts.describe(script))?;
        let description =
            description.filter(|description| description.kind == Kind::Mask).ok_or_else(|| {
                let sentence =
                    "the script has no mask; let it return a table with `mask`, as `pdk new mask` writes one";
                Error::of(ErrorKind::Configuration, sentence).at(&label)
            })?;
        let config = Config::check(&description, parameters)?;
        let instance = calls::call(&label, Function::New, || self.scripts.create(script, &config));
        Ok((instance.map_err(|error| error.at(&label))?, config))
    }

    fn source(&self, kind: Kind, name: &str) -> Option<&Source> {
        let found = self.sources.iter().find(|((known, of), _)| *known == kind && of == name);
        found.map(|(_, source)| source)
    }

    fn add_place(&mut self, place: &Path) -> Result<()> {
        match place.is_file() {
            true => self.add_files(vec![place.to_owned()]),
            false => self.add_folder(place),
        }
    }

    /// What is part of pdk, and the plugins in a folder beside its libraries. Of its own parts none may be missing: names would
    /// mean something else then.
    fn add_built_in(&mut self) -> Result<()> {
        let libraries = installation::libraries()?;
        let reasons = inspection::inspect(&libraries)?;
        for (library, reason) in libraries.iter().zip(reasons) {
            reason.map_or(Ok(()), Err)?;
            self.add_library(library, true)?;
        }
        for script in product::get().perturbations {
            let file = script.path();
            let name = format!("script {}", file.display());
            let describe = || self.scripts.describe(Script::BuiltIn(script));
            if let Some(mut description) = calls::call(&name, Function::Load, describe)? {
                description.defined_in = script.file.to_owned();
                let blake3 = blake3::hash(script.source.as_bytes()).to_hex().to_string();
                let entry = Entry { blake3: Some(blake3), ..Entry::new(description, file) };
                self.add(entry, Source::BuiltInScript(script));
            }
        }
        self.add_folder(&installation::library_folder()?.join("plugins"))
    }

    /// Adds the libraries and scripts of a folder, by name; a folder that does not exist has none.
    fn add_folder(&mut self, folder: &Path) -> Result<()> {
        self.places.push(folder.to_owned());
        let mut files = self.files_of(folder);
        files.retain(|file| is_library(file) || is_script(file));
        self.add_files(files)
    }

    /// Adds the scripts and drop-ins of a folder that the user did not name.
    fn add_beside(&mut self, folder: &Path) {
        for file in self.files_of(folder).into_iter().filter(|file| is_script(file)) {
            // A script that is not a component may serve another purpose, so there is no warning.
            let reason = match self.add_script(&file) {
                Ok(true) => continue,
                Ok(false) => {
                    format!(
                        "{} is not a perturbation: it does not return a table with `apply`",
                        file.display()
                    )
                }
                Err(error) => error.to_string(),
            };
            self.passed_over.push((drop_in_name(&file), reason));
        }
        self.places.push(folder.to_owned());
    }

    /// Adds libraries and scripts. What cannot be used is refused.
    fn add_files(&mut self, files: Vec<PathBuf>) -> Result<()> {
        let (scripts, libraries): (Vec<usize>, Vec<usize>) =
            (0..files.len()).partition(|&at| is_script(&files[at]));
        let inspected: Vec<PathBuf> = libraries.iter().map(|&at| files[at].clone()).collect();
        let mut reasons: BTreeMap<usize, Error> = libraries
            .into_iter()
            .zip(inspection::inspect(&inspected)?)
            .filter_map(|(at, reason)| Some((at, reason?)))
            .collect();
        for (at, file) in files.iter().enumerate() {
            let added = match reasons.remove(&at) {
                Some(reason) => Err(reason),
                None if scripts.contains(&at) => self.add_script(file).map(drop),
                None => self.add_library(file, false),
            };
            if let Err(error) = added {
                self.refused.push(error);
            }
        }
        Ok(())
    }

    /// Adds the components of a plugin, which may be one of pdk's own.
    fn add_library(&mut self, file: &Path, built_in: bool) -> Result<()> {
        let Some(file) = self.first_look(file) else { return Ok(()) };
        let plugin = Plugin::load(&file)?;
        let shown = file.display();
        let sentence = |sentence: &String| format!("plugin {shown}: {sentence}");
        self.skipped.extend(plugin.skipped.iter().map(sentence));
        let record = plugin.record(built_in);
        let (number, descriptions) = (self.plugins.len(), plugin.description.components.clone());
        self.plugins.push(plugin);
        for (index, description) in descriptions.into_iter().enumerate() {
            let plugin = Some(record.clone());
            let entry = Entry { plugin, ..Entry::new(description, file.clone()) };
            self.add(entry, Source::Plugin { plugin: number, index });
        }
        Ok(())
    }

    /// Adds the component in a script; false if it has none.
    fn add_script(&mut self, file: &Path) -> Result<bool> {
        let Some(file) = self.first_look(file) else { return Ok(true) };
        let name = format!("script {}", file.display());
        let describe = || self.scripts.describe(Script::File(&file));
        let Some(description) = calls::call(&name, Function::Load, describe)? else { return Ok(false) };
        self.add(Entry::new(description, file), Source::Script);
        Ok(true)
    }

    /// A file by its full name; none if it was looked at before.
    fn first_look(&mut self, file: &Path) -> Option<PathBuf> {
        let file = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
        self.seen.insert(file.clone()).then_some(file)
    }

    /// Adds the files and folders that components ask for: in the given folders, and in those of the right name wherever plugins lie.
    fn add_drop_ins(&mut self, search: &SearchPath) {
        let bases: Vec<Description> =
            self.catalog.entries().iter().map(|entry| entry.description.clone()).collect();
        for base in bases {
            let Some(drop_in) = &base.drop_in else { continue };
            let mut folders = search.drop_ins.clone();
            folders.extend(self.places.iter().map(|place| place.join(&drop_in.folder)));
            let mut seen = BTreeSet::new();
            let files: Vec<_> = folders.iter().flat_map(|folder| self.content_of(folder)).collect();
            for file in files {
                // The same folder may be looked into by several ways.
                if !seen.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
                    continue;
                }
                if drop_in.takes(&file) {
                    self.add_drop_in(&base, &drop_in.parameter, file);
                }
            }
        }
    }

    /// Adds the scales of the product, and those in the given folders and beside plugins.
    fn add_scales(&mut self, search: &SearchPath) -> Result<()> {
        let mut names = BTreeSet::new();
        for script in product::get().scales {
            self.catalog.add_scale(script.name, &Scale::read(script.source.as_bytes())?);
            names.insert(script.name.to_owned());
        }
        let mut folders = search.drop_ins.clone();
        folders.extend(self.places.iter().map(|place| place.join(scale_file::FOLDER)));
        for file in folders.iter().flat_map(|folder| self.files_of(folder)).collect::<Vec<_>>() {
            let Some(name) = scale_file::name_of(&file) else { continue };
            let Some(file) = self.first_look(&file) else { continue };
            let shown = file.display();
            let read = || Scale::read(&std::fs::read(&file)?);
            match read() {
                Ok(scale) if names.insert(name.to_owned()) => self.catalog.add_scale(name, &scale),
                Ok(_) => self.refused.push(Error::new(format!(
                    "the scale `{name}` of {shown} is left out, because another one has the same name and comes first; rename {shown}"
                ))),
                Err(error) => self.refused.push(error.at(format_args!("scale {shown}"))),
            }
        }
        Ok(())
    }

    /// The files of a folder by name, as for [`Registry::content_of`].
    fn files_of(&mut self, folder: &Path) -> Vec<PathBuf> {
        let mut files = self.content_of(folder);
        files.retain(|file| file.is_file());
        files
    }

    /// What is in a folder by name; nothing if there is no such folder. One that cannot be read is refused.
    fn content_of(&mut self, folder: &Path) -> Vec<PathBuf> {
        let paths = std::fs::read_dir(folder)
            .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>());
        match paths {
            Ok(mut files) => {
                files.sort();
                files
            }
            Err(error) if error.kind() == IoErrorKind::NotFound => Vec::new(),
            Err(error) => {
                let shown = folder.display();
                self.refused.push(Error::new(format!("the folder {shown} cannot be read ({error})")));
                Vec::new()
            }
        }
    }

    fn add_drop_in(&mut self, base: &Description, parameter: &str, file: PathBuf) {
        let shown = file.file_name().unwrap_or_default().to_string_lossy();
        let doc = format!("{}: {shown}", base.doc);
        let mut description = Description { name: drop_in_name(&file), doc, drop_in: None, ..base.clone() };
        description.parameters.retain(|p| p.name != parameter);
        description.examples.clear();
        // It is the user's own, so it is there by name.
        description.default = false;
        let entry = Entry { base: Some(base.name.clone()), ..Entry::new(description, file) };
        self.add(entry, Source::DropIn { parameter: parameter.to_owned() });
    }

    fn add(&mut self, entry: Entry, source: Source) {
        let key = (entry.description.kind, entry.description.name.clone());
        let file = entry.file.clone();
        match self.catalog.add(entry) {
            // The file that a component of pdk's own was made from, such as in a copy of pdk's scripts.
            Some(first) if first.is_made_of(&file) => {}
            Some(first) => {
                let shown = file.display();
                self.refused.push(Error::new(format!(
                    "{} `{}` of {shown} is left out, because {} has one of the same name and comes first; rename {shown}",
                    key.0,
                    key.1,
                    first.file.display(),
                )));
            }
            None => self.sources.push((key, source)),
        }
    }
}

/// What a component that stands for a file of the user's is made from: its own values, and the file as this parameter.
fn shown(entry: &Entry, config: &Config, parameter: &str) -> Map<String, Value> {
    let mut parameters = config.values().clone();
    parameters.insert(parameter.to_owned(), entry.file.to_string_lossy().into());
    parameters
}

/// What is wrong with a place that is to be looked into, and the beginning of the remedy; nothing if it is a folder, or a file
/// where `files` may be named too. A pipe or a device is neither.
fn mistake(place: &Path, files: bool) -> Option<&'static str> {
    if place.is_dir() || files && place.is_file() {
        None
    } else if place.exists() {
        Some("is not a folder;")
    } else {
        Some("does not exist; create it or")
    }
}

/// Whether a mask is named by the path of a script rather than by a name.
pub fn is_mask_script(kind: Kind, name: &str) -> bool {
    kind == Kind::Mask && is_script(Path::new(name))
}

/// Whether a file is a library, by its name.
fn is_library(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == std::env::consts::DLL_EXTENSION)
}

/// One function for each kind.
macro_rules! create_functions {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        impl Registry {
            $(
                #[doc = concat!("Makes the ", $one, " of this name.")]
                ///
                /// # Errors
                /// If there is none, or it refuses the parameters.
                pub fn $name(
                    &self,
                    name: &str,
                    parameters: &Map<String, Value>,
                ) -> Result<(Box<dyn pdk_sdk::$name::$kind>, Config)> {
                    match self.create(Kind::$kind, name, parameters)? {
                        (Instance::$kind(instance), config) => Ok((instance, config)),
                        (other, _) => Err(Error::new(format!("`{name}` is a {}", other.kind()))),
                    }
                }
            )*
        }
    };
}

each_kind!(create_functions);
