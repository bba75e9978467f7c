//! The base: the folder of this user below which the buses have theirs.

use std::{
    env,
    ffi::OsString,
    fs::{self, DirBuilder},
    io::ErrorKind,
    os::unix::fs::{DirBuilderExt, MetadataExt},
    path::{Path, PathBuf},
};

use rustix::process::geteuid;

use crate::{
    error::{Error, Result},
    layout::SHARED_MEMORY,
};

/// The environment variable that names the base: an absolute path. Only processes with the same base see each
/// other.
pub const BASE_VARIABLE: &str = "PDK_BUS_DIR";
const RUNTIME_VARIABLE: &str = "XDG_RUNTIME_DIR";

/// The base: `$PDK_BUS_DIR`, else `pdk` in `$XDG_RUNTIME_DIR`, else `/dev/shm/pdk-<user number>`. The last two lie in
/// memory: iceoryx2 has each of its files written to the disk before it goes on, which takes a busy disk seconds.
pub(crate) fn base() -> Result<PathBuf> {
    choose(env::var_os(BASE_VARIABLE), env::var_os(RUNTIME_VARIABLE))
}

fn choose(named: Option<OsString>, runtime: Option<OsString>) -> Result<PathBuf> {
    if let Some(named) = named {
        // Through its components, because with a slash at the end a symbolic link would be followed.
        let folder: PathBuf = Path::new(&named).components().collect();
        if !folder.is_absolute() || folder.to_str().is_none_or(|text| text.contains(char::is_control)) {
            return Err(Error::new(format!(
                "{BASE_VARIABLE}={} cannot be the folder of the bus: use a short absolute path like /dev/shm/pdk-$USER",
                named.display()
            )));
        }
        return Ok(folder);
    }
    let user = geteuid().as_raw();
    // A shell that was started with the rights of another user often keeps the variable of the first.
    let is_own = |folder: &Path| {
        folder.is_absolute()
            && folder.to_str().is_some_and(|text| !text.contains(char::is_control))
            && fs::symlink_metadata(folder).is_ok_and(|found| found.is_dir() && found.uid() == user)
    };
    Ok(match runtime.map(PathBuf::from).filter(|folder| is_own(folder)) {
        Some(folder) => folder.join("pdk"),
        None => Path::new(SHARED_MEMORY).join(format!("pdk-{user}")),
    })
}

/// Makes a folder that only this user can enter, unless it is there.
///
/// # Errors
/// If it cannot be made, or [`is_there`] refuses it.
pub(crate) fn make(folder: &Path) -> Result<()> {
    let made = DirBuilder::new().recursive(true).mode(0o700).create(folder);
    // The error below describes what is there in its place.
    if !is_there(folder)?
        && let Err(error) = made
    {
        return Err(Error::new(format!(
            "{} cannot be made ({error}): name another folder for the bus with {BASE_VARIABLE}",
            folder.display()
        )));
    }
    Ok(())
}

/// Whether there is such a folder.
///
/// # Errors
/// If others could have put something into it: it belongs to another user, can be written by others, or is
/// a symbolic link to who knows where.
pub(crate) fn is_there(folder: &Path) -> Result<bool> {
    let refused = |reason: &str| {
        Err(Error::new(format!(
            "{} {reason}: remove it, or name another folder for the bus with {BASE_VARIABLE}=/dev/shm/pdk-$USER",
            folder.display()
        )))
    };
    match fs::symlink_metadata(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => refused(&format!("cannot be looked at ({error})")),
        Ok(found) if found.is_symlink() => refused("is a symbolic link"),
        Ok(found) if !found.is_dir() => refused("is not a folder"),
        Ok(found) if found.uid() != geteuid().as_raw() => refused("belongs to another user"),
        Ok(found) if found.mode() & 0o022 != 0 => refused("can be written by other users"),
        Ok(_) => Ok(true),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;
    use crate::testing::Folder;

    #[test]
    fn the_base_is_the_named_folder_or_else_that_of_the_user() {
        let chosen = |named: Option<&str>, runtime: Option<&str>| {
            choose(named.map(OsString::from), runtime.map(OsString::from)).unwrap()
        };
        let own = Folder::new();
        let runtime = own.path().to_str().unwrap();
        assert_eq!(chosen(Some("/dev/shm/pdk-me/"), Some(runtime)), Path::new("/dev/shm/pdk-me"));
        assert_eq!(chosen(None, Some(runtime)), own.path().join("pdk"));
        let of_the_user = PathBuf::from(format!("/dev/shm/pdk-{}", geteuid().as_raw()));
        for not_ours in ["", "relative", "/no/such/folder"] {
            assert_eq!(chosen(None, Some(not_ours)), of_the_user, "{not_ours}");
        }
        assert_eq!(chosen(None, None), of_the_user);
        for folder in ["", "relative", "~/bus", "/tmp/a\nb"] {
            let error = choose(Some(folder.into()), None).unwrap_err();
            assert!(error.message().contains("cannot be the folder of the bus"), "{error}");
        }
    }

    #[test]
    fn a_folder_is_private_to_its_user() {
        let own = Folder::new();
        let base = own.path().join("some/base");
        assert_eq!(is_there(&base), Ok(false));
        make(&base).unwrap();
        make(&base).unwrap();
        assert_eq!(is_there(&base), Ok(true));
        assert_eq!(fs::metadata(&base).unwrap().mode() & 0o7777, 0o700);
        assert_eq!(fs::metadata(base.parent().unwrap()).unwrap().mode() & 0o7777, 0o700);

        let refuses = |folder: &Path, reason: &str| {
            for error in [make(folder).unwrap_err(), is_there(folder).unwrap_err()] {
                assert!(
                    error.message().contains(reason) && error.message().contains(BASE_VARIABLE),
                    "{error}"
                );
            }
        };
        let link = own.path().join("link");
        symlink(&base, &link).unwrap();
        refuses(&link, "is a symbolic link");
        refuses(&choose(Some(format!("{}/", link.display()).into()), None).unwrap(), "is a symbolic link");
        let nowhere = own.path().join("nowhere");
        symlink("/no/such/folder", &nowhere).unwrap();
        refuses(&nowhere, "is a symbolic link");
        let file = own.path().join("file");
        fs::write(&file, "").unwrap();
        refuses(&file, "is not a folder");
        fs::set_permissions(&base, fs::Permissions::from_mode(0o770)).unwrap();
        refuses(&base, "can be written by other users");
        // For any user who runs the tests: either another user's, or one that others may write to.
        refuses(Path::new("/tmp"), if geteuid().is_root() { "can be written" } else { "belongs to another" });
    }
}
