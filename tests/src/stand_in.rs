//! Stand-ins for simulators, which are programs of their own: the embedded simulator behind the protocol of another one.

use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::{Duration, Instant};

use crate::built;
use crate::process::LIMIT;

/// A stand-in, which ends when this is dropped.
pub struct StandIn {
    child: Child,
}

impl StandIn {
    /// Starts one: `donkey` or `udacity`, at a port, with options and their values.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn start(which: &str, port: u16, options: &[&str]) -> Self {
        let mut command = Command::new(program());
        command.args([which, &port.to_string()]).args(options).stdin(Stdio::null());
        Self { child: command.spawn().unwrap() }
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The program, for callers that start it otherwise.
///
/// # Panics
/// If it has not been built.
pub fn program() -> PathBuf {
    built("stand_in")
}

/// This many ports, one after the other, that nothing listens at. Other tests get others.
///
/// # Panics
/// If there are none.
pub fn free_ports(count: u16) -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    // Test programs run one after the other, and tests of one at the same time. Below the ports that the system gives away.
    let base = 21_000 + (std::process::id() % 500) as u16 * 20;
    for _ in 0..200 {
        let first = base + NEXT.fetch_add(count, Ordering::Relaxed) % 10_000;
        if (first..first + count).all(|port| TcpListener::bind(("127.0.0.1", port)).is_ok()) {
            return first;
        }
    }
    panic!("no free ports");
}

/// Listens at a port of [`free_ports`]. A process that another test is just starting may have it open until it runs its program.
///
/// # Panics
/// If the port stays taken.
pub fn listen(port: u16) -> TcpListener {
    let began = Instant::now();
    loop {
        match TcpListener::bind(("127.0.0.1", port)) {
            Ok(listener) => return listener,
            Err(error) => assert!(began.elapsed() < LIMIT, "port {port}: {error}"),
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
