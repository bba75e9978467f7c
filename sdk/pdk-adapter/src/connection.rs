//! Messages over TCP, with limits on time and size.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use pdk_sdk::prelude::{Error, ErrorKind, Result};

use crate::deadline::Deadline;

/// How much is read at a time.
const PART: usize = 1 << 16;

/// A connection to a simulator. What it returns lies in its own memory, which is used again by the next call.
#[derive(Debug)]
pub struct Connection {
    stream: TcpStream,
    /// As it is named to users, such as "the Donkey simulator at 127.0.0.1:9091".
    peer: String,
    /// The longest message, in bytes.
    longest: usize,
    buffer: Vec<u8>,
    /// Where what has not been given away begins and ends.
    start: usize,
    end: usize,
    /// This many bytes from the start on hold no end of a line.
    searched: usize,
}

impl Connection {
    /// Takes a connected stream. No message may be longer than `longest` bytes.
    ///
    /// # Errors
    /// If the system refuses to send messages at once.
    pub fn new(stream: TcpStream, peer: impl Into<String>, longest: usize) -> Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_nonblocking(false)?;
        Ok(Self { stream, peer: peer.into(), longest, buffer: Vec::new(), start: 0, end: 0, searched: 0 })
    }

    /// As the other end is named to users.
    pub fn peer(&self) -> &str {
        &self.peer
    }

    /// Sends a message in one piece.
    ///
    /// # Errors
    /// If the other end is gone, or does not take it in time.
    pub fn send(&mut self, message: &[u8], deadline: &Deadline) -> Result<()> {
        let mut rest = message;
        while !rest.is_empty() {
            let Some(left) = deadline.left() else {
                return Err(deadline.late(&self.peer, "taken a message"));
            };
            self.stream.set_write_timeout(Some(left))?;
            match self.stream.write(rest) {
                Ok(sent) => rest = &rest[sent..],
                Err(error) if is_pause(&error) => {}
                Err(error) => return Err(self.gone(&error)),
            }
        }
        Ok(())
    }

    /// The next line, without its line feed; `what` is what the other end has not done where none comes, as in "sent telemetry".
    ///
    /// # Errors
    /// If the other end is gone, in the middle of a line or not, where none comes in time, or it is too long.
    pub fn line(&mut self, deadline: &Deadline, what: &str) -> Result<&[u8]> {
        loop {
            if let Some(length) = self.whole_line() {
                let line = self.start..self.start + length;
                self.start += length + 1;
                self.searched = 0;
                return Ok(&self.buffer[line]);
            }
            self.fill(self.end - self.start + 1, deadline, what)?;
        }
    }

    /// Whether a whole line is there, without waiting for one.
    ///
    /// # Errors
    /// If the other end is gone, or the line is too long.
    pub fn has_line(&mut self) -> Result<bool> {
        loop {
            if self.whole_line().is_some() {
                return Ok(true);
            }
            if !self.take_what_is_there()? {
                return Ok(false);
            }
        }
    }

    /// The next bytes, exactly this many.
    ///
    /// # Errors
    /// If the other end is gone, they do not come in time, or they are too many.
    pub fn bytes(&mut self, length: usize, deadline: &Deadline, what: &str) -> Result<&[u8]> {
        self.fill(length, deadline, what)?;
        let bytes = self.start..self.start + length;
        self.start += length;
        self.searched = self.searched.saturating_sub(length);
        Ok(&self.buffer[bytes])
    }

    /// Whether this many bytes are there, without waiting for them.
    ///
    /// # Errors
    /// If the other end is gone.
    pub fn has_bytes(&mut self, length: usize) -> Result<bool> {
        while self.end - self.start < length {
            if !self.take_what_is_there()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Says goodbye: nothing more is sent, and what the other end still sends is taken, until it hangs up too or the time is over.
    pub fn close(mut self, patience: Duration) {
        if self.stream.shutdown(Shutdown::Write).is_err() {
            return;
        }
        let deadline = Deadline::new(patience, "");
        let mut part = [0; 4096];
        while let Some(left) = deadline.left() {
            let set = self.stream.set_read_timeout(Some(left));
            if set.is_err() || !matches!(self.stream.read(&mut part), Ok(1..)) {
                return;
            }
        }
    }

    /// The length of the line at the start, if it is whole.
    fn whole_line(&mut self) -> Option<usize> {
        let there = &self.buffer[self.start..self.end];
        let found = memchr::memchr(b'\n', &there[self.searched..]).map(|place| place + self.searched);
        self.searched = found.unwrap_or(there.len());
        found
    }

    /// Reads until this many bytes are there.
    fn fill(&mut self, length: usize, deadline: &Deadline, what: &str) -> Result<()> {
        while self.end - self.start < length {
            let Some(left) = deadline.left() else { return Err(deadline.late(&self.peer, what)) };
            self.stream.set_read_timeout(Some(left))?;
            self.read(length)?;
        }
        Ok(())
    }

    /// Takes what has come, without waiting; whether there was anything.
    fn take_what_is_there(&mut self) -> Result<bool> {
        self.stream.set_nonblocking(true)?;
        let before = self.end - self.start;
        let read = self.read(before + 1);
        self.stream.set_nonblocking(false)?;
        read?;
        Ok(self.end - self.start > before)
    }

    /// Reads a part; a pause is none.
    fn read(&mut self, wanted: usize) -> Result<()> {
        if wanted > self.longest {
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "{} sends a message of more than {} bytes, which is none of its protocol; is another program at this port?",
                    self.peer, self.longest
                ),
            ));
        }
        if self.start > 0 && (self.start == self.end || self.buffer.len() - self.end < PART) {
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
        }
        let room = (self.end + PART).max(self.start + wanted);
        if self.buffer.len() < room {
            self.buffer.resize(room, 0);
        }
        match self.stream.read(&mut self.buffer[self.end..]) {
            Ok(0) => Err(self.closed()),
            Ok(count) => {
                self.end += count;
                Ok(())
            }
            Err(error) if is_pause(&error) => Ok(()),
            Err(error) => Err(self.gone(&error)),
        }
    }

    fn closed(&self) -> Error {
        let sentence = match self.end - self.start {
            0 => format!("{} has closed the connection", self.peer),
            part => format!(
                "{} has closed the connection in the middle of a message, after {part} bytes of it",
                self.peer
            ),
        };
        Error::of(ErrorKind::Lost, sentence)
    }

    fn gone(&self, error: &io::Error) -> Error {
        Error::of(
            ErrorKind::Lost,
            format!("the connection to {} is gone ({error}); check whether it still runs", self.peer),
        )
    }
}

fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    fn pair(longest: usize) -> (Connection, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (Connection::new(stream, "the simulator", longest).unwrap(), listener.accept().unwrap().0)
    }

    fn soon() -> Deadline {
        Deadline::new(Duration::from_millis(300), "answer_seconds")
    }

    #[test]
    fn lines_come_whole_however_they_are_cut() {
        let (mut connection, mut other) = pair(1 << 20);
        assert!(!connection.has_line().unwrap());
        let sender = std::thread::spawn(move || {
            for part in ["on", "e\ntwo\nth", "ree\n"] {
                other.write_all(part.as_bytes()).unwrap();
                std::thread::sleep(Duration::from_millis(20));
            }
            other.write_all(&[vec![b'x'; 500_000], vec![b'\n']].concat()).unwrap();
            other
        });
        for expected in ["one", "two", "three"] {
            assert_eq!(connection.line(&soon(), "sent a line").unwrap(), expected.as_bytes());
        }
        assert_eq!(connection.line(&soon(), "sent a line").unwrap().len(), 500_000);
        drop(sender.join().unwrap());
        let error = connection.line(&soon(), "sent a line").unwrap_err();
        assert_eq!(error, Error::of(ErrorKind::Lost, "the simulator has closed the connection"));
    }

    #[test]
    fn bytes_and_lines_share_what_has_come() {
        let (mut connection, mut other) = pair(1000);
        other.write_all(b"abcdefg\nrest\n").unwrap();
        assert_eq!(connection.bytes(3, &soon(), "sent").unwrap(), b"abc");
        assert!(connection.has_bytes(5).unwrap() && !connection.has_bytes(50).unwrap());
        assert_eq!(connection.line(&soon(), "sent").unwrap(), b"defg");
        assert!(connection.has_line().unwrap());
        assert_eq!(connection.line(&soon(), "sent").unwrap(), b"rest");
        connection.send(b"bye", &soon()).unwrap();
        connection.close(Duration::from_millis(50));
        let mut said = String::new();
        other.read_to_string(&mut said).unwrap();
        assert_eq!(said, "bye");
    }

    #[test]
    fn half_a_message_silence_and_a_flood_have_errors_of_their_own() {
        let (mut connection, mut other) = pair(1000);
        other.write_all(b"half").unwrap();
        let error = connection.line(&soon(), "sent telemetry").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Late);
        assert!(error.message().starts_with("the simulator has not sent telemetry within 0.3 s"));
        drop(other);
        let error = connection.line(&soon(), "sent telemetry").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Lost);
        assert!(error.message().ends_with("in the middle of a message, after 4 bytes of it"));

        let (mut connection, mut other) = pair(100_000);
        let flood = std::thread::spawn(move || {
            // Ends when there is no listener any more.
            while other.write_all(&[b'x'; 10_000]).is_ok() {}
        });
        let error = connection.line(&soon(), "sent telemetry").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Nonsense);
        assert!(error.message().contains("more than 100000 bytes"), "{error}");
        drop(connection);
        flood.join().unwrap();
    }

    #[test]
    fn one_that_takes_nothing_is_late() {
        let (mut connection, _other) = pair(1000);
        let error = connection.send(&vec![0; 100 << 20], &soon()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Late);
        assert!(error.message().contains("has not taken a message"), "{error}");
    }
}
