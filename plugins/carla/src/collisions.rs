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
use crate::value::{element, number};

/// The longest message about a collision in bytes.
const LONGEST: usize = 1 << 20;
/// A stream is followed by another one after so long.
const RENEWAL: Duration = Duration::from_secs(4);
/// The other one is given so long to reach the server.
const OVERLAP: Duration = Duration::from_secs(1);
/// What the wheels may touch.
const GROUND: [&str; 4] = ["static.road", "static.roadline", "static.ground", "static.terrain"];
/// What carries no label, such as the ground of a road of one's own, and of some maps.
const UNLABELLED: &str = "static.unknown";

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
    /// If it cannot be had.
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

    /// Subscribes again, if it is time for that.
    ///
    /// # Errors
    /// If the stream cannot be had again.
    pub fn renew(&mut self, station: &mut Station, deadline: &Deadline) -> Result<()> {
        if self.next.is_none() && self.since.elapsed() > RENEWAL {
            self.next = Some(open(station, self.token, deadline)?);
        }
        Ok(())
    }

    /// Whether the vehicle has hit something since this was asked last.
    ///
    /// # Errors
    /// If a stream ends, or brings something else.
    pub fn look(&mut self, deadline: &Deadline) -> Result<bool> {
        let mut collided = false;
        for stream in std::iter::once(&mut self.stream).chain(&mut self.next) {
            while let Some((_, body)) = stream.next_there(deadline)? {
                let event = rmpv::decode::read_value(&mut &body[..]).unwrap_or(Value::Nil);
                collided |= is_collision(&event);
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

/// Whether a contact is one with something else than the ground: what has no label is the ground where it pushes up or down more than
/// aside. What cannot be read is a collision.
fn is_collision(event: &Value) -> bool {
    let other = Actor(element(event, 1));
    let kind = other.kind();
    let push = [0, 1, 2].map(|axis| number(element(element(event, 2), axis)));
    match push {
        [Some(x), Some(y), Some(z)] if kind == UNLABELLED => z.abs() <= libm::hypot(x, y),
        _ => !GROUND.contains(&kind),
    }
}

fn open(station: &mut Station, token: Token, deadline: &Deadline) -> Result<Stream> {
    Stream::subscribe(station, token, "a collision", (HEADER, LONGEST), deadline)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::array;

    #[test]
    fn what_pushes_from_below_is_the_ground_where_it_has_no_label() {
        let contact = |kind: &str, push: [f64; 3]| {
            let other = array([7.into(), 0.into(), array([7.into(), kind.into()])]);
            is_collision(&array([Value::Nil, other, array(push.map(Value::F64))]))
        };
        let (below, aside) = ([10.0, 5.0, 400.0], [300.0, 0.0, 50.0]);
        assert!(!contact("static.road", aside) && !contact(UNLABELLED, below));
        assert!(contact(UNLABELLED, aside) && contact("vehicle.tesla.model3", below));
        assert!(contact("static.building", aside) && contact("", below));
        assert!(is_collision(&Value::Nil) && is_collision(&array([Value::Nil])));
    }
}
