//! Vehicles that stand beside the road, half on its shoulder.

use pdk_road::LANE_WIDTH;
use pdk_road::traffic::{SIZE, Seen};
use pdk_sdk::prelude::Random;

/// From the middle of a lane to that of a vehicle parked beside it, in metres: between the two is room for a door.
const ASIDE: f64 = 3.75;
/// No vehicle is parked before this distance along the road, in metres.
const FIRST: f64 = 30.0;
/// What their paint is multiplied with.
const PAINTS: [[f32; 3]; 5] =
    [[0.86, 0.87, 0.88], [0.24, 0.25, 0.27], [0.52, 0.54, 0.56], [0.42, 0.12, 0.1], [0.18, 0.26, 0.4]];

/// All that are parked along a road.
#[derive(Debug, Default)]
pub struct Parked {
    vehicles: Vec<Seen>,
}

impl Parked {
    /// This many vehicles a kilometre along a road of `length` metres.
    pub fn new(per_kilometre: f64, length: f64, random: &mut Random) -> Self {
        let mut vehicles = Vec::new();
        if per_kilometre > 0.0 {
            let spacing = 1000.0 / per_kilometre;
            let mut along = FIRST + random.unit() * spacing;
            while along < length {
                let left = random.below(3) == 0;
                let lateral = if left { -LANE_WIDTH - ASIDE } else { ASIDE } + random.uniform(-0.1, 0.25);
                let tint = PAINTS[random.below(PAINTS.len() as u32) as usize];
                vehicles.push(Seen { along, lateral, tint, oncoming: left });
                along += (spacing * random.uniform(0.4, 1.6)).max(2.0 * SIZE[2]);
            }
        }
        Self { vehicles }
    }

    /// All of them, always in the same order.
    pub fn all(&self) -> &[Seen] {
        &self.vehicles
    }

    /// Whether the ego vehicle, with its centre at that place, touches one of them.
    pub fn touches(&self, along: f64, lateral: f64) -> bool {
        self.vehicles.iter().any(|seen| {
            let middle = seen.along + SIZE[2] / 2.0;
            (middle - along).abs() < SIZE[2] && (seen.lateral - lateral).abs() < SIZE[0]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::Key;

    #[test]
    fn they_stand_beside_the_lanes_and_are_touched_only_there() {
        let parked = Parked::new(20.0, 2000.0, &mut Key([4; 32]).sequence());
        assert!((30..50).contains(&parked.all().len()), "{}", parked.all().len());
        assert!(
            parked.all().iter().any(|seen| seen.oncoming) && parked.all().iter().any(|seen| !seen.oncoming)
        );
        for seen in parked.all() {
            let middle = seen.along + SIZE[2] / 2.0;
            // Who keeps to the lane passes, who leaves it does not.
            let side = if seen.oncoming { -LANE_WIDTH } else { 0.0 };
            assert!(!parked.touches(middle, side) && parked.touches(middle, seen.lateral));
        }
        assert!(Parked::new(0.0, 2000.0, &mut Key([4; 32]).sequence()).all().is_empty());
    }
}
