//! The state of the world at one frame, as the server sends it to every client.

use crate::axes;

/// What comes before the actors.
const BEFORE: usize = 36;
/// The length of an actor.
const ACTOR: usize = 119;
/// The least and the most that a message may have in bytes: no actors, or a hundred thousand.
pub const SIZES: (usize, usize) =
    (crate::stream::HEADER + BEFORE, crate::stream::HEADER + BEFORE + 100_000 * ACTOR);

/// An actor as it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Position in our axes: x, height, z in metres.
    pub position: [f64; 3],
    /// Heading in radians, as ours.
    pub heading: f64,
    /// Velocity in CARLA's axes in metres per second.
    pub velocity: [f64; 3],
}

impl Motion {
    /// How fast it is.
    pub fn speed(&self) -> f64 {
        let [x, y, z] = self.velocity;
        (x * x + y * y + z * z).sqrt()
    }
}

fn float(bytes: &[u8], at: usize) -> f64 {
    let mut number = [0; 4];
    number.copy_from_slice(&bytes[at..at + 4]);
    f32::from_le_bytes(number).into()
}

fn vector(bytes: &[u8], at: usize) -> [f64; 3] {
    [0, 4, 8].map(|offset| float(bytes, at + offset))
}

/// The ids of all actors in the body of a message.
pub fn actors(body: &[u8]) -> impl Iterator<Item = (u32, &[u8])> {
    let records = body.get(BEFORE..).unwrap_or_default().chunks_exact(ACTOR);
    records.map(|record| {
        let mut id = [0; 4];
        id.copy_from_slice(&record[..4]);
        (u32::from_le_bytes(id), record)
    })
}

/// How an actor moves; none if it is not there.
pub fn motion(body: &[u8], actor: u32) -> Option<Motion> {
    let (_, record) = actors(body).find(|(id, _)| *id == actor)?;
    let [_, yaw, _] = vector(record, 17);
    Some(Motion {
        position: axes::position(vector(record, 5)),
        heading: axes::heading(yaw),
        velocity: vector(record, 29),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_actor_is_found_with_what_it_does() {
        let mut body = vec![0; BEFORE];
        for id in [24u32, 25] {
            let mut record = vec![0; ACTOR];
            record[..4].copy_from_slice(&id.to_le_bytes());
            let numbers = [10.0, -2.0, 0.5, 0.0, 90.0, 0.0, 3.0, 4.0, 0.0f32]
                .map(|n| n + (f64::from(id) - 25.0) as f32);
            for (i, number) in numbers.into_iter().enumerate() {
                record[5 + 4 * i..9 + 4 * i].copy_from_slice(&number.to_le_bytes());
            }
            body.extend(record);
        }
        let motion = motion(&body, 25).unwrap();
        assert_eq!((motion.position, motion.speed()), ([-2.0, 0.5, 10.0], 5.0));
        assert!((motion.heading - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!(super::motion(&body, 26), None);
        assert_eq!(actors(&body).map(|(id, _)| id).collect::<Vec<_>>(), [24, 25]);
        assert_eq!(actors(&body[..20]).count(), 0);
    }
}
