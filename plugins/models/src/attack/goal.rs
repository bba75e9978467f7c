//! Where an attack wants the network to steer.

use pdk_sdk::prelude::*;

/// Where an attack wants the network to steer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// As far from the steering at the frame as it is, on whichever side is further.
    Away,
    /// To this side: -1 is left, 1 is right.
    Side(f64),
    /// To this number.
    Target(f64),
}

/// Adds the parameters that say what the goal is.
pub fn parameters(description: Description) -> Description {
    description
        .parameter(Parameter::choice(
            "goal",
            &["away", "left", "right", "target"],
            "where the network is to steer: away from what it gives for the frame as it is, on whichever side that is further; left; right; or to \
             `target`",
        ))
        .parameter(
            Parameter::number("target", 0.0, "the steering that the network is to give, from -1 for left to 1 for right")
                .range(-1.0, 1.0)
                .only_for("goal", "target"),
        )
}

impl Goal {
    /// As the parameters say.
    pub fn of(config: &Config) -> Self {
        match config.text("goal") {
            "left" => Self::Side(-1.0),
            "right" => Self::Side(1.0),
            "target" => Self::Target(config.number("target")),
            _ => Self::Away,
        }
    }

    /// The sides that are tried from a steering, by their signs.
    pub fn sides(self, steering: f64) -> Vec<f64> {
        match self {
            Self::Away => vec![1.0, -1.0],
            Self::Side(side) => vec![side],
            Self::Target(target) => vec![if target < steering { -1.0 } else { 1.0 }],
        }
    }

    /// The side to go on to from a steering.
    pub fn side(self, side: f64, steering: f64) -> f64 {
        match self {
            Self::Target(target) if target < steering => -1.0,
            Self::Target(_) => 1.0,
            _ => side,
        }
    }

    /// How well a steering serves, where the frame as it is gives `before`: more is better.
    pub fn score(self, steering: f64, before: f64) -> f64 {
        match self {
            Self::Away => (steering - before).abs(),
            Self::Side(side) => side * steering,
            Self::Target(target) => -(steering - target).abs(),
        }
    }
}
