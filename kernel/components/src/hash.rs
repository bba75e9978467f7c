//! Tells files from each other by their content.

use std::path::Path;

use pdk_sdk::error::{Place, Result};
use pdk_sdk::file;

/// BLAKE3 of a file, in hexadecimal.
///
/// # Errors
/// If it cannot be read.
pub fn of(path: &Path) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let (mut file, _) = file::open(path).place(path.display())?;
    std::io::copy(&mut file, &mut hasher).place(path.display())?;
    Ok(hasher.finalize().to_hex().to_string())
}
