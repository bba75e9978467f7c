//! What a user can set about scenarios in BeamNG.tech.

use pdk_adapter::Mount;
use pdk_sdk::prelude::*;

use crate::scenery::Materials;

/// The game takes at least this many steps a second.
const STEPS: f64 = 60.0;

/// What a user has set about scenarios.
#[derive(Debug, Clone)]
pub struct Options {
    /// The camera on the vehicle.
    pub mount: Mount,
    /// The level on whose ground the road is drawn.
    pub level: String,
    /// The height of that ground in metres.
    pub ground: f64,
    /// What the road is drawn with.
    pub materials: Materials,
    /// What is driven.
    pub vehicle: String,
    /// How much damage is a collision, in the game's own number.
    pub collision_damage: f64,
    /// The version of the protocol.
    pub protocol: String,
}

impl Options {
    /// Adds what a user can set.
    pub fn describe(description: Description) -> Description {
        Mount::describe(description, 0.5, 1.5)
            .parameter(Parameter::text(
                "level",
                "the level on whose ground the road is drawn; left out, smallgrid",
            ))
            .parameter(
                Parameter::number("ground", 0.0, "height of that ground")
                    .range(-10_000.0, 10_000.0)
                    .unit("m"),
            )
            .parameter(Parameter::text(
                "road_material",
                "what the road is drawn with; left out, a_asphalt_01_a",
            ))
            .parameter(Parameter::text(
                "edge_material",
                "what its edge lines are drawn with; left out, line_white",
            ))
            .parameter(Parameter::text(
                "middle_material",
                "what its middle line is drawn with; left out, line_dashed_short",
            ))
            .parameter(Parameter::text("vehicle", "what is driven, by BeamNG's name; left out, etk800"))
            .parameter(
                Parameter::number(
                    "collision_damage",
                    100.0,
                    "how much the vehicle's damage, in BeamNG's own number, has to grow after the start to be a collision",
                )
                .range(0.0, 1e9),
            )
            .parameter(Parameter::text(
                "protocol",
                "version of the protocol, which has to be the game's; left out, v1.27",
            ))
    }

    /// What a user has set.
    pub fn read(config: &Config) -> Self {
        let named = |name: &str, usual: &str| match config.text(name) {
            "" => usual.to_owned(),
            given => given.to_owned(),
        };
        Self {
            mount: Mount::read(config),
            level: named("level", "smallgrid"),
            ground: config.number("ground"),
            materials: Materials {
                road: named("road_material", "a_asphalt_01_a"),
                edge: named("edge_material", "line_white"),
                middle: named("middle_material", "line_dashed_short"),
            },
            vehicle: named("vehicle", "etk800"),
            collision_damage: config.number("collision_damage"),
            protocol: named("protocol", "v1.27"),
        }
    }

    /// How the game is stepped.
    pub fn pace(&self) -> Pace {
        Pace::of(self.mount.camera.rate)
    }
}

/// How the game is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    /// Steps from one frame to the next.
    pub steps: u32,
    /// Steps a second of simulation time, of which the game takes a whole number.
    pub per_second: u32,
}

impl Pace {
    /// That for about this many frames a second.
    fn of(rate: f64) -> Self {
        let steps = (STEPS / rate).ceil().max(1.0);
        Self { steps: steps as u32, per_second: (steps * rate).round() as u32 }
    }

    /// The simulation time of a frame in seconds, from its number: it never drifts.
    pub fn time(self, frame: u64) -> f64 {
        frame as f64 * f64::from(self.steps) / f64::from(self.per_second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_frame_is_that_of_its_steps() {
        assert_eq!(Pace::of(20.0), Pace { steps: 3, per_second: 60 });
        for frame in 0..1000 {
            assert_eq!(Pace::of(20.0).time(frame), frame as f64 / 20.0);
        }
        // The game takes 90 steps a second for 89.91.
        let pace = Pace::of(29.97);
        assert_eq!(pace, Pace { steps: 3, per_second: 90 });
        assert_eq!(pace.time(30_000), 1000.0);
        assert_eq!(Pace::of(144.0), Pace { steps: 1, per_second: 144 });
    }
}
