//! Streams: what a sensor sees, message by message, over a connection of its own.

use pdk_adapter::{Connection, Deadline, Station};
use pdk_sdk::prelude::{Error, ErrorKind, Result};

/// The length of a token.
const TOKEN: usize = 24;
/// The length of what every message begins with.
pub const HEADER: usize = 48;

/// Where a stream is to be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Token {
    /// The number of the stream.
    pub stream: u32,
    /// The port at which the server sends it.
    pub port: u16,
}

impl Token {
    /// Reads a token; its address is that of the server in all that we know, and not looked at.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let bytes: [u8; TOKEN] = bytes.try_into().ok()?;
        let [a, b, c, d, low, high, ..] = bytes;
        Some(Self { stream: u32::from_le_bytes([a, b, c, d]), port: u16::from_le_bytes([low, high]) })
    }
}

/// What every message begins with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Header {
    /// The number of the server's frame.
    pub frame: u64,
}

/// A subscribed stream.
#[derive(Debug)]
pub struct Stream {
    connection: Connection,
    token: Token,
    /// As it is named to users.
    what: &'static str,
    /// The sizes that a message may have, in bytes.
    sizes: (usize, usize),
    /// The size of the message that comes next, if it is known already.
    size: Option<usize>,
}

impl Stream {
    /// Subscribes to a stream of messages of `sizes` bytes, least and most.
    ///
    /// # Errors
    /// If the server cannot be reached at the port of the stream.
    pub fn subscribe(
        station: &mut Station,
        token: Token,
        what: &'static str,
        sizes: (usize, usize),
        deadline: &Deadline,
    ) -> Result<Self> {
        let socket = station.connect_to(token.port, deadline)?;
        let mut connection = Connection::new(socket, format!("the stream of {station}"), sizes.1 + 4)?;
        connection.send(&token.stream.to_le_bytes(), deadline)?;
        Ok(Self { connection, token, what, sizes, size: None })
    }

    /// Where it came from.
    pub fn token(&self) -> Token {
        self.token
    }

    /// Whether the connection still stands: the server closes one over which it has sent nothing for 10 s.
    pub fn is_open(&mut self) -> bool {
        self.connection.has_bytes(1).is_ok()
    }

    /// The next message, without its length. If it does not come in time, what has come of it is kept.
    ///
    /// # Errors
    /// If the stream ends, nothing comes in time, or a message has another size than these messages have.
    pub fn next(&mut self, deadline: &Deadline) -> Result<(Header, &[u8])> {
        let what = format!("sent {}", self.what);
        let size = match self.size {
            Some(size) => size,
            None => length(self.connection.bytes(4, deadline, &what)?),
        };
        self.size = Some(size);
        self.whole(size, deadline, &what)
    }

    /// The next message, where a whole one is there already.
    ///
    /// # Errors
    /// As [`Stream::next`].
    pub fn next_there(&mut self, deadline: &Deadline) -> Result<Option<(Header, &[u8])>> {
        let what = format!("sent {}", self.what);
        if self.size.is_none() && self.connection.has_bytes(4)? {
            self.size = Some(length(self.connection.bytes(4, deadline, &what)?));
        }
        match self.size {
            Some(size) if size > self.sizes.1 || self.connection.has_bytes(size)? => {
                self.whole(size, deadline, &what).map(Some)
            }
            _ => Ok(None),
        }
    }

    fn whole(&mut self, size: usize, deadline: &Deadline, what: &str) -> Result<(Header, &[u8])> {
        let (least, most) = self.sizes;
        if !(least..=most).contains(&size) {
            let expected = if least == most { format!("{least}") } else { format!("{least} to {most}") };
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "{} sends a message of {size} bytes as {}, which has {expected}; is another program at this port?",
                    self.connection.peer(),
                    self.what
                ),
            ));
        }
        let message = self.connection.bytes(size, deadline, what)?;
        self.size = None;
        let mut frame = [0; 8];
        frame.copy_from_slice(&message[8..16]);
        Ok((Header { frame: u64::from_le_bytes(frame) }, &message[HEADER..]))
    }
}

fn length(bytes: &[u8]) -> usize {
    let mut length = [0; 4];
    length.copy_from_slice(bytes);
    u32::from_le_bytes(length) as usize
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::net::{TcpListener, TcpStream};
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_message_that_comes_in_pieces_is_whole_in_the_end() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let socket = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (mut server, _) = listener.accept().unwrap();
        let connection = Connection::new(socket, "the stream", 1000).unwrap();
        let token = Token { stream: 3, port: 2001 };
        let mut stream = Stream { connection, token, what: "a picture", sizes: (60, 60), size: None };
        let soon = || Deadline::new(Duration::from_millis(50), "answer_seconds");
        let mut message = [0; 64];
        message[..4].copy_from_slice(&60u32.to_le_bytes());
        message[12] = 7;
        message[63] = 9;
        assert_eq!(stream.next_there(&soon()).unwrap(), None);
        for piece in [&message[..2], &message[2..30], &message[30..63]] {
            server.write_all(piece).unwrap();
            assert_eq!(stream.next(&soon()).unwrap_err().kind(), ErrorKind::Late);
        }
        server.write_all(&message[63..]).unwrap();
        let (header, body) = stream.next(&soon()).unwrap();
        assert_eq!((header.frame, body.len(), body[11]), (7, 12, 9));
        server.write_all(&61u32.to_le_bytes()).unwrap();
        let error = stream.next(&soon()).unwrap_err();
        assert!(error.kind() == ErrorKind::Nonsense && error.message().contains("61 bytes"), "{error}");
    }

    #[test]
    fn a_token_says_stream_and_port() {
        let mut bytes = [0; 24];
        bytes[..7].copy_from_slice(&[7, 0, 0, 0, 0xd1, 0x07, 1]);
        assert_eq!(Token::read(&bytes), Some(Token { stream: 7, port: 2001 }));
        assert_eq!(Token::read(&bytes[..23]), None);
        assert_eq!(Token::read(&[]), None);
    }
}
