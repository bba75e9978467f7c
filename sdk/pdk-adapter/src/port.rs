//! Who talks to the simulator at a port: one process of pdk at a time, since two that steer the same vehicle would both be wrong.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::net::{Ipv4Addr, SocketAddr, ToSocketAddrs};
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
    /// One for each address of the host.
    locks: Vec<File>,
}

impl Drop for Claim {
    fn drop(&mut self) {
        for lock in &self.locks {
            // Not left to the closing of the file, which a process that another thread is just starting may have open too.
            let _ = lock.unlock();
        }
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

    /// Takes it, with its files in this folder.
    fn within(folder: &Path, host: &str, port: u16) -> Result<Self> {
        fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
        // What has been taken is given back if another one cannot be.
        let mut claim = Self { locks: Vec::new() };
        for name in names(host, port) {
            let lock = lock(&folder.join(format!("{name}-{port}")))?;
            claim.locks.push(lock.map_err(|owner| {
                Error::of(
                    ErrorKind::Lost,
                    format!(
                        "another process of pdk ({owner}) talks to the simulator at port {port} of {host}; wait for it, or set `port` to \
                         that of another simulator"
                    ),
                )
            })?);
        }
        Ok(claim)
    }
}

/// The names of a host's addresses, always in the same order, so that all spellings of a host are one: those of this machine share a name. A
/// host without an address has its own.
fn names(host: &str, port: u16) -> BTreeSet<String> {
    let canonical = |address: SocketAddr| match address.ip().to_canonical() {
        ip if ip.is_loopback() || ip.is_unspecified() => Ipv4Addr::LOCALHOST.to_string(),
        ip => ip.to_string(),
    };
    let addresses = (host, port).to_socket_addrs().into_iter().flatten();
    let mut names: BTreeSet<String> = addresses.map(canonical).collect();
    if names.is_empty() {
        names.insert(host.to_lowercase());
    }
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    names.iter().map(|name| name.chars().map(plain).collect()).collect()
}

/// Takes the lock of a file, and writes into it which process has it; `Err` is the process that has it.
fn lock(path: &Path) -> Result<Result<File, String>> {
    let cannot = |error: std::io::Error| unwritable(path, &error);
    let mut lock =
        OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(cannot)?;
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
                return Ok(Err(owner.trim().to_owned()));
            }
            Err(error) => return Err(cannot(error.into())),
        }
    }
    let written =
        lock.set_len(0).and_then(|()| lock.rewind()).and_then(|()| write!(lock, "{}", std::process::id()));
    written.map_err(cannot)?;
    Ok(Ok(lock))
}

fn unwritable(path: &Path, error: &std::io::Error) -> Error {
    Error::of(ErrorKind::Configuration, format!("cannot write {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_one_owner_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let claim = |port| Claim::within(folder.path(), "192.0.2.1", port);
        let first = claim(9).unwrap();
        assert!(claim(10).is_ok());
        let error = claim(9).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Lost);
        assert!(error.message().contains(&format!("pdk ({})", std::process::id())), "{error}");
        drop(first);
        assert!(claim(9).is_ok());
    }

    #[test]
    fn all_spellings_of_a_host_are_one_claim() {
        let of = |host: &str| names(host, 9).into_iter().collect::<Vec<_>>();
        for host in ["127.0.0.1", "localhost", "::1", "::ffff:127.0.0.1", "0.0.0.0", "::"] {
            assert_eq!(of(host), ["127.0.0.1"], "{host}");
        }
        assert_eq!(of("::ffff:192.0.2.1"), of("192.0.2.1"));
        assert_eq!(of("2001:DB8:0::1"), of("2001:db8::1"));
        assert_ne!(of("192.0.2.2"), of("192.0.2.1"));
        // It has no address, and that is known without a network.
        assert_eq!(of("No\0Host"), ["no-host"]);

        let folder = tempfile::tempdir().unwrap();
        let first = Claim::within(folder.path(), "127.0.0.1", 9).unwrap();
        let error = Claim::within(folder.path(), "::1", 9).unwrap_err();
        assert!(error.message().contains("talks to the simulator at port 9 of ::1"), "{error}");
        drop(first);
        assert!(Claim::within(folder.path(), "::1", 9).is_ok());
    }
}
