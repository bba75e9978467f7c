//! What of a drive decides all that follows, besides the scenario and the number of the frame: as numbers, so that a drive can be put back.

use std::f64::consts::PI;

use pdk_sdk::prelude::*;

use crate::delay::Delay;
use crate::vehicle::Vehicle;

/// The one that begins anew after a turn.
const HEADING: &str = "heading (rad)";

/// What is saved of every drive, with the changes that show: those of position and heading move the picture by about a pixel.
const NUMBERS: [(&str, f64); 8] = [
    ("x of the rear axle (m)", 0.05),
    ("z of the rear axle (m)", 0.05),
    (HEADING, 0.005),
    ("speed (m/s)", 0.1),
    ("angle of the front wheels (rad)", 0.005),
    // These follow from the others, and from the frames before.
    ("place along the road (m)", 0.0),
    ("farthest place along the road (m)", 0.0),
    ("touched another vehicle (0 or 1)", 0.0),
];

/// The change of a control that is on its way.
const CONTROL: f64 = 0.01;

/// What is saved of a drive, besides controls that are on their way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Saved {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// About where it is along the road, in metres.
    pub along: f64,
    /// The farthest place reached, in metres along the road.
    pub farthest: f64,
    /// Whether the vehicle touched another one on the way to where it is.
    pub collided: bool,
}

impl Saved {
    /// The names of the numbers, and the changes that show.
    pub fn numbers(delay: &Delay) -> Vec<SavedNumber> {
        let number = |(name, step): (&str, f64)| {
            let period = if name == HEADING { 2.0 * PI } else { 0.0 };
            SavedNumber { name: name.to_owned(), step, period }
        };
        let controls = (1..=delay.waiting().count()).flat_map(|before| {
            ["steering", "throttle"].map(|name| SavedNumber {
                name: format!("{name} {before} before it takes effect"),
                step: CONTROL,
                period: 0.0,
            })
        });
        NUMBERS.into_iter().map(number).chain(controls).collect()
    }

    /// Writes the numbers.
    ///
    /// # Errors
    /// If there is room for more or for fewer.
    pub fn write(&self, delay: &Delay, into: &mut [f64]) -> Result<()> {
        check_count(delay, into.len())?;
        let [x, z, heading, speed, angle] = self.vehicle.numbers();
        let own = [x, z, heading, speed, angle, self.along, self.farthest, f64::from(self.collided)];
        let controls = delay.waiting().flat_map(|control| control.numbers());
        into.iter_mut().zip(own.into_iter().chain(controls)).for_each(|(into, number)| *into = number);
        Ok(())
    }

    /// Reads the numbers, and puts the controls on their way.
    ///
    /// # Errors
    /// If there are more or fewer, or one is not finite.
    pub fn read(delay: &mut Delay, numbers: &[f64]) -> Result<Self> {
        check_count(delay, numbers.len())?;
        if let Some(place) = numbers.iter().position(|number| !number.is_finite()) {
            return Err(Error::new(format!(
                "number {} of those that it is put back to is {}, but they have to be finite",
                place + 1,
                numbers[place]
            )));
        }
        let (own, controls) = numbers.split_at(NUMBERS.len());
        delay.put(controls.chunks_exact(2).map(|pair| Control { steering: pair[0], throttle: pair[1] }));
        let mut vehicle = [0.0; 5];
        vehicle.copy_from_slice(&own[..5]);
        Ok(Self {
            vehicle: Vehicle::of_numbers(vehicle),
            along: own[5],
            farthest: own[6],
            collided: own[7] != 0.0,
        })
    }
}

fn check_count(delay: &Delay, count: usize) -> Result<()> {
    let expected = NUMBERS.len() + 2 * delay.waiting().count();
    match count == expected {
        true => Ok(()),
        false => Err(Error::new(format!("{count} numbers were given, but it saves {expected}"))),
    }
}
