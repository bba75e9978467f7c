//! Other vehicles on a scenario's road: one ahead to follow, and some that come the other way.
//!
//! Where a vehicle is follows from the time alone, so that frames can be computed in any order and no step of the
//! simulation adds to another's rounding.

use std::f64::consts::PI;

use pdk_seed::Random;

use crate::LANE_WIDTH;

/// The component of the key from which the other vehicles are drawn, for `pdk_sdk::seed::key` with instance 0: the same scenario meets
/// the same ones in every simulator.
pub const KEY: &str = "lane traffic";
/// Width, height and length of a vehicle in metres; the ego vehicle has the same.
pub const SIZE: [f64; 3] = [1.8, 1.45, 4.4];
/// The vehicle ahead goes faster and slower by this share of its speed, once in this many seconds.
const SWING: f64 = 0.3;
const PERIOD: f64 = 14.0;
/// Speed of oncoming vehicles in metres per second.
pub const ONCOMING_SPEED: f64 = 9.0;
/// Oncoming vehicles are seen this far beyond both ends of the road, in metres.
const BEYOND: f64 = 80.0;
/// Oncoming vehicles come for as long as a drive lasts, but at least and at most for this many seconds.
const SHORTEST: f64 = 120.0;
const LONGEST: f64 = 3_600.0;
/// A vehicle farther ahead than this counts as none, in metres.
const SENSED: f64 = 150.0;

/// Where the vehicles of a scenario are, and when.
#[derive(Debug, Default)]
pub struct Traffic {
    ahead: Option<Ahead>,
    /// By their places.
    oncoming: Vec<Oncoming>,
}

#[derive(Debug)]
struct Ahead {
    /// Place of its rear along the road at the start, in metres.
    start: f64,
    speed: f64,
    phase: f64,
    tint: [f32; 3],
}

#[derive(Debug)]
struct Oncoming {
    /// Place of its front along the road at the start, in metres.
    start: f64,
    tint: [f32; 3],
}

/// A vehicle at one moment, as the ego vehicle's camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Place of its nearer end along the road in metres.
    pub along: f64,
    /// Distance to the right of the driven lane's centre in metres.
    pub lateral: f64,
    /// What its paint is multiplied with.
    pub tint: [f32; 3],
    /// Whether it comes towards the camera.
    pub oncoming: bool,
}

/// What a scenario wants.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Free distance to the vehicle ahead at the start in metres; 0 for none.
    pub gap: f64,
    /// Its mean speed in metres per second.
    pub speed: f64,
    /// Oncoming vehicles a kilometre.
    pub oncoming: f64,
}

impl Traffic {
    /// The vehicles on a road of this many metres; the ego vehicle's front is `front` metres along it. Oncoming ones come for two
    /// minutes.
    pub fn new(wanted: Wanted, length: f64, front: f64, random: &mut Random) -> Self {
        Self::lasting(wanted, length, front, SHORTEST, random)
    }

    /// As [`Traffic::new`], with oncoming vehicles for a drive of this many seconds, an hour at most. In a longer drive the first
    /// ones are the same.
    pub fn lasting(wanted: Wanted, length: f64, front: f64, seconds: f64, random: &mut Random) -> Self {
        const PAINTS: [[f32; 3]; 6] = [
            [0.95, 0.95, 0.97],
            [0.28, 0.29, 0.32],
            [0.72, 0.13, 0.12],
            [0.16, 0.27, 0.55],
            [0.6, 0.62, 0.64],
            [0.2, 0.4, 0.28],
        ];
        let paint = |random: &mut Random| PAINTS[random.below(PAINTS.len() as u32) as usize];
        let tint = paint(random);
        let phase = random.uniform(0.0, 2.0 * PI);
        let (start, speed) = (front + wanted.gap, wanted.speed);
        let ahead = (wanted.gap > 0.0).then_some(Ahead { start, speed, phase, tint });
        let mut traffic = Self { ahead, oncoming: Vec::new() };
        if wanted.oncoming > 0.0 {
            let spacing = 1000.0 / wanted.oncoming;
            let seconds = if seconds > SHORTEST { seconds.min(LONGEST) } else { SHORTEST };
            // As many as can meet the ego vehicle in that time.
            let mut along = random.unit() * spacing;
            while along < length + BEYOND + seconds * ONCOMING_SPEED {
                traffic.oncoming.push(Oncoming { start: along, tint: paint(random) });
                // Never on top of each other.
                along += (spacing * random.uniform(0.4, 1.6)).max(3.0 * SIZE[2]);
            }
        }
        traffic
    }

    /// All vehicles, always in the same order, wherever they are.
    pub fn all(&self, time: f64) -> impl Iterator<Item = Seen> + '_ {
        self.between(time, f64::NEG_INFINITY, f64::INFINITY)
    }

    /// The vehicles whose nearer end lies in a part of the road, always in the same order.
    fn between(&self, time: f64, from: f64, to: f64) -> impl Iterator<Item = Seen> + '_ {
        let ahead = self.ahead.iter().map(move |ahead| Seen {
            along: ahead.rear(time),
            lateral: 0.0,
            tint: ahead.tint,
            oncoming: false,
        });
        let ahead = ahead.filter(move |seen| (from..to).contains(&seen.along));
        let place = move |vehicle: &Oncoming| vehicle.start - ONCOMING_SPEED * time;
        // In a long drive most of the many vehicles are far away.
        let [first, last] =
            [from, to].map(|end| self.oncoming.partition_point(|vehicle| place(vehicle) < end));
        let oncoming = self.oncoming[first..last.max(first)].iter().map(move |vehicle| Seen {
            along: place(vehicle),
            lateral: -LANE_WIDTH,
            tint: vehicle.tint,
            oncoming: true,
        });
        ahead.chain(oncoming)
    }

    /// All vehicles between the ends of a road of this many metres, and a little beyond.
    pub fn seen(&self, time: f64, length: f64) -> impl Iterator<Item = Seen> + '_ {
        self.between(time, -BEYOND, length + BEYOND)
    }

    /// The number of vehicles.
    pub fn count(&self) -> usize {
        self.oncoming.len() + usize::from(self.ahead.is_some())
    }

    /// Free distance from the ego vehicle's front to the vehicle ahead in metres; infinite if none is in reach, or if the ego
    /// vehicle has passed it.
    pub fn free_distance(&self, time: f64, front: f64) -> f64 {
        self.ahead
            .as_ref()
            .map(|ahead| ahead.rear(time) - front)
            // Beside each other they are as close as can be, until the rear of one has passed the front of the other.
            .filter(|gap| (-2.0 * SIZE[2]..SENSED).contains(gap))
            .map_or(f64::INFINITY, |gap| gap.max(0.0))
    }

    /// Whether the ego vehicle, with its centre at that place, touches another one. Vehicles count as boxes along the road.
    pub fn collides(&self, time: f64, along: f64, lateral: f64) -> bool {
        self.between(time, along - 2.0 * SIZE[2], along + SIZE[2]).any(|seen| {
            // The nearer end is the rear of one and the front of the other: both reach from there to greater distances.
            let middle = seen.along + SIZE[2] / 2.0;
            (middle - along).abs() < SIZE[2] && (seen.lateral - lateral).abs() < SIZE[0]
        })
    }
}

impl Ahead {
    /// Place of its rear along the road: the integral of a speed that swings.
    fn rear(&self, time: f64) -> f64 {
        let turns = 2.0 * PI / PERIOD;
        let swing = SWING / turns * (libm::cos(self.phase) - libm::cos(turns * time + self.phase));
        self.start + self.speed * (time + swing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_seed::Key;

    fn traffic(gap: f64, oncoming: f64) -> Traffic {
        let wanted = Wanted { gap, speed: 6.0, oncoming };
        Traffic::new(wanted, 175.0, 2.2, &mut Key([3; 32]).sequence())
    }

    #[test]
    fn the_vehicle_ahead_keeps_going_at_a_swinging_speed() {
        let traffic = traffic(20.0, 0.0);
        assert!((traffic.free_distance(0.0, 2.2) - 20.0).abs() < 1e-9);
        let ahead = traffic.ahead.as_ref().unwrap();
        let speeds: Vec<f64> = (0..300)
            .map(|i| (ahead.rear((i + 1) as f64 * 0.1) - ahead.rear(i as f64 * 0.1)) * 10.0)
            .collect();
        let (slowest, fastest) = speeds.iter().fold((9e9f64, 0.0f64), |(s, f), &v| (s.min(v), f.max(v)));
        assert!((slowest - 4.2).abs() < 0.05 && (fastest - 7.8).abs() < 0.05, "{slowest} {fastest}");
        assert_eq!(traffic.free_distance(0.0, -200.0), f64::INFINITY);
    }

    #[test]
    fn vehicles_collide_where_they_touch() {
        let traffic = traffic(20.0, 20.0);
        // The vehicle ahead reaches from 22.2 m on; the ego vehicle from its centre 2.2 m to the front.
        assert!(!traffic.collides(0.0, 19.9, 0.0) && traffic.collides(0.0, 20.1, 0.0));
        assert!(!traffic.collides(0.0, 20.1, 1.9));
        let oncoming = traffic.seen(0.0, 175.0).find(|seen| seen.oncoming && seen.along > 60.0).unwrap();
        assert!(traffic.collides(0.0, oncoming.along, -3.0) && !traffic.collides(0.0, oncoming.along, -1.9));
        let later = traffic.seen(1.0, 175.0).any(|seen| (seen.along - oncoming.along + 9.0).abs() < 1e-9);
        assert!(later && traffic.count() > 10);
    }

    #[test]
    fn oncoming_vehicles_come_as_long_as_a_drive_lasts() {
        let wanted = Wanted { gap: 0.0, speed: 6.0, oncoming: 20.0 };
        let lasting =
            |seconds: f64| Traffic::lasting(wanted, 175.0, 2.2, seconds, &mut Key([3; 32]).sequence());
        let (short, long) = (traffic(0.0, 20.0), lasting(900.0));
        for time in [0.0, 119.0, 300.0, 899.0] {
            assert!(long.seen(time, 175.0).next().is_some(), "{time}");
        }
        let places = |traffic: &Traffic| traffic.all(7.0).map(|seen| seen.along).collect::<Vec<_>>();
        assert!(places(&long).starts_with(&places(&short)) && long.count() > short.count());
        // Those in view are found without a look at the others.
        for time in [0.0, 33.3, 600.0] {
            let seen: Vec<f64> = long.seen(time, 175.0).map(|seen| seen.along).collect();
            let all = long.all(time).map(|seen| seen.along);
            assert_eq!(
                seen,
                all.filter(|along| (-BEYOND..175.0 + BEYOND).contains(along)).collect::<Vec<_>>()
            );
        }
        assert_eq!(lasting(f64::INFINITY).count(), lasting(3_600.0).count());
        assert_eq!(lasting(f64::NAN).count(), short.count());
    }

    #[test]
    fn a_vehicle_that_has_been_passed_is_not_ahead() {
        let traffic = traffic(20.0, 0.0);
        // Its rear is 22.2 m along the road, and its front 26.6 m.
        assert_eq!(traffic.free_distance(0.0, 22.3), 0.0);
        assert_eq!(traffic.free_distance(0.0, 26.6 + SIZE[2] - 0.1), 0.0);
        assert_eq!(traffic.free_distance(0.0, 26.6 + SIZE[2] + 0.1), f64::INFINITY);
    }

    #[test]
    fn without_vehicles_the_road_is_free() {
        let traffic = Traffic::default();
        assert_eq!(traffic.free_distance(3.0, 0.0), f64::INFINITY);
        assert!(!traffic.collides(3.0, 0.0, 0.0) && traffic.seen(3.0, 175.0).next().is_none());
    }
}
