//! What is still said to the server where this process is ended from outside, in the middle of whatever it does: a server that is left
//! waiting for a client that is gone stands still for everybody.
//!
//! A copy of this process (a fork) waits for its end, and then sends what was agreed on over a connection of its own. It takes nothing with
//! it but that connection, a page of memory with the words, and a pipe of which it sees the end.

use std::io::{PipeWriter, Write};
use std::net::TcpStream;
use std::os::fd::{AsRawFd, RawFd};
use std::ptr;
use std::sync::atomic::{AtomicU32, Ordering};

use pdk_sdk::prelude::{Error, Result};

/// Room for the words, in bytes: some hundred actors.
const ROOM: usize = 1 << 16;
/// How long the copy waits for an answer before it takes it that all of them came, in milliseconds; and how often it does.
const PATIENCE: i32 = 500;
const ANSWERS: u32 = 1000;
/// Files that a process may have open, where the system cannot close all at once.
const MOST_FILES: RawFd = 1 << 16;

/// The words lie twice, so that those that hold are whole at any time.
#[repr(C)]
struct Page {
    /// Which of the two holds.
    holds: AtomicU32,
    lengths: [AtomicU32; 2],
    words: [[u8; ROOM]; 2],
}

/// The last words of this process to a server.
pub struct Will {
    page: *mut Page,
    copy: libc::pid_t,
    /// While it is open, the copy waits; a byte on it says that nothing is to be said.
    leash: Option<PipeWriter>,
}

// SAFETY: the page is this value's alone on this side, and the copy only reads what holds.
unsafe impl Send for Will {}

impl std::fmt::Debug for Will {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Will").field("copy", &self.copy).finish()
    }
}

impl Will {
    /// Will be said over this connection. There are no words yet.
    ///
    /// # Errors
    /// If the system has no memory or no process left.
    pub fn new(connection: &TcpStream) -> Result<Self> {
        let cannot = |error: std::io::Error| {
            Error::new(format!("cannot prepare for the end of this process: {error}"))
        };
        let (wait, leash) = std::io::pipe().map_err(cannot)?;
        // SAFETY: new memory at a place of the system's choice.
        let page = unsafe {
            libc::mmap(
                ptr::null_mut(),
                size_of::<Page>(),
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_ANONYMOUS,
                -1,
                0,
            )
        };
        if page == libc::MAP_FAILED {
            return Err(cannot(std::io::Error::last_os_error()));
        }
        // It is all zero, which is a page without words.
        let page = page.cast::<Page>();
        // SAFETY: the copy calls nothing but the system: neither memory nor locks of this process may be touched there.
        let copy = unsafe { libc::fork() };
        match copy {
            // SAFETY: this is the copy.
            0 => unsafe { wait_and_speak(page, wait.as_raw_fd(), connection.as_raw_fd()) },
            -1 => {
                let error = std::io::Error::last_os_error();
                // SAFETY: it was mapped above, and nothing else refers to it.
                unsafe { libc::munmap(page.cast(), size_of::<Page>()) };
                Err(cannot(error))
            }
            copy => Ok(Self { page, copy, leash: Some(leash) }),
        }
    }

    /// From now on these are the words.
    ///
    /// # Errors
    /// If they have no room.
    pub fn write(&mut self, words: &[u8]) -> Result<()> {
        if words.len() > ROOM {
            return Err(Error::new(format!(
                "there are too many actors to take away: {} bytes of requests",
                words.len()
            )));
        }
        // SAFETY: the page lives as long as this value, and the half that is written does not hold yet.
        let page = unsafe { &mut *self.page };
        let next = 1 - page.holds.load(Ordering::Acquire) as usize;
        page.words[next][..words.len()].copy_from_slice(words);
        page.lengths[next].store(words.len() as u32, Ordering::Release);
        page.holds.store(next as u32, Ordering::Release);
        Ok(())
    }
}

impl Will {
    /// Says the words now, and waits until the copy has done so.
    pub fn speak(mut self) {
        self.leash = None;
    }
}

impl Drop for Will {
    fn drop(&mut self) {
        // With a byte, the copy ends without a word.
        if let Some(mut leash) = self.leash.take() {
            let _ = leash.write_all(&[1]);
        }
        // SAFETY: it is a child of this process that nothing else waits for; the page was mapped by this value.
        unsafe {
            libc::waitpid(self.copy, ptr::null_mut(), 0);
            libc::munmap(self.page.cast(), size_of::<Page>());
        }
    }
}

/// The life of the copy.
///
/// # Safety
/// Only to be called right behind a fork, in the copy: it ends the process.
unsafe fn wait_and_speak(page: *const Page, wait: RawFd, connection: RawFd) -> ! {
    // SAFETY: system calls on numbers and on memory of this function, and on a page that is mapped here too. After a fork nothing else is
    // safe.
    unsafe {
        // A signal to the group of this process is not meant for its copy.
        libc::setsid();
        // If this process had closed its standard files, these two may have their numbers.
        let (wait, connection) =
            (libc::fcntl(wait, libc::F_DUPFD, 3), libc::fcntl(connection, libc::F_DUPFD, 3));
        let (wait, connection) = (libc::dup2(wait, 0), libc::dup2(connection, 1));
        // Among what is closed is the other end of the pipe, without which its end would never be seen.
        if libc::syscall(libc::SYS_close_range, 2, libc::c_uint::MAX, 0) != 0 {
            // Before Linux 5.9.
            (2..MOST_FILES).for_each(|file| {
                libc::close(file);
            });
        }
        let mut byte = 0u8;
        loop {
            match libc::read(wait, (&raw mut byte).cast(), 1) {
                0 => break,
                -1 if *libc::__errno_location() == libc::EINTR => {}
                _ => libc::_exit(0),
            }
        }
        let page = &*page;
        let holds = page.holds.load(Ordering::Acquire) as usize & 1;
        let length = (page.lengths[holds].load(Ordering::Acquire) as usize).min(ROOM);
        let mut sent = 0;
        while sent < length {
            match libc::send(
                connection,
                page.words[holds].as_ptr().add(sent).cast(),
                length - sent,
                libc::MSG_NOSIGNAL,
            ) {
                count @ 1.. => sent += count as usize,
                _ => libc::_exit(1),
            }
        }
        let mut answers = [0u8; 4096];
        for _ in 0..ANSWERS {
            let mut ready = libc::pollfd { fd: connection, events: libc::POLLIN, revents: 0 };
            if libc::poll(&raw mut ready, 1, PATIENCE) != 1
                || libc::recv(connection, answers.as_mut_ptr().cast(), answers.len(), 0) <= 0
            {
                break;
            }
        }
        libc::_exit(0)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::net::TcpListener;

    use super::*;

    fn pair() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (stream, listener.accept().unwrap().0)
    }

    #[test]
    fn an_orderly_end_needs_no_words() {
        let (stream, mut other) = pair();
        let mut will = Will::new(&stream).unwrap();
        will.write(b"farewell").unwrap();
        drop(will);
        drop(stream);
        let mut said = Vec::new();
        other.read_to_end(&mut said).unwrap();
        assert_eq!(said, b"");
    }

    /// The pipe is closed as the system does it at any end of a process.
    #[test]
    fn the_last_output_is_reported_if_the_process_ends() {
        let (stream, mut other) = pair();
        let mut will = Will::new(&stream).unwrap();
        will.write(b"first").unwrap();
        will.write(b"second").unwrap();
        will.write(b"third").unwrap();
        assert!(will.write(&vec![0; ROOM + 1]).is_err());
        drop(stream);
        will.speak();
        let mut said = Vec::new();
        other.read_to_end(&mut said).unwrap();
        assert_eq!(said, b"third");
    }
}
