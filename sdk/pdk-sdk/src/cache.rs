//! The folder in which components keep what took long to prepare. It belongs to the user alone; what lies there can be removed
//! at any time.

use std::ffi::OsString;
use std::fs::{self, DirBuilder};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::fs::{Access, access};
use rustix::process::geteuid;

use crate::error::{Error, ErrorKind, Place, Result};

/// Names the folder, if it is set.
pub const VARIABLE: &str = "PDK_CACHE";

/// The folder, and why it is this one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cache {
    /// The folder; it may have to be made.
    pub folder: PathBuf,
    /// Whether it lies in the system's folder for temporary files, because the user has no home folder that can be written to.
    pub temporary: bool,
}

/// A file that marks a folder as one that can be made again, by the Cache Directory Tagging Specification (bford.info/cachedir):
/// backups leave the folder out, and [`Cache::clear`] empties it.
const TAG: &str = "CACHEDIR.TAG";
const TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# pdk makes everything in this folder again when it needs it.\n";

/// What one sort of component keeps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// The name of its folder.
    pub name: String,
    /// The number of files.
    pub files: u64,
    /// Their length in bytes.
    pub bytes: u64,
}

/// Makes the folder of a part, if it is missing, and marks it as one whose content can be made again.
///
/// # Errors
/// If the folder cannot be written to.
pub fn make(folder: &Path) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let tag = folder.join(TAG);
    match tag.exists() {
        true => Ok(()),
        false => fs::write(tag, TAG_TEXT),
    }
}

impl Cache {
    /// What the parts hold, in the order of their names. Folders that [`make`] did not make are not among them.
    ///
    /// # Errors
    /// If a folder cannot be read.
    pub fn parts(&self) -> Result<Vec<Part>> {
        self.folders()?.into_iter().map(|folder| Ok(held(&folder, &files(&folder)?))).collect()
    }

    /// Removes the files of all parts: how many there were, and how many bytes. A component that is about to write one of them reports
    /// an error, so nothing else of pdk should run.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn clear(&self) -> Result<(u64, u64)> {
        let mut removed = (0, 0);
        for folder in self.folders()? {
            for (file, length) in files(&folder)? {
                fs::remove_file(&file).place(format_args!("cannot remove {}", file.display()))?;
                removed = (removed.0 + 1, removed.1 + length);
            }
        }
        Ok(removed)
    }

    /// The folders with a tag. None if there is no cache yet.
    fn folders(&self) -> Result<Vec<PathBuf>> {
        if !self.folder.exists() {
            return Ok(Vec::new());
        }
        let entries =
            fs::read_dir(&self.folder).place(format_args!("cannot read {}", self.folder.display()))?;
        let mut folders: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        folders.retain(|folder| fs::read_to_string(folder.join(TAG)).is_ok_and(|text| text == TAG_TEXT));
        folders.sort();
        Ok(folders)
    }
}

fn held(folder: &Path, files: &[(PathBuf, u64)]) -> Part {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Part { name, files: files.len() as u64, bytes: files.iter().map(|(_, length)| length).sum() }
}

/// The files in a folder and the folders in it, with their lengths, but not the tag. Links are not followed.
fn files(folder: &Path) -> Result<Vec<(PathBuf, u64)>> {
    let place = || format!("cannot read {}", folder.display());
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).place(place())? {
        let path = entry.place(place())?.path();
        // Another process may have removed it.
        let Ok(metadata) = fs::symlink_metadata(&path) else { continue };
        if metadata.is_dir() {
            found.extend(files(&path)?);
        } else if path.file_name().is_some_and(|name| name != TAG) {
            found.push((path, metadata.len()));
        }
    }
    Ok(found)
}

/// The folder that `PDK_CACHE` names, else `pdk` in the user's cache folder (`$XDG_CACHE_HOME`, else `~/.cache`). If that cannot
/// be written to, as for users without a home, it is `pdk-NUMBER` in the system's folder for temporary files, with the user's
/// number, and only that user can enter it.
///
/// # Errors
/// If the last one is needed and cannot be made, or another user has made it.
pub fn cache() -> Result<Cache> {
    let variable = |name| std::env::var_os(name);
    choose(variable(VARIABLE), [variable("XDG_CACHE_HOME"), variable("HOME")], &std::env::temp_dir())
}

fn choose(named: Option<OsString>, [cache, home]: [Option<OsString>; 2], temporary: &Path) -> Result<Cache> {
    if let Some(named) = named.filter(|path| !path.is_empty()) {
        return Ok(Cache { folder: named.into(), temporary: false });
    }
    let absolute = |path: OsString| Some(PathBuf::from(path)).filter(|path| path.is_absolute());
    let user = cache.and_then(absolute).or_else(|| Some(home.and_then(absolute)?.join(".cache")));
    if let Some(folder) = user.map(|cache| cache.join("pdk"))
        && fs::create_dir_all(&folder).is_ok()
        && access(&folder, Access::WRITE_OK | Access::EXEC_OK).is_ok()
    {
        return Ok(Cache { folder, temporary: false });
    }
    Ok(Cache { folder: private(temporary)?, temporary: true })
}

/// The user's own folder in one that everybody can write to.
fn private(temporary: &Path) -> Result<PathBuf> {
    let user = geteuid().as_raw();
    let folder = temporary.join(format!("pdk-{user}"));
    let shown = folder.display();
    let remedy = format!("name another one with {VARIABLE}");
    let made = DirBuilder::new().recursive(true).mode(0o700).create(&folder);
    let mistake = |sentence| Error::of(ErrorKind::Configuration, sentence);
    made.map_err(|error| mistake(format!("the cache folder {shown} cannot be made ({error}); {remedy}")))?;
    // Its maker could have put anything into it. A link is not followed.
    let found = fs::symlink_metadata(&folder).place(&shown)?;
    if !found.is_dir() || found.uid() != user || found.mode() & 0o077 != 0 {
        return Err(mistake(format!(
            "the cache folder {shown} is not one that only this user can enter; remove it, or {remedy}"
        )));
    }
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn only_folders_with_the_tag_are_counted_and_emptied() {
        let place = tempfile::tempdir().unwrap();
        let cache = Cache { folder: place.path().join("cache"), temporary: false };
        assert_eq!(cache.parts().unwrap(), []);
        assert_eq!(cache.clear().unwrap(), (0, 0));
        let (clips, own) = (cache.folder.join("clips"), cache.folder.join("own"));
        make(&clips.join("nested")).unwrap();
        make(&clips).unwrap();
        make(&clips).unwrap();
        fs::create_dir(&own).unwrap();
        for file in [clips.join("a"), clips.join("nested/b"), own.join("c")] {
            fs::write(file, "12345").unwrap();
        }
        fs::write(cache.folder.join("notes.json"), "{}").unwrap();
        symlink(&own, clips.join("link")).unwrap();
        let part = |files, bytes| Part { name: "clips".to_owned(), files, bytes };
        let link = fs::symlink_metadata(clips.join("link")).unwrap().len();
        assert_eq!(cache.parts().unwrap(), [part(3, 10 + link)]);
        assert_eq!(cache.clear().unwrap(), (3, 10 + link));
        assert_eq!(cache.parts().unwrap(), [part(0, 0)]);
        assert!(own.join("c").is_file() && cache.folder.join("notes.json").is_file());
    }

    #[test]
    fn the_folder_is_the_named_one_or_the_users_or_a_private_one() {
        let place = std::env::temp_dir().join(format!("pdk-sdk-cache-{}", std::process::id()));
        let _ = fs::remove_dir_all(&place);
        fs::create_dir(&place).unwrap();
        let text = |path: &Path| Some(path.as_os_str().to_owned());
        let (home, temporary) = (place.join("home"), place.join("tmp"));
        let chosen = |named: &str, cache: Option<OsString>, home: Option<OsString>| {
            choose(Some(named.into()), [cache, home], &temporary)
        };
        let cache = |folder: PathBuf, temporary| Cache { folder, temporary };
        assert_eq!(chosen("here", None, text(&home)).unwrap(), cache("here".into(), false));
        assert_eq!(chosen("", None, text(&home)).unwrap(), cache(home.join(".cache/pdk"), false));
        let own = home.join("own");
        assert_eq!(chosen("", text(&own), text(&home)).unwrap(), cache(own.join("pdk"), false));

        // A home that does not exist, such as that of most services.
        fs::write(place.join("file"), "").unwrap();
        let private = temporary.join(format!("pdk-{}", geteuid().as_raw()));
        for home in [None, text(Path::new("relative")), text(&place.join("file/home"))] {
            assert_eq!(chosen("", None, home).unwrap(), cache(private.clone(), true));
        }
        assert_eq!(fs::metadata(&private).unwrap().mode() & 0o7777, 0o700);
        let refused = || {
            let error = chosen("", None, None).unwrap_err().to_string();
            assert!(error.contains("only this user can enter") && error.contains(VARIABLE), "{error}");
        };
        fs::set_permissions(&private, fs::Permissions::from_mode(0o755)).unwrap();
        refused();
        fs::remove_dir(&private).unwrap();
        symlink(&home, &private).unwrap();
        refused();
        fs::remove_dir_all(place).unwrap();
    }
}
