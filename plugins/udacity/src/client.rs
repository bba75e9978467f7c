//! A client that is connected.

use std::net::TcpStream;

use tungstenite::WebSocket;

/// A client with a WebSocket, which has been greeted.
pub struct Client {
    pub socket: WebSocket<TcpStream>,
    /// Whether it speaks version 4 of Engine.IO, in which the server sends the pings.
    pub newer: bool,
}
