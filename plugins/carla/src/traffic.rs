//! Other vehicles: where they are follows from the time alone, as in the embedded simulator, so that a scenario is the same each time.
//! CARLA's own traffic is driven by its client library, and differs from run to run.

use pdk_road::traffic::{self, Seen, Traffic, Wanted};
use pdk_road::{Path, Point};
use pdk_sdk::prelude::{Error, Result};

use crate::axes::Transform;
use crate::blueprint::{Blueprints, ROLE};
use crate::ground::Lane;
use crate::server::Server;

/// Where vehicles wait that are not on the road, in our axes: far behind its beginning.
const WAITING: [f64; 3] = [0.0, 0.0, -2000.0];
/// The distance between those that wait, in metres.
const APART: f64 = 10.0;
/// Vehicles are on the road from this many metres before its beginning to as many behind its end.
const BEYOND: f64 = 12.0;

/// The other vehicles of a scenario.
#[derive(Debug)]
pub struct Fleet {
    wanted: Wanted,
    seed: u64,
    /// None until the length of a vehicle is known.
    traffic: Traffic,
    /// From the middle of a vehicle to its ends in metres.
    half_length: f64,
    path: Path,
    /// Distance along the path and height of each waypoint.
    heights: Vec<(f64, f64)>,
    vehicles: Vec<u32>,
    /// Whether each of them waits.
    waiting: Vec<bool>,
}

impl Fleet {
    /// The vehicles that are wanted on a lane; none is there yet.
    ///
    /// # Errors
    /// If oncoming vehicles are wanted on a lane of a map, whose other lane is not known.
    pub fn new(wanted: Wanted, lane: &Lane, seed: u64) -> Result<Self> {
        if wanted.oncoming > 0.0 && !lane.has_opposite {
            return Err(Error::new(
                "oncoming vehicles need a road of the scenario's own; set `oncoming` to 0 for a lane of a map",
            ));
        }
        let points: Vec<Point> = lane.waypoints.iter().map(|&[x, _, z]| [x, z]).collect();
        let path = Path::through(&points, 0.25);
        let heights =
            path.places(points).into_iter().zip(lane.waypoints.iter().map(|point| point[1])).collect();
        Ok(Self {
            wanted,
            seed,
            traffic: Traffic::default(),
            half_length: 0.0,
            path,
            heights,
            vehicles: Vec::new(),
            waiting: Vec::new(),
        })
    }

    /// Lays out where they are. The middle of the ego vehicle and of each of them is `half_length` metres from its ends.
    fn lay_out(&mut self, half_length: f64) {
        let mut random = pdk_sdk::seed::key(self.seed, traffic::KEY, 0).sequence();
        self.traffic = Traffic::new(self.wanted, self.path.length(), half_length, &mut random);
        self.half_length = half_length;
    }

    /// Spawns them. They are of the same kind as the ego vehicle, whose middle is `half_length` metres from its ends.
    ///
    /// # Errors
    /// If the server refuses to.
    pub fn spawn(
        &mut self,
        server: &mut Server,
        kinds: &Blueprints,
        kind: &str,
        half_length: f64,
    ) -> Result<()> {
        self.lay_out(half_length);
        for (number, seen) in self.traffic.all(0.0).enumerate() {
            let color = seen.tint.map(|part| (part * 255.0).round().clamp(0.0, 255.0).to_string()).join(",");
            let described = kinds.describe(kind, &[("role_name", ROLE.to_owned()), ("color", color)])?;
            let vehicle = server.spawn(described, waiting(number))?;
            let vehicle = server.id_of(&vehicle)?;
            // They are put where they belong, and neither fall nor roll.
            server.set_physics(vehicle, false)?;
            self.vehicles.push(vehicle);
        }
        self.waiting = vec![true; self.vehicles.len()];
        Ok(())
    }

    /// Puts them where they are at a time of the scenario.
    ///
    /// # Errors
    /// If the server refuses to.
    pub fn place(&mut self, server: &mut Server, time: f64) -> Result<()> {
        let mut moves = Vec::with_capacity(self.vehicles.len());
        for (number, seen) in self.traffic.all(time).enumerate() {
            let middle = self.middle(&seen);
            let away = !(-BEYOND..self.path.length() + BEYOND).contains(&middle);
            if away && self.waiting[number] {
                continue;
            }
            self.waiting[number] = away;
            let at = if away { waiting(number) } else { self.at(middle, seen.lateral, seen.oncoming) };
            moves.push((self.vehicles[number], at));
        }
        server.place(&moves)
    }

    /// Free distance to the vehicle ahead in metres, from a front that is so far along the road.
    pub fn free_distance(&self, time: f64, front: f64) -> f64 {
        self.traffic.free_distance(time, front)
    }

    /// The place of a vehicle's middle along the road, from that of its nearer end.
    fn middle(&self, seen: &Seen) -> f64 {
        seen.along + self.half_length
    }

    fn at(&self, along: f64, lateral: f64, oncoming: bool) -> Transform {
        let [x, z] = self.path.beside(along, lateral);
        let [dx, dz] = self.path.direction(self.path.segment_at(along));
        let heading = libm::atan2(dx, dz) + if oncoming { std::f64::consts::PI } else { 0.0 };
        let after =
            self.heights.partition_point(|(place, _)| *place <= along).clamp(1, self.heights.len() - 1);
        let ((a, low), (b, high)) = (self.heights[after - 1], self.heights[after]);
        let share = ((along - a) / (b - a).max(1e-9)).clamp(0.0, 1.0);
        Transform::at([x, low + (high - low) * share, z], heading)
    }
}

fn waiting(number: usize) -> Transform {
    let [x, height, z] = WAITING;
    Transform::at([x, height, z - APART * number as f64], 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vehicles_stand_on_the_road_and_oncoming_ones_face_the_other_way() {
        let lane = Lane::own(&[[0.0, 0.0, 0.0], [0.0, 4.0, 100.0], [0.0, 4.0, 200.0]]);
        let wanted = Wanted { gap: 20.0, speed: 6.0, oncoming: 10.0 };
        let mut fleet = Fleet::new(wanted, &lane, 1).unwrap();
        // As long as a van.
        fleet.lay_out(2.9);
        let ahead = fleet.at(50.0, 0.0, false);
        assert!(
            (ahead.location[0] - 50.0).abs() < 0.1 && (ahead.location[2] - 2.0).abs() < 0.05,
            "{ahead:?}"
        );
        let oncoming = fleet.at(150.0, -4.0, true);
        assert!((oncoming.location[1] + 4.0).abs() < 1e-6 && (oncoming.rotation[1] - 180.0).abs() < 1e-6);
        assert_eq!(oncoming.location[2], 4.0);
        assert!((fleet.free_distance(0.0, 2.9) - 20.0).abs() < 1e-9);
        // Between the front of one and the rear of the other.
        let middle = fleet.middle(&fleet.traffic.all(0.0).next().unwrap());
        assert!((middle - 2.9 - 2.9 - 20.0).abs() < 1e-9, "{middle}");
        let error = Fleet::new(wanted, &Lane { has_opposite: false, ..lane }, 1).unwrap_err();
        assert_eq!(error.kind(), pdk_sdk::prelude::ErrorKind::Failed);
    }
}
