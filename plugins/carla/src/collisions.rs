//! What the vehicle hits.
//!
//! The server closes a stream over which it has sent nothing for 10 s, and a vehicle that hits nothing has nothing to send. So the stream is
//! subscribed to again before that, while the old one is still listened to: no collision falls in between.

use std::time::{Duration, Instant};

use pdk_adapter::{Deadline, Station};
use pdk_sdk::prelude::Result;
use rmpv::Value;

use crate::blueprint::Actor;
use crate::stream::{HEADER, Stream, Token};
use crate::value::element;

/// The longest message about a collision in bytes.
const LONGEST: usize = 1 << 20;
/// A stream is followed by another one after so long.
const RENEWAL: Duration = Duration::from_secs(4);
/// The other one is given so long to reach the server.
const OVERLAP: Duration = Duration::from_secs(1);
/// What the wheels may touch.
const GROUND: [&str; 5] =
    ["static.road", "static.roadline", "static.ground", "static.terrain", "static.unknown"];

/// The streams of a collision sensor.
#[derive(Debug)]
pub struct Collisions {
    token: Token,
    stream: Stream,
    since: Instant,
    /// The one that follows.
    next: Option<Stream>,
}

impl Collisions {
    /// Subscribes to the stream of a collision sensor.
    ///
    /// # Errors
    /// Where it cannot be had.
    pub fn subscribe(station: &mut Station, token: Token, deadline: &Deadline) -> Result<Self> {
        let stream = open(station, token, deadline)?;
        Ok(Self { token, stream, since: Instant::now(), next: None })
    }

    /// Its stream.
    pub fn token(&self) -> Token {
        self.token
    }

    /// Whether it is listened to without a gap.
    pub fn is_open(&mut self) -> bool {
        self.stream.is_open()
    }

    /// Subscribes again, where it is time for that.
    ///
    /// # Errors
    /// Where the stream cannot be had again.
    pub fn renew(&mut self, station: &mut Station, deadline: &Deadline) -> Result<()> {
        if self.next.is_none() && self.since.elapsed() > RENEWAL {
            self.next = Some(open(station, self.token, deadline)?);
        }
        Ok(())
    }

    /// Whether the vehicle has hit something since this was asked last.
    ///
    /// # Errors
    /// Where a stream ends, or brings something else.
    pub fn look(&mut self, deadline: &Deadline) -> Result<bool> {
        let mut collided = false;
        for stream in std::iter::once(&mut self.stream).chain(&mut self.next) {
            while let Some((_, body)) = stream.next_there(deadline)? {
                let event = rmpv::decode::read_value(&mut &body[..]).unwrap_or(Value::Nil);
                // What cannot be read is still a collision.
                collided |= !GROUND.contains(&Actor(element(&event, 1)).kind());
            }
        }
        if self.since.elapsed() > RENEWAL + OVERLAP
            && let Some(next) = self.next.take()
        {
            self.stream = next;
            self.since = Instant::now();
        }
        Ok(collided)
    }
}

fn open(station: &mut Station, token: Token, deadline: &Deadline) -> Result<Stream> {
    Stream::subscribe(station, token, "a collision", (HEADER, LONGEST), deadline)
}
