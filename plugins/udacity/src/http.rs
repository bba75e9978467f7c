//! Requests of HTTP: how every client of Socket.IO begins.

use std::io::{self, Read, Write};
use std::net::TcpStream;

use pdk_adapter::Deadline;
use tungstenite::http;

/// The longest head and the longest body of a request in bytes. Before a client has a WebSocket it has little to say.
const HEAD: usize = 16 << 10;
const BODY: usize = 1 << 20;
/// The most header fields.
const FIELDS: usize = 64;

/// A client that has not said all that it wants.
pub struct Visitor {
    pub stream: TcpStream,
    said: Vec<u8>,
    pub deadline: Deadline,
}

/// A whole request.
pub struct Request {
    /// Its head.
    pub head: http::Request<()>,
    /// Its body, or whatever else came behind its head.
    pub rest: Vec<u8>,
}

impl Request {
    /// A value of the query.
    pub fn query(&self, name: &str) -> Option<&str> {
        let pairs = self.head.uri().query()?.split('&');
        pairs.filter_map(|pair| pair.split_once('=')).find(|(key, _)| *key == name).map(|(_, value)| value)
    }
}

impl Visitor {
    /// Takes a connection that does not block.
    pub fn new(stream: TcpStream, deadline: Deadline) -> Self {
        Self { stream, said: Vec::new(), deadline }
    }

    /// Takes what has come: the request, if it is whole.
    ///
    /// # Errors
    /// Why this is not going to be a request.
    pub fn hear(&mut self) -> Result<Option<Request>, String> {
        let mut part = [0; 4096];
        loop {
            match self.stream.read(&mut part) {
                Ok(0) => return Err("it closed the connection".to_owned()),
                Ok(count) => self.said.extend(&part[..count]),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return self.request(),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
            if self.said.len() > HEAD + BODY {
                return Err("its request is too long".to_owned());
            }
        }
    }

    fn request(&mut self) -> Result<Option<Request>, String> {
        let mut fields = [httparse::EMPTY_HEADER; FIELDS];
        let mut parsed = httparse::Request::new(&mut fields);
        let length = match parsed.parse(&self.said) {
            Ok(httparse::Status::Complete(length)) if length <= HEAD => length,
            Ok(httparse::Status::Partial) if self.said.len() <= HEAD => return Ok(None),
            Ok(_) => return Err("its request is too long".to_owned()),
            Err(error) => return Err(format!("what it says is not HTTP ({error})")),
        };
        let mut head = http::Request::builder()
            .method(parsed.method.unwrap_or_default())
            .uri(parsed.path.unwrap_or_default());
        if parsed.version == Some(0) {
            head = head.version(http::Version::HTTP_10);
        }
        for field in parsed.headers.iter() {
            head = head.header(field.name, field.value);
        }
        let head = head.body(()).map_err(|error| format!("what it says is not HTTP ({error})"))?;
        let body = match head.headers().get(http::header::CONTENT_LENGTH) {
            None => 0,
            Some(length) => {
                let length = length.to_str().ok().and_then(|length| length.parse::<usize>().ok());
                length.filter(|length| *length <= BODY).ok_or("its request is too long")?
            }
        };
        if self.said.len() - length < body {
            return Ok(None);
        }
        Ok(Some(Request { head, rest: self.said.split_off(length) }))
    }

    /// Answers, and hangs up. It may be gone already.
    pub fn answer(mut self, status: http::StatusCode, body: &str) {
        let _ = self.stream.write_all(answer(status, body).as_bytes());
    }
}

fn answer(status: http::StatusCode, body: &str) -> String {
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=UTF-8\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    )
}
