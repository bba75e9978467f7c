//! Where components are looked for.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Names the folders with further plugins and Lua perturbations, separated as in PATH.
pub const PATH_VARIABLE: &str = "PDK_PLUGIN_PATH";

/// Where scripts and models that come with pdk lie, seen from the executable: in an installation, and in a source tree.
const SHIPPED: [&str; 2] = ["../share/pdk", "../../scripts"];

/// Where components are looked for besides the usual places.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SearchPath {
    /// Folders with plugins and Lua perturbations.
    pub plugins: Vec<PathBuf>,
    /// Folders with files that become components of their own, each with the name that
    /// [`DropIn::folder`](pdk_sdk::describe::DropIn::folder) gives such folders.
    pub drop_ins: Vec<(String, PathBuf)>,
    /// Folders and scripts that are looked into without being named by anyone, such as those beside a pipeline: what is there
    /// and of no use is passed over in silence.
    #[serde(default)]
    pub beside: Vec<PathBuf>,
}

impl SearchPath {
    /// The same folders, each from the root of the file system.
    pub fn absolute(&self) -> Self {
        let absolute = |folder: &PathBuf| std::path::absolute(folder).unwrap_or_else(|_| folder.clone());
        Self {
            plugins: self.plugins.iter().map(absolute).collect(),
            drop_ins: self.drop_ins.iter().map(|(name, folder)| (name.clone(), absolute(folder))).collect(),
            beside: self.beside.iter().map(absolute).collect(),
        }
    }
}

/// The folder of the running executable.
pub fn executable_folder() -> Option<PathBuf> {
    let executable = std::env::current_exe().ok()?;
    let folder = std::fs::canonicalize(executable).ok()?.parent()?.to_owned();
    // Test executables lie one folder below the libraries.
    Some(if folder.ends_with("deps") { folder.parent()?.to_owned() } else { folder })
}

/// A folder of this name among the scripts and models that come with pdk, wherever there is one.
pub fn shipped(name: &str) -> Vec<PathBuf> {
    let own = executable_folder();
    let places = own.iter().flat_map(|own| SHIPPED.iter().map(move |place| own.join(place).join(name)));
    // Without the way there, which shows in paths; what is not there is none.
    places.filter_map(|place| place.canonicalize().ok()).collect()
}

/// Where a user's own plugins and perturbations lie.
pub fn user_folder() -> Option<PathBuf> {
    let data = std::env::var_os("XDG_DATA_HOME").map(PathBuf::from).filter(|p| p.is_absolute());
    let data = data.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/share")))?;
    Some(data.join("pdk/plugins"))
}

/// Whether a file is a script.
pub fn is_script(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "lua")
}
