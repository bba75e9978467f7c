//! The connection to the simulator, and the rules by which it wants to be written to.

use std::time::{Duration, Instant};

use pdk_adapter::{Connection, Deadline, Station};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json;

use crate::message::{self, Message};

/// The longest message of the simulator: a picture of 4096x4096 takes less.
const LONGEST: usize = 64 << 20;
/// The road-generating build reads so much at a time, and takes it for one message.
const LONGEST_SENT: usize = 8142;
/// So much of it is left for the points of a road.
pub const ROOM: usize = LONGEST_SENT - 100;
/// Two messages between which nothing was heard may not be read together.
const GAP: Duration = Duration::from_millis(50);
/// How long the simulator may take to close the connection after the last message.
const GOODBYE: Duration = Duration::from_millis(300);

/// A connection to the simulator of a station.
pub struct Wire {
    /// The simulator.
    pub station: Station,
    connection: Connection,
    /// As the simulator is named to users.
    peer: String,
    /// When the last message was sent; none if something was heard since.
    unheard: Option<Instant>,
    /// When the last message was sent.
    sent: Option<Instant>,
    repaired: Vec<u8>,
    /// Whether a message has come.
    spoken: bool,
}

impl Wire {
    /// Starts the simulator if that is to be done, and connects to it.
    ///
    /// # Errors
    /// If it is not there.
    pub fn open(mut station: Station, deadline: &Deadline) -> Result<Self> {
        let stream = station.connect(0, deadline)?;
        let peer = station.to_string();
        let connection = Connection::new(stream, peer.clone(), LONGEST)?;
        Ok(Self { station, connection, peer, unheard: None, sent: None, repaired: Vec::new(), spoken: false })
    }

    /// Sends a message.
    ///
    /// # Errors
    /// If it is none that the simulator can read, or the simulator is gone.
    pub fn send(&mut self, kind: &str, fields: &[(&str, String)], deadline: &Deadline) -> Result<()> {
        if let Some(sent) = self.unheard {
            std::thread::sleep(GAP.saturating_sub(sent.elapsed()));
        }
        let text = print(kind, fields)?;
        self.connection.send(text.as_bytes(), deadline).map_err(|error| self.station.blame(error))?;
        (self.unheard, self.sent) = (Some(Instant::now()), Some(Instant::now()));
        Ok(())
    }

    /// Lets the simulator read what was sent before anything follows: telemetry that was on its way already does not show that it has.
    pub fn keep_apart(&mut self) {
        if let Some(sent) = self.sent {
            std::thread::sleep(GAP.saturating_sub(sent.elapsed()));
        }
    }

    /// Waits for the next message, and looks at it.
    ///
    /// # Errors
    /// If the simulator is gone, nothing comes in time, or it is not a message.
    pub fn next<R>(
        &mut self,
        deadline: &Deadline,
        what: &str,
        look: impl FnOnce(&Message<'_>) -> R,
    ) -> Result<R> {
        let Self { station, connection, peer, unheard, repaired, spoken, .. } = self;
        let line = connection.line(deadline, what).map_err(|error| station.blame(error))?;
        let message = message::read(line, repaired, peer)?;
        (*unheard, *spoken) = (None, true);
        Ok(look(&message))
    }

    /// Whether the other end has said anything that is a message.
    pub fn has_spoken(&self) -> bool {
        self.spoken
    }

    /// Whether a message has come already.
    ///
    /// # Errors
    /// If the simulator is gone.
    pub fn has_message(&mut self) -> Result<bool> {
        self.connection.has_line().map_err(|error| self.station.blame(error))
    }

    /// Says goodbye.
    pub fn close(self) {
        self.connection.close(GOODBYE);
    }
}

/// A message: all values are texts, there is no line feed at the end, and no brace but its own.
fn print(kind: &str, fields: &[(&str, String)]) -> Result<String> {
    let mut text = format!("{{\"msg_type\":\"{kind}\"");
    for (name, value) in fields {
        if let Some(wrong) =
            value.chars().find(|c| !c.is_ascii() || c.is_ascii_control() || matches!(c, '{' | '}'))
        {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!("`{name}` is `{value}`, but the simulator cannot read {wrong:?}; leave it out"),
            ));
        }
        text += &format!(",\"{name}\":{}", serde_json::to_string(value)?);
    }
    text.push('}');
    match text.len() < LONGEST_SENT {
        true => Ok(text),
        false => Err(Error::of(
            ErrorKind::Configuration,
            format!(
                "the message `{kind}` would have {} bytes, and the simulator reads {LONGEST_SENT} at most; if it is a road, give it fewer \
                 waypoints",
                text.len()
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_what_both_builds_can_read() {
        let text =
            print("control", &[("steering", (-0.125).to_string()), ("throttle", "1".to_owned())]).unwrap();
        assert_eq!(text, r#"{"msg_type":"control","steering":"-0.125","throttle":"1"}"#);
        // As one build takes messages apart: behind each opening brace, whole if it ends with a closing one.
        assert!(text[1..].matches('{').count() == 0 && text.ends_with('}'));
    }

    #[test]
    fn what_neither_can_read_is_refused() {
        for wrong in ["a{b", "a}b", "å", "a\nb"] {
            let error = print("car_config", &[("car_name", wrong.to_owned())]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Configuration);
            assert!(error.message().contains("`car_name`"), "{error}");
        }
        assert!(print("car_config", &[("car_name", "\"quoted\\\"".to_owned())]).is_ok());
        let error = print("regen_road", &[("wayPoints", "1,2,3@".repeat(2000))]).unwrap_err();
        assert!(error.message().contains("fewer waypoints"), "{error}");
    }
}
