//! Lists the libraries of the built-in plugins: one for each folder in `plugins`.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../..");
    // Another plugin is another package of the lock file; the folder itself would change with every line of a plugin.
    println!("cargo::rerun-if-changed={}", root.join("Cargo.lock").display());
    let mut libraries = Vec::new();
    for entry in fs::read_dir(root.join("plugins"))? {
        let folder = entry?.path();
        if folder.join("Cargo.toml").is_file() {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().replace('-', "_");
            libraries.push(format!("{}pdk_{name}{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX));
        }
    }
    libraries.sort();
    let file = Path::new(&env::var("OUT_DIR")?).join("libraries.rs");
    fs::write(file, format!("&{libraries:?}"))?;
    Ok(())
}
