//! Where components are looked for.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Names the folders with further plugins and Lua perturbations, separated as in PATH.
pub const PATH_VARIABLE: &str = "PDK_PLUGIN_PATH";

/// Where components are looked for besides the usual places.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SearchPath {
    /// Folders with plugins and Lua perturbations.
    pub plugins: Vec<PathBuf>,
    /// Folders with files that become components of their own, as [`DropIn`](pdk_sdk::describe::DropIn) describes them.
    pub drop_ins: Vec<PathBuf>,
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
            drop_ins: self.drop_ins.iter().map(absolute).collect(),
            beside: self.beside.iter().map(absolute).collect(),
        }
    }
}

/// Where a user's own plugins and perturbations lie. Relative folders do not count: code would be loaded from wherever pdk is started.
pub fn user_folder() -> Option<PathBuf> {
    let absolute = |variable| std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    let data = absolute("XDG_DATA_HOME").or_else(|| Some(absolute("HOME")?.join(".local/share")))?;
    Some(data.join("pdk/plugins"))
}

/// Whether a file is a script.
pub fn is_script(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "lua")
}
