//! A server of a test: it listens at ports, and serves each connection in a thread of its own. What it serves is a world that all of them
//! share.

use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::stand_in;

/// How a connection is served, until it is closed.
pub type Serve<W> = fn(TcpStream, &Shared<W>);

/// A running server. It ends when it is dropped.
pub struct Server<W> {
    shared: Arc<Shared<W>>,
    threads: Vec<JoinHandle<()>>,
}

/// What its threads share.
pub struct Shared<W> {
    world: Mutex<W>,
    connections: Mutex<Vec<TcpStream>>,
    stop: AtomicBool,
}

impl<W> Shared<W> {
    /// The world, for this thread alone until the guard is dropped.
    pub fn world(&self) -> MutexGuard<'_, W> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Closes all connections. New ones are taken.
    pub fn close_all(&self) {
        for stream in self.connections.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // It may be closed already.
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    /// Whether the server is to end.
    pub fn is_over(&self) -> bool {
        self.stop.load(Ordering::SeqCst)
    }
}

impl<W: Send + 'static> Server<W> {
    /// Listens at these ports of [`stand_in::free_ports`].
    ///
    /// # Panics
    /// If one of them stays taken.
    pub fn start(world: W, ports: &[(u16, Serve<W>)]) -> Self {
        let shared = Arc::new(Shared {
            world: Mutex::new(world),
            connections: Mutex::default(),
            stop: AtomicBool::new(false),
        });
        let listeners: Vec<_> = ports.iter().map(|&(port, serve)| (stand_in::listen(port), serve)).collect();
        let mut server = Self { shared, threads: Vec::new() };
        for (listener, serve) in listeners {
            server.beside(move |shared| listen(&listener, shared, serve));
        }
        server
    }

    /// Does something else in a thread of its own, until [`Shared::is_over`].
    pub fn beside(&mut self, work: impl FnOnce(&Arc<Shared<W>>) + Send + 'static) {
        let shared = Arc::clone(&self.shared);
        self.threads.push(std::thread::spawn(move || work(&shared)));
    }

    /// The world, for this thread alone until the guard is dropped.
    pub fn world(&self) -> MutexGuard<'_, W> {
        self.shared.world()
    }
}

impl<W> Drop for Server<W> {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::SeqCst);
        self.shared.close_all();
        for thread in self.threads.drain(..) {
            let ended = thread.join();
            // A test that has failed already says why.
            assert!(std::thread::panicking() || ended.is_ok(), "the simulator of the test has failed");
        }
    }
}

fn listen<W: Send + 'static>(listener: &TcpListener, shared: &Arc<Shared<W>>, serve: Serve<W>) {
    listener.set_nonblocking(true).unwrap();
    let mut serving = Vec::new();
    while !shared.is_over() {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false).unwrap();
                stream.set_nodelay(true).unwrap();
                let kept = stream.try_clone().unwrap();
                shared.connections.lock().unwrap_or_else(PoisonError::into_inner).push(kept);
                let shared = Arc::clone(shared);
                serving.push(std::thread::spawn(move || serve(stream, &shared)));
            }
            Err(_) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
    shared.close_all();
    for thread in serving {
        assert!(thread.join().is_ok(), "a connection of the simulator of the test has failed");
    }
}
