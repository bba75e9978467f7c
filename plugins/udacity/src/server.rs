//! The server that the simulator connects to: WebSocket, Engine.IO 3 and Socket.IO 2.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use pdk_adapter::{Deadline, Station};
use pdk_sdk::prelude::{Error, ErrorKind, Result};
use tungstenite::handshake::server::{ErrorResponse, Request, Response, ServerHandshake};
use tungstenite::handshake::{HandshakeError, MidHandshake};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, Utf8Bytes, WebSocket, http};

use crate::event::{self, Packet};

/// The longest message: a picture of 4096x4096 takes less.
const LONGEST: usize = 64 << 20;
/// How long a client may take to say what it wants, and how many may be about to at the same time.
const HANDSHAKE: Duration = Duration::from_secs(5);
const ROOM: usize = 16;
/// How long the simulator may take to hang up when it is said goodbye.
const GOODBYE: Duration = Duration::from_millis(300);
/// What a client is told that is one too many.
const BUSY: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
/// The greeting. The times are those that the simulator pings by, in milliseconds.
const GREETING: [&str; 2] =
    [r#"0{"sid":"pdk","upgrades":[],"pingTimeout":60000,"pingInterval":25000}"#, "40"];

/// The connection to a simulator, and the server that it came to.
pub struct Server {
    /// The simulator.
    pub station: Station,
    listener: TcpListener,
    socket: WebSocket<TcpStream>,
    /// As the simulator is named to users.
    peer: String,
    /// Whether the user has been told that another simulator wants to connect.
    told: bool,
}

impl Server {
    /// Listens, starts the simulator where that is to be done, and waits until it has connected.
    ///
    /// # Errors
    /// Where the port is taken, the simulator ends, or none connects in time.
    pub fn open(mut station: Station, deadline: &Deadline) -> Result<Self> {
        let listener = station.listen()?;
        let mut door = Door::default();
        let connected = station.wait(deadline, "connected", || door.look(&listener));
        let peer = station.to_string();
        let socket = connected.map_err(|error| match error.kind() {
            ErrorKind::Late => nobody(&station, door.refused.as_deref()),
            _ => error,
        })?;
        Ok(Self { station, listener, socket, peer, told: false })
    }

    /// As the simulator is named to users.
    pub fn peer(&self) -> &str {
        &self.peer
    }

    /// Sends an event with texts in it.
    ///
    /// # Errors
    /// Where the simulator is gone, or does not take it in time.
    pub fn send(&mut self, event: &str, fields: &[(&str, &str)], deadline: &Deadline) -> Result<()> {
        let fields: Vec<String> =
            fields.iter().map(|(name, text)| format!("\"{name}\":\"{text}\"")).collect();
        self.write(format!("42[\"{event}\",{{{}}}]", fields.join(",")), deadline)
    }

    /// Waits for the next packet that is of use, and looks at it. Pings are answered.
    ///
    /// # Errors
    /// Where the simulator is gone, nothing comes in time, or it is no packet.
    pub fn next<R>(
        &mut self,
        deadline: &Deadline,
        what: &str,
        look: impl FnOnce(Packet<'_>) -> R,
    ) -> Result<R> {
        loop {
            let Some(left) = deadline.left() else { return Err(deadline.late(&self.peer, what)) };
            self.socket.get_ref().set_read_timeout(Some(left))?;
            if let Some(text) = self.read()?
                && let Some(text) = self.of_use(text, deadline)?
            {
                return self.packet(&text).map(look);
            }
        }
    }

    /// Looks at the next packet that is of use where it has come already.
    ///
    /// # Errors
    /// Where the simulator is gone, or it is no packet.
    pub fn take<R>(&mut self, deadline: &Deadline, look: impl FnOnce(Packet<'_>) -> R) -> Result<Option<R>> {
        self.refuse_others();
        loop {
            self.socket.get_ref().set_nonblocking(true)?;
            let read = self.read();
            self.socket.get_ref().set_nonblocking(false)?;
            let Some(text) = read? else { return Ok(None) };
            if let Some(text) = self.of_use(text, deadline)? {
                return self.packet(&text).map(look).map(Some);
            }
        }
    }

    /// Says goodbye, and lets the simulator hang up.
    pub fn close(mut self) {
        let soon = Deadline::new(GOODBYE, "answer_seconds");
        // Where it is gone, that is all right too.
        if self.socket.close(None).is_err() {
            return;
        }
        while let Some(left) = soon.left() {
            let set = self.socket.get_ref().set_read_timeout(Some(left));
            if set.is_err() || self.socket.read().is_err() {
                return;
            }
        }
    }

    /// A text that has come; none where there is a pause.
    fn read(&mut self) -> Result<Option<Utf8Bytes>> {
        match self.socket.read() {
            Ok(Message::Text(text)) => Ok(Some(text)),
            Ok(Message::Binary(bytes)) => {
                Err(self.nonsense(&format!("{} bytes that are no text", bytes.len())))
            }
            // Answered by the library; after a close the next call says that it is closed.
            Ok(Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_)) => Ok(None),
            Err(tungstenite::Error::Io(error)) if is_pause(&error) => Ok(None),
            Err(error) => Err(self.failed(error)),
        }
    }

    /// Answers a ping, and gives back anything else that is of use.
    fn of_use(&mut self, text: Utf8Bytes, deadline: &Deadline) -> Result<Option<Utf8Bytes>> {
        match event::read(&text) {
            Ok(Packet::Ping(rest)) => {
                let pong = format!("3{rest}");
                self.write(pong, deadline)?;
                Ok(None)
            }
            Ok(Packet::Other) => Ok(None),
            _ => Ok(Some(text)),
        }
    }

    fn packet<'a>(&mut self, text: &'a str) -> Result<Packet<'a>> {
        match event::read(text) {
            Ok(Packet::Close) => Err(self.lost("has hung up")),
            Ok(packet) => Ok(packet),
            Err(clause) => Err(self.nonsense(&clause)),
        }
    }

    fn write(&mut self, text: String, deadline: &Deadline) -> Result<()> {
        let mut sent = self.socket.write(Message::text(text));
        loop {
            match sent {
                Ok(()) => {}
                Err(tungstenite::Error::Io(error)) if is_pause(&error) => {}
                Err(error) => return Err(self.failed(error)),
            }
            let Some(left) = deadline.left() else {
                return Err(deadline.late(&self.peer, "taken a message"));
            };
            self.socket.get_ref().set_write_timeout(Some(left))?;
            sent = match self.socket.flush() {
                Ok(()) => return Ok(()),
                Err(error) => Err(error),
            };
        }
    }

    /// Tells whoever else connects that there is a simulator already.
    fn refuse_others(&mut self) {
        while let Ok((mut stream, _)) = self.listener.accept() {
            // It may be gone already.
            let _ = stream.write_all(BUSY);
            if !std::mem::replace(&mut self.told, true) {
                eprintln!(
                    "pdk: warning: {} is connected, and another simulator wants to connect to the same port: it is refused; give each its own",
                    self.peer
                );
            }
        }
    }

    fn failed(&mut self, error: tungstenite::Error) -> Error {
        use tungstenite::error::ProtocolError::ResetWithoutClosingHandshake;
        match error {
            tungstenite::Error::ConnectionClosed | tungstenite::Error::AlreadyClosed => {
                self.lost("has hung up")
            }
            tungstenite::Error::Protocol(ResetWithoutClosingHandshake) => {
                self.lost("has hung up without a word, maybe in the middle of a message")
            }
            tungstenite::Error::Io(error) => {
                self.lost(&format!("is gone ({error}); look whether it still runs"))
            }
            tungstenite::Error::Capacity(_) => {
                self.nonsense(&format!("a message of more than {LONGEST} bytes"))
            }
            error => self.nonsense(&format!("what is no WebSocket message ({error})")),
        }
    }

    fn lost(&mut self, how: &str) -> Error {
        let error = Error::of(ErrorKind::Lost, format!("{} {how}", self.peer));
        self.station.blame(error)
    }

    fn nonsense(&self, what: &str) -> Error {
        Error::of(
            ErrorKind::Nonsense,
            format!("{} sends {what}; is another program connected to this port?", self.peer),
        )
    }
}

/// What decides about a request.
type Wanted = fn(&Request, Response) -> std::result::Result<Response, ErrorResponse>;
/// A client that has not said all that it wants.
type Speaking = MidHandshake<ServerHandshake<TcpStream, Wanted>>;

/// What came of hearing one.
type Said = std::result::Result<WebSocket<TcpStream>, HandshakeError<ServerHandshake<TcpStream, Wanted>>>;

/// Those who have connected and have not said yet what they want. None of them holds up another one: a browser, a port scanner and
/// whoever says nothing may come first, and the simulator behind them.
#[derive(Default)]
struct Door {
    speaking: VecDeque<(Speaking, Deadline)>,
    /// Why the last one that is no simulator was sent away.
    refused: Option<String>,
}

impl Door {
    /// Lets in who has come, and greets a simulator among them.
    fn look(&mut self, listener: &TcpListener) -> Result<Option<WebSocket<TcpStream>>> {
        loop {
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // It was gone before it was let in.
                Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => continue,
                Err(error) => return Err(error.into()),
            };
            if stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).is_err() {
                continue;
            }
            let config =
                WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
            let accepted = tungstenite::accept_hdr_with_config(stream, wanted as Wanted, Some(config));
            if let Some(socket) = self.hear(accepted, Deadline::new(HANDSHAKE, "")) {
                return Ok(Some(socket));
            }
        }
        for _ in 0..self.speaking.len() {
            if let Some((speaking, deadline)) = self.speaking.pop_front()
                && let Some(socket) = self.hear(speaking.handshake(), deadline)
            {
                return Ok(Some(socket));
            }
        }
        Ok(None)
    }

    /// Takes what a client has said so far: the connection where it is a simulator, which has been greeted.
    fn hear(&mut self, said: Said, deadline: Deadline) -> Option<WebSocket<TcpStream>> {
        let refused = match said {
            Ok(socket) => match greet(socket) {
                Ok(socket) => return Some(socket),
                Err(error) => error.to_string(),
            },
            Err(HandshakeError::Interrupted(speaking)) if deadline.left().is_some() => {
                // The oldest has had the most time.
                if self.speaking.len() >= ROOM {
                    self.speaking.pop_front();
                }
                self.speaking.push_back((speaking, deadline));
                return None;
            }
            Err(HandshakeError::Interrupted(_)) => "it did not say what it wants".to_owned(),
            Err(HandshakeError::Failure(error)) => error.to_string(),
        };
        self.refused = Some(refused);
        None
    }
}

fn greet(mut socket: WebSocket<TcpStream>) -> std::result::Result<WebSocket<TcpStream>, tungstenite::Error> {
    let stream = socket.get_ref();
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(HANDSHAKE))?;
    for text in GREETING {
        socket.send(Message::text(text))?;
    }
    Ok(socket)
}

/// Refuses what is no request for Socket.IO over a WebSocket. The version that the address names does not count: the simulator
/// speaks another one than it says.
#[allow(clippy::result_large_err)]
fn wanted(request: &Request, response: Response) -> std::result::Result<Response, ErrorResponse> {
    let uri = request.uri();
    let websocket = uri.query().unwrap_or_default().split('&').any(|pair| pair == "transport=websocket");
    if uri.path().trim_end_matches('/') == "/socket.io" && websocket {
        return Ok(response);
    }
    let mut refused =
        ErrorResponse::new(Some("this is /socket.io/ with transport=websocket only".to_owned()));
    *refused.status_mut() = http::StatusCode::BAD_REQUEST;
    Err(refused)
}

fn nobody(station: &Station, last: Option<&str>) -> Error {
    let settings = station.settings();
    let other = last.map(|why| format!("; something else tried to ({why})")).unwrap_or_default();
    Error::of(
        ErrorKind::Lost,
        format!(
            "{station} has not connected within {} s{other}; {}",
            settings.start.as_secs_f64(),
            station.remedy(
                "start it, and see that it connects to this port (the stock build always takes 4567)"
            )
        ),
    )
}

fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}
