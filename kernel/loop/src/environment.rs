//! What a component can change of its process behind everybody's back, put back after each job, so that it does not reach into
//! the next one.

use std::ffi::{CStr, CString};
use std::path::PathBuf;

use pdk_supervise::float;

/// The process as it was before a component was called.
pub struct Environment {
    directory: Option<PathBuf>,
    locale: Option<CString>,
    signals: libc::sigset_t,
    standard_files: [Option<(u64, u64)>; 3],
}

impl Environment {
    /// The environment of this process, and the signals that this thread takes.
    pub fn this() -> Self {
        Self {
            directory: std::env::current_dir().ok(),
            locale: locale(),
            signals: signals(),
            standard_files: standard_files(),
        }
    }

    /// Whether standard input, output and error are still what they were. They cannot be put back: what was closed may have become
    /// another file since.
    pub fn has_standard_files(&self) -> bool {
        standard_files() == self.standard_files
    }

    /// Puts everything back that can be, and says what was changed, a clause each.
    pub fn restore(&self) -> Vec<String> {
        let mut changed = Vec::new();
        if let Some(directory) = &self.directory
            && std::env::current_dir().ok().as_ref() != Some(directory)
        {
            // If the folder is gone, paths are from the root all the same.
            let _ = std::env::set_current_dir(directory);
            changed.push("a component changed the working directory, which was put back".to_owned());
        }
        if locale() != self.locale
            && let Some(locale) = &self.locale
        {
            // SAFETY: the text ends in zero; no other thread of this process formats numbers by the locale.
            unsafe { libc::setlocale(libc::LC_ALL, locale.as_ptr()) };
            changed.push("a component changed the locale, which was put back".to_owned());
        }
        if members(&signals()) != members(&self.signals) {
            // SAFETY: the set is that of an earlier call of this function.
            unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, &self.signals, std::ptr::null_mut()) };
            changed.push("a component changed which signals are blocked, which was put back".to_owned());
        }
        if !self.has_standard_files() {
            changed.push("a component closed standard input, output or error".to_owned());
        }
        if float::was_changed() {
            changed.push(
                "a component changed how floating-point numbers are rounded, which was put back".to_owned(),
            );
        }
        changed
    }
}

/// Device and number of the files that are standard input, output and error; none for one that is closed.
fn standard_files() -> [Option<(u64, u64)>; 3] {
    [0, 1, 2].map(|number| {
        let mut status = std::mem::MaybeUninit::<libc::stat>::zeroed();
        // SAFETY: the function only fills the structure, and says if there is no such file.
        let found = unsafe { libc::fstat(number, status.as_mut_ptr()) } == 0;
        // SAFETY: all zeros is a valid structure as well.
        let status = unsafe { status.assume_init() };
        found.then_some((status.st_dev, status.st_ino))
    })
}

fn locale() -> Option<CString> {
    // SAFETY: asks for the name, which stays valid until the next call on this thread.
    let name = unsafe { libc::setlocale(libc::LC_ALL, std::ptr::null()) };
    // SAFETY: a name that is not null ends in zero.
    (!name.is_null()).then(|| unsafe { CStr::from_ptr(name) }.to_owned())
}

fn signals() -> libc::sigset_t {
    let mut set = std::mem::MaybeUninit::<libc::sigset_t>::zeroed();
    // SAFETY: the function only fills the set with the signals that this thread blocks.
    unsafe {
        libc::pthread_sigmask(libc::SIG_BLOCK, std::ptr::null(), set.as_mut_ptr());
        set.assume_init()
    }
}

/// The signals of a set, one bit each.
fn members(set: &libc::sigset_t) -> u128 {
    // SAFETY: asks for the members of an initialised set.
    (1..=64).filter(|signal| unsafe { libc::sigismember(set, *signal) } == 1).map(|signal| 1 << signal).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_changed_is_put_back_and_said() {
        let before = Environment::this();
        assert!(before.restore().is_empty());
        let folder = std::env::current_dir().unwrap();
        std::env::set_current_dir("/").unwrap();
        let mut all = std::mem::MaybeUninit::<libc::sigset_t>::zeroed();
        // SAFETY: fills a set, and blocks its signals on this thread.
        unsafe {
            libc::sigfillset(all.as_mut_ptr());
            libc::pthread_sigmask(libc::SIG_BLOCK, all.as_ptr(), std::ptr::null_mut());
        }
        let said = before.restore();
        assert_eq!(said.len(), 2, "{said:?}");
        assert_eq!(std::env::current_dir().unwrap(), folder);
        assert!(before.restore().is_empty());
    }
}
