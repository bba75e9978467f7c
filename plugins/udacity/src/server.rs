//! The server that the simulator connects to: WebSocket, Engine.IO 3 and Socket.IO 2, which the simulator speaks; and Engine.IO 4 and
//! Socket.IO 5, as far as these differ.

use std::io::{self, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use pdk_adapter::{Deadline, Station};
use pdk_sdk::prelude::{Error, ErrorKind, Result};
use tungstenite::{Message, Utf8Bytes, WebSocket};

use crate::client::Client;
use crate::door::{Door, LONGEST};
use crate::event::{self, Packet};
use crate::polling::connected;

/// How long the simulator may take to close the connection after the last message.
const GOODBYE: Duration = Duration::from_millis(300);
/// The answer to a client that is one too many.
const BUSY: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
/// How often a client of version 4 of Engine.IO is sent a ping.
const PING: Duration = Duration::from_secs(25);

/// The connection to a simulator, and the server that it came to.
pub struct Server {
    /// The simulator.
    pub station: Station,
    listener: TcpListener,
    socket: WebSocket<TcpStream>,
    /// As the simulator is named to users.
    peer: String,
    /// When a client that expects pings was sent the last one.
    pinged: Option<Instant>,
    /// Whether the user has been told that another simulator wants to connect.
    told: bool,
}

impl Server {
    /// Listens, starts the simulator if that is to be done, and waits until it has connected.
    ///
    /// # Errors
    /// If the port is taken, the simulator ends, or none connects in time.
    pub fn open(mut station: Station, deadline: &Deadline) -> Result<Self> {
        let listener = station.listen()?;
        let mut door = Door::default();
        let connected = station.wait(deadline, "connected", || door.look(&listener));
        let peer = station.to_string();
        let Client { socket, newer } = connected.map_err(|error| match error.kind() {
            ErrorKind::Late => absent(&station, door.refused.as_deref()),
            _ => error,
        })?;
        Ok(Self { station, listener, socket, peer, pinged: newer.then(Instant::now), told: false })
    }

    /// As the simulator is named to users.
    pub fn peer(&self) -> &str {
        &self.peer
    }

    /// Sends an event with texts in it.
    ///
    /// # Errors
    /// If the simulator is gone, or does not take it in time.
    pub fn send(&mut self, event: &str, fields: &[(&str, &str)], deadline: &Deadline) -> Result<()> {
        let fields: Vec<String> =
            fields.iter().map(|(name, text)| format!("\"{name}\":\"{text}\"")).collect();
        self.write(format!("42[\"{event}\",{{{}}}]", fields.join(",")), deadline)
    }

    /// Waits for the next packet that is of use, and looks at it. Pings are answered.
    ///
    /// # Errors
    /// If the simulator is gone, nothing comes in time, or it is not a packet.
    pub fn next<R>(
        &mut self,
        deadline: &Deadline,
        what: &str,
        look: impl FnOnce(Packet<'_>) -> R,
    ) -> Result<R> {
        loop {
            let Some(left) = deadline.left() else { return Err(deadline.late(&self.peer, what)) };
            self.ping(deadline)?;
            self.socket.get_ref().set_read_timeout(Some(left))?;
            if let Some(text) = self.read()?
                && let Some(text) = self.of_use(text, deadline)?
            {
                return self.packet(&text).map(look);
            }
        }
    }

    /// Looks at the next packet that is of use if it has come already.
    ///
    /// # Errors
    /// If the simulator is gone, or it is not a packet.
    pub fn take<R>(&mut self, deadline: &Deadline, look: impl FnOnce(Packet<'_>) -> R) -> Result<Option<R>> {
        self.refuse_others();
        self.ping(deadline)?;
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
        // If it is gone, that is all right too.
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

    /// A text that has come; none if there is a pause.
    fn read(&mut self) -> Result<Option<Utf8Bytes>> {
        match self.socket.read() {
            Ok(Message::Text(text)) => Ok(Some(text)),
            Ok(Message::Binary(bytes)) => {
                Err(self.nonsense(&format!("{} bytes that are not text", bytes.len())))
            }
            // Answered by the library; after a close the next call says that it is closed.
            Ok(Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_)) => Ok(None),
            Err(tungstenite::Error::Io(error)) if is_pause(&error) => Ok(None),
            Err(error) => Err(self.failed(error)),
        }
    }

    /// Sends a ping to a client that expects pings, when it is time.
    fn ping(&mut self, deadline: &Deadline) -> Result<()> {
        match &mut self.pinged {
            Some(pinged) if pinged.elapsed() >= PING => {
                *pinged = Instant::now();
                self.write("2".to_owned(), deadline)
            }
            _ => Ok(()),
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
            Ok(Packet::Connect) => {
                self.pinged.get_or_insert_with(Instant::now);
                self.write(connected("pdk"), deadline)?;
                Ok(None)
            }
            Ok(Packet::Other) => Ok(None),
            _ => Ok(Some(text)),
        }
    }

    fn packet<'a>(&mut self, text: &'a str) -> Result<Packet<'a>> {
        match event::read(text) {
            Ok(Packet::Close) => Err(self.lost("closed the connection")),
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

    /// Answers every other client that there is a simulator already.
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
                self.lost("closed the connection")
            }
            tungstenite::Error::Protocol(ResetWithoutClosingHandshake) => {
                self.lost("closed the connection, maybe in the middle of a message")
            }
            tungstenite::Error::Io(error) => {
                self.lost(&format!("is gone ({error}); check whether it still runs"))
            }
            tungstenite::Error::Capacity(_) => {
                self.nonsense(&format!("a message of more than {LONGEST} bytes"))
            }
            error => self.nonsense(&format!("something that is not a WebSocket message ({error})")),
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

fn absent(station: &Station, last: Option<&str>) -> Error {
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
