//! Clients that begin with HTTP long polling and go over to a WebSocket, as those of Socket.IO do by default.
//!
//! Nothing but the greeting goes over HTTP: the answer about its namespace waits until it has its WebSocket, so that it sends no
//! telemetry before.

use std::net::TcpStream;

use pdk_adapter::Deadline;
use tungstenite::http::{Method, StatusCode};
use tungstenite::{Message, WebSocket};

use crate::client::Client;
use crate::http::{Request, Visitor};

/// What answers a request for packets when there are none.
const NOTHING: &str = "6";
/// What parts packets in version 4 of Engine.IO.
const PART: char = '\u{1e}';

/// The answer to a client that opens a session. The times are those of pings, in milliseconds.
pub fn opening(sid: &str, upgrades: &[&str]) -> String {
    let upgrades: Vec<String> = upgrades.iter().map(|name| format!("\"{name}\"")).collect();
    format!(
        r#"{{"sid":"{sid}","upgrades":[{}],"pingTimeout":60000,"pingInterval":25000}}"#,
        upgrades.join(",")
    )
}

/// A client that polls.
pub struct Session {
    /// By this it says who it is.
    pub sid: String,
    /// Until then it has to have gone over to a WebSocket.
    pub deadline: Deadline,
    /// Whether it speaks version 4 of Engine.IO, and 5 of Socket.IO.
    newer: bool,
    /// Its request for packets, which is held until there are some.
    held: Option<Visitor>,
    /// The WebSocket that it tries out.
    socket: Option<WebSocket<TcpStream>>,
    /// Whether it has asked for the namespace.
    asked: bool,
}

impl Session {
    /// A session that was just asked for.
    pub fn new(sid: String, newer: bool, deadline: Deadline) -> Self {
        Self { sid, deadline, newer, held: None, socket: None, asked: false }
    }

    /// The answer to its first request.
    pub fn greeting(&self) -> String {
        self.payload(&format!("0{}", opening(&self.sid, &["websocket"])))
    }

    /// A packet as an answer: version 3 writes its length before it.
    fn payload(&self, packet: &str) -> String {
        if self.newer { packet.to_owned() } else { format!("{}:{packet}", packet.len()) }
    }

    /// It asks for packets, or sends some.
    pub fn poll(&mut self, visitor: Visitor, request: &Request) {
        if *request.head.method() == Method::POST {
            let packets = String::from_utf8_lossy(&request.rest);
            self.asked |= self.newer && packets.split(PART).any(|packet| packet.starts_with("40"));
            visitor.answer(StatusCode::OK, "ok");
        } else {
            self.release();
            self.held = Some(visitor);
        }
    }

    /// It tries out a WebSocket.
    pub fn probe(&mut self, socket: WebSocket<TcpStream>) {
        self.socket = Some(socket);
    }

    /// Answers the request that is held.
    fn release(&mut self) {
        if let Some(held) = self.held.take() {
            held.answer(StatusCode::OK, &self.payload(NOTHING));
        }
    }

    /// Goes on with trying out: the client, once it has gone over.
    pub fn go_on(&mut self) -> Option<Client> {
        let mut socket = self.socket.take()?;
        loop {
            match socket.read() {
                Ok(Message::Text(text)) if text.as_str() == "2probe" => {
                    socket.send(Message::text("3probe")).ok()?;
                    // It goes over when its request is answered.
                    self.release();
                }
                Ok(Message::Text(text)) if text.as_str() == "5" => {
                    self.release();
                    socket.get_ref().set_nonblocking(false).ok()?;
                    let connected = if self.newer { connected(&self.sid) } else { "40".to_owned() };
                    // The newer one gets the answer when it asks.
                    if !self.newer || self.asked {
                        socket.send(Message::text(connected)).ok()?;
                    }
                    return Some(Client { socket, newer: self.newer });
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    self.socket = Some(socket);
                    return None;
                }
                // It may try another one.
                Err(_) => return None,
            }
        }
    }
}

/// The answer to a client of Socket.IO 5 that asks for the namespace.
pub fn connected(sid: &str) -> String {
    format!(r#"40{{"sid":"{sid}"}}"#)
}
