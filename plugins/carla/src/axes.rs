//! From our axes to CARLA's, and back.

use rmpv::Value;

use crate::value::{array, vector};

/// Where an actor is, in CARLA's axes: metres and degrees.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Transform {
    /// x ahead, y to the right, z up.
    pub location: [f64; 3],
    /// Pitch up, yaw clockwise, roll.
    pub rotation: [f64; 3],
}

impl Transform {
    /// At our position `[x, height, z]`, with our heading in radians.
    pub fn at([x, height, z]: [f64; 3], heading: f64) -> Self {
        Self { location: [z, x, height], rotation: [0.0, heading.to_degrees(), 0.0] }
    }

    /// As CARLA writes it.
    pub fn value(&self) -> Value {
        array([vector(self.location), vector(self.rotation)])
    }
}

/// Our position from a location.
pub fn position([x, y, z]: [f64; 3]) -> [f64; 3] {
    [y, z, x]
}

/// Our heading from a yaw, from -π to π.
pub fn heading(yaw: f64) -> f64 {
    let turn = 2.0 * std::f64::consts::PI;
    let heading = yaw.to_radians();
    heading - turn * (heading / turn).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same() {
        let transform = Transform::at([3.0, 0.5, 40.0], 0.25);
        assert_eq!(transform.location, [40.0, 3.0, 0.5]);
        assert_eq!(position(transform.location), [3.0, 0.5, 40.0]);
        assert!((heading(transform.rotation[1]) - 0.25).abs() < 1e-12);
        // A right turn has a positive yaw in both.
        assert!((heading(-270.0) - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
