//! Clips that lie beside a record.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_record::directory::CLIPS;
use pdk_sdk::error::{Error, Result};

use crate::text::address;

/// The folder of the clips on disk, and as the page sees it.
pub struct ClipFolder {
    path: PathBuf,
    address: String,
}

/// The folder of the clips of a record, for a page in this file.
///
/// # Errors
/// If the page cannot be there, or the folder of the record cannot be read.
pub fn clip_folder(folder: &Path, page: &Path) -> Result<ClipFolder> {
    let path = folder.join(CLIPS);
    let place = page.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let address = match (fs::canonicalize(place), fs::canonicalize(folder)) {
        (Ok(from), Ok(to)) => relative(&from, &to.join(CLIPS)),
        (Err(error), _) => {
            return Err(Error::new(format!(
                "cannot write {} ({error}); name a place in a folder that exists",
                page.display()
            )));
        }
        (_, Err(error)) => return Err(Error::from(error).at(folder.display())),
    };
    Ok(ClipFolder { path, address })
}

impl ClipFolder {
    /// The address of the clip of a scenario, relative to the page; empty if there is none.
    pub fn address(&self, number: u64) -> String {
        let clip = format!("scenario-{number}.mp4");
        match self.path.join(&clip).is_file() {
            true => address(&format!("{}/{clip}", self.address)),
            false => String::new(),
        }
    }
}

/// The way from a folder to a place, both absolute, with slashes.
fn relative(from: &Path, to: &Path) -> String {
    let (from, to): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[shared..].iter().map(|_| "..".to_owned());
    let down = to[shared..].iter().map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_to_the_clips_goes_up_and_down() {
        let way = |from: &str, to: &str| relative(Path::new(from), Path::new(to));
        assert_eq!(way("/a/b", "/a/b/clips"), "clips");
        assert_eq!(way("/a/b/c", "/a/d/clips"), "../../d/clips");
    }
}
