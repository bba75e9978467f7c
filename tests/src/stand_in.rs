//! Stand-ins for simulators, which are programs of their own: the embedded simulator behind the protocol of another one.

use std::fs::File;
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
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

/// The first port that tests take. All are below those that the system gives away.
const FIRST: u16 = 21_000;
/// Ports are taken in blocks of this many.
const BLOCK: u16 = 100;
/// How many blocks there are.
const BLOCKS: u16 = 110;

/// The block that ports are taken from, and the locks of all that were taken: other runs of the tests at the same time leave them alone.
struct Taken {
    next: u16,
    end: u16,
    locks: Vec<File>,
}

static TAKEN: Mutex<Taken> = Mutex::new(Taken { next: 0, end: 0, locks: Vec::new() });

impl Taken {
    /// Goes on to the next block that no process has.
    fn block(&mut self) {
        let folder = std::env::temp_dir().join("pdk-test-ports");
        // If it cannot be made, neither can the files in it.
        let _ = std::fs::create_dir_all(&folder);
        let begin = (std::process::id() % u32::from(BLOCKS)) as u16;
        for number in (begin..BLOCKS).chain(0..begin) {
            // Another user of this machine may have made it.
            let Ok(lock) = File::create(folder.join(number.to_string())) else { continue };
            if lock.try_lock().is_ok() {
                self.locks.push(lock);
                self.next = FIRST + number * BLOCK;
                self.end = self.next + BLOCK;
                return;
            }
        }
        panic!("all ports for tests are taken, or no files can be made in {}", folder.display());
    }
}

/// This many ports, one after the other, that nothing listens at. Other tests get others.
///
/// # Panics
/// If there are none.
pub fn free_ports(count: u16) -> u16 {
    let mut taken = TAKEN.lock().unwrap();
    loop {
        if taken.next + count > taken.end {
            taken.block();
        }
        let first = taken.next;
        taken.next += count;
        if (first..first + count).all(|port| TcpListener::bind(("127.0.0.1", port)).is_ok()) {
            return first;
        }
    }
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
