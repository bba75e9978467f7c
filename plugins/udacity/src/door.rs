//! Those who have connected and are not the simulator yet. None of them holds up another one: a browser, a port scanner and a client that says
//! nothing may come first, and the simulator behind them.

use std::collections::VecDeque;
use std::io;
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use pdk_adapter::Deadline;
use pdk_sdk::prelude::Result;
use tungstenite::handshake::server::{create_response, write_response};
use tungstenite::http::{Method, StatusCode};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use crate::client::Client;
use crate::http::{Request, Visitor};
use crate::polling::{Session, opening};

/// The longest message: a picture of 4096x4096 takes less.
pub const LONGEST: usize = 64 << 20;
/// How long a client may take to say what it wants, and how many may be about to at the same time.
const HANDSHAKE: Duration = Duration::from_secs(5);
const ROOM: usize = 16;

/// The client at the door.
#[derive(Default)]
pub struct Door {
    visitors: VecDeque<Visitor>,
    sessions: VecDeque<Session>,
    /// How many sessions there were.
    opened: u64,
    /// Why the last one that is not a simulator was sent away.
    pub refused: Option<String>,
}

impl Door {
    /// Lets in all who have come, and greets a simulator among them.
    ///
    /// # Errors
    /// If the system does not accept connections any more.
    pub fn look(&mut self, listener: &TcpListener) -> Result<Option<Client>> {
        loop {
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // It was gone before it was let in.
                Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => continue,
                Err(error) => return Err(error.into()),
            };
            if stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).is_ok() {
                // The oldest has had the most time.
                if self.visitors.len() >= ROOM {
                    self.visitors.pop_front();
                }
                self.visitors.push_back(Visitor::new(stream, Deadline::new(HANDSHAKE, "")));
            }
        }
        for _ in 0..self.visitors.len() {
            let Some(mut visitor) = self.visitors.pop_front() else { break };
            match visitor.hear() {
                Ok(Some(request)) => {
                    if let Some(client) = self.open(visitor, request) {
                        return Ok(Some(client));
                    }
                }
                Ok(None) if visitor.deadline.left().is_some() => self.visitors.push_back(visitor),
                Ok(None) => self.refused = Some("it did not say what it wants".to_owned()),
                Err(why) => self.refuse(visitor, why),
            }
        }
        for _ in 0..self.sessions.len() {
            let Some(mut session) = self.sessions.pop_front() else { break };
            match session.go_on() {
                Some(client) => return Ok(Some(client)),
                None if session.deadline.left().is_some() => self.sessions.push_back(session),
                None => self.refused = Some("it polls, and does not go over to a WebSocket".to_owned()),
            }
        }
        Ok(None)
    }

    /// Does what a request asks for: a client, if it is the simulator. The version of a WebSocket's address does not count: the simulator
    /// speaks another one than it says.
    fn open(&mut self, visitor: Visitor, request: Request) -> Option<Client> {
        let is_socket_io = request.head.uri().path().trim_end_matches('/') == "/socket.io";
        let number =
            request.query("sid").map(|sid| self.sessions.iter().position(|session| session.sid == sid));
        match (request.query("transport"), number) {
            (Some("websocket"), None) if is_socket_io => {
                let mut socket = self.upgrade(visitor, request)?;
                let greeted = socket.send(Message::text(format!("0{}", opening("pdk", &[]))));
                let greeted = greeted.and_then(|()| socket.send(Message::text("40")));
                if let Err(error) = greeted.and_then(|()| Ok(socket.get_ref().set_nonblocking(false)?)) {
                    self.refused = Some(error.to_string());
                    return None;
                }
                return Some(Client { socket, newer: false });
            }
            (Some("websocket"), Some(Some(number))) if is_socket_io => {
                let socket = self.upgrade(visitor, request)?;
                self.sessions[number].probe(socket);
            }
            (Some("polling"), Some(Some(number))) if is_socket_io => {
                self.sessions[number].poll(visitor, &request);
            }
            (Some("polling"), None) if is_socket_io && request.head.method() == Method::GET => {
                self.opened += 1;
                let newer = request.query("EIO") == Some("4");
                let sid = format!("pdk-{}", self.opened);
                let session = Session::new(sid, newer, Deadline::new(HANDSHAKE, ""));
                visitor.answer(StatusCode::OK, &session.greeting());
                if self.sessions.len() >= ROOM {
                    self.sessions.pop_front();
                }
                self.sessions.push_back(session);
            }
            _ => {
                self.refuse(
                    visitor,
                    "this is /socket.io/ with transport=websocket or transport=polling only".to_owned(),
                );
            }
        }
        None
    }

    fn refuse(&mut self, visitor: Visitor, why: String) {
        visitor.answer(StatusCode::BAD_REQUEST, &why);
        self.refused = Some(why);
    }

    /// Makes a WebSocket of a connection.
    fn upgrade(&mut self, visitor: Visitor, request: Request) -> Option<WebSocket<TcpStream>> {
        let response = match create_response(&request.head) {
            Ok(response) => response,
            Err(error) => {
                self.refuse(visitor, error.to_string());
                return None;
            }
        };
        let stream = visitor.stream;
        let written = stream.set_write_timeout(Some(HANDSHAKE)).map_err(tungstenite::Error::from);
        if let Err(error) = written.and_then(|()| write_response(&stream, &response)) {
            self.refused = Some(error.to_string());
            return None;
        }
        let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
        Some(WebSocket::from_partially_read(stream, request.rest, Role::Server, Some(config)))
    }
}
