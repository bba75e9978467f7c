//! What the end-to-end tests share: they use the built `pdk` as a user does.
//!
//! `cargo build --release` has to come first, because the tests need the binary and the plugins beside it.

// A helper of a test may fail like the test itself, and a stand-in for a simulator need not compute the same everywhere.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

pub mod beamng;
pub mod carla;
pub mod datasets;
pub mod installation;
pub mod onnx;
pub mod pictures;
pub mod pixels;
pub mod planted;
pub mod process;
pub mod processes;
pub mod random;
pub mod records;
pub mod server;
pub mod stand_in;
pub mod tried;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_lua::LuaScripts;
pub use process::{Finished, Pdk};

/// The folder with the built binary and plugins: `target/release`.
///
/// # Panics
/// If the test does not lie in a target folder.
pub fn target_folder() -> PathBuf {
    // Test executables lie in `deps` below it.
    let executable = std::env::current_exe().unwrap();
    executable.parent().and_then(Path::parent).expect("a test lies in target/PROFILE/deps").to_owned()
}

/// A built file beside the binary.
///
/// # Panics
/// If it has not been built.
pub fn built(name: &str) -> PathBuf {
    let file = target_folder().join(name);
    assert!(file.is_file(), "{} is missing: run `cargo build --release` first", file.display());
    file
}

/// All components of pdk, and those that lie in these places besides, loaded into this process.
///
/// # Panics
/// If pdk has not been built.
pub fn registry(search: &SearchPath) -> Registry {
    pdk_components::product::set(&pdk_product::PRODUCT);
    Registry::discover(search, Box::new(LuaScripts::new(search))).unwrap()
}

/// The library of a built-in plugin by its name in Cargo, such as `pdk_noise`.
///
/// # Panics
/// If it has not been built.
pub fn library(name: &str) -> PathBuf {
    built(&library_file(name))
}

/// The library of a plugin for tests by its name in Cargo, such as `misbehave`. It is a dependency of the tests, so Cargo
/// has built it for them, and it lies beside them.
///
/// # Panics
/// If there is none.
pub fn test_library(name: &str) -> PathBuf {
    built(&format!("deps/{}", library_file(name)))
}

fn library_file(name: &str) -> String {
    format!("lib{name}.{}", std::env::consts::DLL_EXTENSION)
}

/// The libraries of the built-in plugins.
///
/// # Panics
/// If one is not there.
pub fn built_in_libraries() -> Vec<PathBuf> {
    let libraries: Vec<_> = pdk_product::PRODUCT.libraries().map(|name| target_folder().join(name)).collect();
    for library in &libraries {
        assert!(library.is_file(), "{} is not there: run `cargo build --release` first", library.display());
    }
    libraries
}

/// The root of the repository.
pub fn repository() -> PathBuf {
    std::fs::canonicalize(Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).unwrap()
}

/// Real data that does not come with the repository: below the folder that `PDK_TEST_DATA` names, or `shared` beside
/// the repository. If it is missing, says that what needs it is skipped.
pub fn real_data(name: &str) -> Option<PathBuf> {
    let root =
        std::env::var_os("PDK_TEST_DATA").map_or_else(|| repository().join("../shared"), PathBuf::from);
    let found = [root.join("data").join(name), root.join(name)].into_iter().find(|path| path.exists());
    if found.is_none() {
        eprintln!("skipped: no real data at {} (set PDK_TEST_DATA)", root.join(name).display());
    }
    found
}

/// A path at which nothing exists while the tests run. A fixed path would not do, because a user may have created it.
pub fn nothing() -> &'static Path {
    static NOTHING: LazyLock<PathBuf> = LazyLock::new(|| temp().path().join("nothing"));
    &NOTHING
}

/// A temporary folder that is removed when it is dropped.
///
/// # Panics
/// If it cannot be made.
pub fn temp() -> tempfile::TempDir {
    tempfile::Builder::new().prefix("pdk-test-").tempdir().unwrap()
}
