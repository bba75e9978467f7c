//! What components there are, where they come from, and how instances of them are made.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use pdk_sdk::abi::host::Instance;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Dataset, Driver, Perturbation, Simulator};
use serde_json::{Map, Value};

use crate::loader::Plugin;
use crate::lua;
use crate::suggest;
use crate::watchdog::DEFAULT_PATIENCE;

/// Names the folders with further plugins and Lua perturbations, separated as in PATH.
pub const PATH_VARIABLE: &str = "PDK_PLUGIN_PATH";

/// Where scripts and models that come with pdk lie, seen from the executable: in an installation, and in a source tree.
const SHIPPED: [&str; 2] = ["../share/pdk", "../../scripts"];

/// All components that were found.
#[derive(Default)]
pub struct Registry {
    components: BTreeMap<(Kind, String), Component>,
    plugins: Vec<Plugin>,
    /// Every folder that was looked into.
    places: Vec<PathBuf>,
    /// What was named besides the usual places.
    given: SearchPath,
    refused: Vec<Error>,
}

/// A component and where it comes from.
pub struct Component {
    /// What it says of itself.
    pub description: Description,
    source: Source,
}

enum Source {
    Plugin {
        plugin: usize,
        index: usize,
    },
    Lua {
        path: PathBuf,
    },
    /// A file that another component makes a component of its own.
    DropIn {
        base: String,
        parameter: String,
        path: PathBuf,
    },
}

/// Where components are looked for besides the usual places.
#[derive(Debug, Clone, Default)]
pub struct SearchPath {
    /// Folders with plugins and Lua perturbations.
    pub plugins: Vec<PathBuf>,
    /// Folders with files that become components of their own, each with the name that [`DropIn::folder`](pdk_sdk::describe::DropIn::folder) gives such folders.
    pub drop_ins: Vec<(&'static str, PathBuf)>,
}

impl SearchPath {
    /// The same folders, each from the root of the file system.
    fn absolute(&self) -> Self {
        let absolute = |folder: &PathBuf| std::path::absolute(folder).unwrap_or_else(|_| folder.clone());
        Self {
            plugins: self.plugins.iter().map(absolute).collect(),
            drop_ins: self.drop_ins.iter().map(|(name, folder)| (*name, absolute(folder))).collect(),
        }
    }
}

impl Registry {
    /// Loads everything that lies in the executable's own folder, in the given folders and in the usual places, in this
    /// order: pdk's own, the given ones, what `PDK_PLUGIN_PATH` names, the user's plugin folder; clips and the like come
    /// last. Where two components have the same name the first one counts, so that a name of pdk's own means the same
    /// everywhere. What cannot be used is left out and listed by [`Registry::refused`].
    ///
    /// # Errors
    /// Where a given folder does not exist.
    pub fn discover(search: &SearchPath) -> Result<Self> {
        let given = search.plugins.iter().map(|folder| ("plugins", folder));
        let drop_ins = search.drop_ins.iter().map(|(name, folder)| (*name, folder));
        if let Some((name, missing)) = given.chain(drop_ins).find(|(_, folder)| !folder.exists()) {
            return Err(Error::new(format!(
                "the folder {} does not exist; create it or correct --{name}",
                missing.display()
            )));
        }
        // What is recorded of a run has to be found from any working directory.
        let search = &search.absolute();
        let mut registry = Self { given: search.clone(), ..Self::default() };
        if let Some(folder) = executable_folder() {
            registry.add_built_in(&folder);
        }
        for folder in &search.plugins {
            registry.add_place(folder);
        }
        for place in std::env::var_os(PATH_VARIABLE).iter().flat_map(std::env::split_paths) {
            if place.as_os_str().is_empty() {
                continue; // Nothing between two separators, or in a variable that is set to nothing.
            }
            if place.exists() {
                registry.add_place(&place);
            } else {
                registry.refused.push(Error::new(format!(
                    "{PATH_VARIABLE} names {}, which does not exist; create it or correct the variable",
                    place.display()
                )));
            }
        }
        if let Some(place) = user_folder() {
            registry.add_place(&place);
        }
        registry.add_drop_ins(search);
        Ok(registry)
    }

    /// What was found but cannot be used, one sentence each.
    pub fn refused(&self) -> &[Error] {
        &self.refused
    }

    /// Where components were looked for besides the usual places.
    pub fn given(&self) -> &SearchPath {
        &self.given
    }

    /// The plugins that were loaded.
    pub fn plugins(&self) -> &[Plugin] {
        &self.plugins
    }

    /// All components of a kind, by name.
    pub fn of_kind(&self, kind: Kind) -> impl Iterator<Item = &Component> + Clone {
        self.components.iter().filter(move |((k, _), _)| *k == kind).map(|(_, component)| component)
    }

    /// A component by kind and name.
    ///
    /// # Errors
    /// Where there is none, with what was probably meant.
    pub fn get(&self, kind: Kind, name: &str) -> Result<&Component> {
        self.components.get(&(kind, name.to_owned())).ok_or_else(|| {
            let known = self.of_kind(kind).map(|c| c.description.name.as_str());
            Error::new(format!("there is no {kind} `{name}`; {}", suggest::hint(name, known)))
        })
    }

    /// The file that a component comes from: a library or a script.
    pub fn file_of<'a>(&'a self, component: &'a Component) -> &'a Path {
        match &component.source {
            Source::Plugin { plugin, .. } => &self.plugins[*plugin].path,
            Source::Lua { path } | Source::DropIn { path, .. } => path,
        }
    }

    /// The component that makes this one from a file of the user's; none where it stands for itself.
    pub fn base_of(&self, component: &Component) -> Option<&Component> {
        match &component.source {
            Source::DropIn { base, .. } => self.get(component.description.kind, base).ok(),
            Source::Plugin { .. } | Source::Lua { .. } => None,
        }
    }

    fn create(&self, kind: Kind, name: &str, parameters: &Map<String, Value>) -> Result<(Instance, Config)> {
        let component = self.get(kind, name)?;
        let config = Config::check(&component.description, parameters)?;
        let instance = match &component.source {
            Source::Plugin { plugin, index } => self.plugins[*plugin].create(*index, config.values()),
            Source::Lua { path } => lua::perturbation::create(path, &config).map(Instance::Perturbation),
            Source::DropIn { base, parameter, path } => {
                let mut parameters = config.values().clone();
                parameters.insert(parameter.clone(), path.to_string_lossy().into());
                self.create(kind, base, &parameters).map(|(instance, _)| instance)
            }
        };
        let instance = instance.map_err(|error| error.at(format!("{kind} `{name}`")))?;
        if instance.kind() != kind {
            return Err(Error::new(format!(
                "{kind} `{name}` made a {}, which is a mistake in its plugin",
                instance.kind()
            )));
        }
        Ok((instance, config))
    }

    fn add_place(&mut self, place: &Path) {
        if place.is_file() {
            self.add_file(place);
        } else {
            self.add_folder(place, |_| true);
        }
    }

    /// The plugins beside the executable, and the scripts that come with an installation or a source tree.
    fn add_built_in(&mut self, folder: &Path) {
        self.add_folder(folder, |stem| stem.starts_with("libpdk_"));
        self.add_folder(&folder.join("plugins"), |_| true);
        for scripts in SHIPPED {
            self.add_folder(&folder.join(scripts).join("perturbations"), |_| true);
        }
    }

    /// Adds the libraries and scripts of a folder, by name; a folder that does not exist has none.
    fn add_folder(&mut self, folder: &Path, wanted: impl Fn(&str) -> bool) {
        self.places.push(folder.to_owned());
        for file in self.files_of(folder) {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            let extension = file.extension().unwrap_or_default();
            let library = extension == std::env::consts::DLL_EXTENSION && wanted(&stem);
            if library || extension == "lua" && !is_pipeline(&file) {
                self.add_file(&file);
            }
        }
    }

    fn add_file(&mut self, file: &Path) {
        let file = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
        let known = self.components.values().any(|component| self.file_of(component) == file);
        if known {
            return;
        }
        if file.extension().is_some_and(|e| e == "lua") {
            match lua::perturbation::description(&file) {
                Ok(description) => self.add(description, Source::Lua { path: file }),
                Err(error) => self.refused.push(error),
            }
            return;
        }
        match Plugin::load(&file, DEFAULT_PATIENCE) {
            Ok(plugin) => {
                let (plugin_index, descriptions) =
                    (self.plugins.len(), plugin.description.components.clone());
                self.plugins.push(plugin);
                for (index, description) in descriptions.into_iter().enumerate() {
                    self.add(description, Source::Plugin { plugin: plugin_index, index });
                }
            }
            Err(error) => self.refused.push(error),
        }
    }

    /// Adds the files that components ask for: in the given folders, and in those of the right name wherever plugins lie.
    fn add_drop_ins(&mut self, search: &SearchPath) {
        let bases: Vec<Description> = self.components.values().map(|c| c.description.clone()).collect();
        for base in bases {
            let Some(drop_in) = &base.drop_in else { continue };
            let given = search.drop_ins.iter().filter(|(name, _)| *name == drop_in.folder);
            let mut folders: Vec<PathBuf> = given.map(|(_, folder)| folder.clone()).collect();
            if let (true, Some(own)) = (drop_in.shipped, executable_folder()) {
                let places = SHIPPED.iter().map(|place| own.join(place).join(&drop_in.folder));
                // Without the way there, which shows in paths; what is not there is none.
                folders.extend(places.filter_map(|place| place.canonicalize().ok()));
            }
            folders.extend(self.places.iter().map(|place| place.join(&drop_in.folder)));
            let files: Vec<_> = folders.iter().flat_map(|folder| self.files_of(folder)).collect();
            for file in files {
                let ending = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
                if drop_in.endings.contains(&ending) {
                    self.add_drop_in(&base, &drop_in.parameter, file);
                }
            }
        }
    }

    /// The files of a folder by name; none where there is no such folder. One that cannot be read is refused.
    fn files_of(&mut self, folder: &Path) -> Vec<PathBuf> {
        let paths = std::fs::read_dir(folder)
            .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>());
        match paths {
            Ok(mut files) => {
                files.retain(|file| file.is_file());
                files.sort();
                files
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
            Err(error) => {
                let shown = folder.display();
                self.refused.push(Error::new(format!("the folder {shown} cannot be read ({error})")));
                Vec::new()
            }
        }
    }

    /// The name of the component that a file of the user's becomes.
    pub fn drop_in_name(file: &Path) -> String {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let fits = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        stem.chars().map(fits).collect()
    }

    fn add_drop_in(&mut self, base: &Description, parameter: &str, file: PathBuf) {
        let name = Self::drop_in_name(&file);
        let shown = file.file_name().unwrap_or_default().to_string_lossy();
        let mut description =
            Description { name, doc: format!("{}: {shown}", base.doc), drop_in: None, ..base.clone() };
        description.parameters.retain(|p| p.name != parameter);
        description.examples.clear();
        // It is the user's own, so it is there by name.
        description.default = false;
        let source = Source::DropIn { base: base.name.clone(), parameter: parameter.to_owned(), path: file };
        self.add(description, source);
    }

    fn add(&mut self, description: Description, source: Source) {
        let key = (description.kind, description.name.clone());
        let component = Component { description, source };
        if let Some(first) = self.components.get(&key) {
            self.refused.push(Error::new(format!(
                "{} `{}` of {file} is left out, because {} has one of the same name and comes first; rename {file}",
                key.0,
                key.1,
                self.file_of(first).display(),
                file = self.file_of(&component).display(),
            )));
        } else {
            self.components.insert(key, component);
        }
    }
}

/// One function for each kind whose instances the kernel itself uses.
macro_rules! create_functions {
    ($($(#[$doc:meta])* $function:ident: $kind:ident as $trait:ident;)*) => {
        impl Registry {
            $(
                $(#[$doc])*
                ///
                /// # Errors
                /// Where there is no such component, or it refuses the parameters.
                pub fn $function(
                    &self,
                    name: &str,
                    parameters: &Map<String, Value>,
                ) -> Result<(Box<dyn $trait>, Config)> {
                    match self.create(Kind::$kind, name, parameters)? {
                        (Instance::$kind(instance), config) => Ok((instance, config)),
                        _ => Err(Error::new(concat!("no ", stringify!($kind)))),
                    }
                }
            )*
        }
    };
}

create_functions! {
    /// Makes a perturbation.
    perturbation: Perturbation as Perturbation;
    /// Makes a simulator.
    simulator: Simulator as Simulator;
    /// Makes a driver.
    driver: Driver as Driver;
    /// Opens a dataset.
    dataset: Dataset as Dataset;
}

/// Whether a script uses what only pipelines have; a folder may hold both kinds.
pub fn is_pipeline(script: &Path) -> bool {
    std::fs::read_to_string(script)
        .is_ok_and(|text| text.contains("pdk.settings(") || text.contains("pdk.drive("))
}

/// The folder of the running executable.
fn executable_folder() -> Option<PathBuf> {
    let executable = std::env::current_exe().ok()?;
    let folder = std::fs::canonicalize(executable).ok()?.parent()?.to_owned();
    // Test executables lie one folder below the libraries.
    Some(if folder.ends_with("deps") { folder.parent()?.to_owned() } else { folder })
}

/// Where a user's own plugins and perturbations lie.
pub fn user_folder() -> Option<PathBuf> {
    let data = std::env::var_os("XDG_DATA_HOME").map(PathBuf::from).filter(|p| p.is_absolute());
    let data = data.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/share")))?;
    Some(data.join("pdk/plugins"))
}
