//! Who talks to the simulator at a port: one process of pdk at a time, since two that steer the same vehicle would both be wrong.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use pdk_sdk::cache::cache;
use pdk_sdk::prelude::{Error, ErrorKind, Result};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

/// A process that was ended a moment ago may still be on its way out.
const PATIENCE: Duration = Duration::from_secs(2);

/// The right to talk to the simulator at a port, for as long as it lives. The system takes it back at any end of the process.
#[derive(Debug)]
pub struct Claim {
    lock: File,
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Not left to the closing of the file, which a process that another thread is just starting may have open too.
        let _ = self.lock.unlock();
    }
}

impl Claim {
    /// Takes it.
    ///
    /// # Errors
    /// If another process has it, or its file cannot be made.
    pub fn new(host: &str, port: u16) -> Result<Self> {
        Self::within(&cache()?.folder.join("ports"), host, port)
    }

    /// Takes it, with its file in this folder.
    fn within(folder: &Path, host: &str, port: u16) -> Result<Self> {
        let name: String =
            host.chars().map(|c| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' }).collect();
        let path = folder.join(format!("{name}-{port}"));
        let cannot = |error: std::io::Error| {
            Error::of(ErrorKind::Configuration, format!("cannot write {}: {error}", path.display()))
        };
        fs::create_dir_all(folder).map_err(cannot)?;
        let mut lock = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(cannot)?;
        let began = Instant::now();
        loop {
            match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => break,
                Err(Errno::WOULDBLOCK) if began.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(20))
                }
                Err(Errno::WOULDBLOCK) => {
                    let mut owner = String::new();
                    // Who it is only helps to find them.
                    let _ = lock.read_to_string(&mut owner);
                    return Err(Error::of(
                        ErrorKind::Lost,
                        format!(
                            "another process of pdk ({}) talks to the simulator at port {port} of {host}; wait for it, or set `port` to \
                             that of another simulator",
                            owner.trim()
                        ),
                    ));
                }
                Err(error) => return Err(cannot(error.into())),
            }
        }
        let written = lock
            .set_len(0)
            .and_then(|()| lock.rewind())
            .and_then(|()| write!(lock, "{}", std::process::id()));
        written.map_err(cannot)?;
        Ok(Self { lock })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_one_owner_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let claim = |port| Claim::within(folder.path(), "nowhere.invalid", port);
        let first = claim(9).unwrap();
        assert!(claim(10).is_ok());
        let error = claim(9).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Lost);
        assert!(error.message().contains(&format!("pdk ({})", std::process::id())), "{error}");
        drop(first);
        assert!(claim(9).is_ok());
    }
}
