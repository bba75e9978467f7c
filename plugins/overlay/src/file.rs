//! Opens the files of clips.

use std::fs::File;
use std::path::Path;

use pdk_sdk::prelude::*;

/// Gibibytes that the file of a clip may have: minutes of 4K video at the rate of a camera. It is read whole for its hash.
const LARGEST: u64 = 4;

/// Opens a file of a clip, and tells how many bytes it has.
///
/// # Errors
/// If it cannot be read, is not a regular file, or is too large.
pub fn open(path: &Path) -> Result<(File, u64)> {
    let (file, length) = pdk_sdk::file::open(path)?;
    if length > LARGEST << 30 {
        let gibibytes = length as f64 / f64::from(1 << 30);
        return Err(Error::new(format!(
            "it has {gibibytes:.1} GiB, and a clip may have {LARGEST} GiB; cut it shorter, or compress it more"
        )));
    }
    Ok((file, length))
}
