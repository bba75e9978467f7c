//! The light of a scene: where it comes from and what it does to colours.

use std::f64::consts::PI;

use pdk_sdk::prelude::Random;

/// The lights to choose from, as the parameter `light` names them.
pub const NAMES: [&str; 4] = ["day", "dusk", "overcast", "night"];

/// One kind of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Colour of the sky overhead.
    pub zenith: [f32; 3],
    /// Colour of the air at the horizon, which also lies over everything far away.
    pub haze: [f32; 3],
    /// Colour of the clouds, and how much of the sky they can cover.
    pub cloud: [f32; 3],
    /// Added to the texture that the clouds are made of: more means more of them.
    pub cloudiness: f32,
    /// Colour of the far and the near hills.
    pub hills: [[f32; 3]; 2],
    /// What the colours of the ground and of objects are multiplied with.
    pub ambient: [f32; 3],
    /// Opacity of shadows.
    pub shadow: f32,
    /// Distance over which the air takes 63 % of a colour, in metres.
    pub visibility: f64,
    /// What the vehicle's headlights add to the factor in `ambient` where they shine brightest.
    pub headlights: f32,
    /// How much of the headlights' light upright things throw back.
    pub lit_by_headlights: f32,
    /// Whether other vehicles have their lights on.
    pub lamps: bool,
    /// The sun, where it shows: colour of its glow, its extent in radians, and the range of elevations in degrees.
    pub sun: Option<Glow>,
}

/// The brightness around the sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Added to the sky next to the sun.
    pub colour: [f32; 3],
    /// Where the glow has fallen to half, as an angle in radians.
    pub extent: f32,
    /// Lowest and highest elevation of the sun in degrees.
    elevations: (f64, f64),
}

/// Where the sun stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Direction in radians, clockwise from +z.
    pub heading: f64,
    /// Tangent of the elevation above the horizon.
    pub elevation: f64,
}

impl Light {
    /// The light of a name in [`NAMES`]; daylight for any other.
    pub fn named(name: &str) -> Self {
        match name {
            "dusk" => Self::DUSK,
            "overcast" => Self::OVERCAST,
            "night" => Self::NIGHT,
            _ => Self::DAY,
        }
    }

    /// Clear day: blue sky, fair-weather clouds, dark shadows.
    const DAY: Self = Self {
        zenith: [72.0, 128.0, 200.0],
        haze: [204.0, 219.0, 228.0],
        cloud: [244.0, 246.0, 248.0],
        cloudiness: 0.05,
        hills: [[138.0, 163.0, 184.0], [108.0, 140.0, 124.0]],
        ambient: [1.0, 1.0, 1.0],
        shadow: 0.55,
        visibility: 700.0,
        headlights: 0.0,
        lit_by_headlights: 0.0,
        lamps: false,
        sun: Some(Glow { colour: [150.0, 135.0, 100.0], extent: 0.035, elevations: (9.0, 40.0) }),
    };

    /// After sunset: a warm horizon under a dark sky, the ground lit by the sky and the headlights.
    const DUSK: Self = Self {
        zenith: [44.0, 54.0, 98.0],
        haze: [206.0, 142.0, 108.0],
        cloud: [150.0, 98.0, 108.0],
        cloudiness: 0.1,
        hills: [[84.0, 76.0, 100.0], [48.0, 50.0, 58.0]],
        ambient: [0.4, 0.37, 0.43],
        shadow: 0.0,
        visibility: 800.0,
        headlights: 0.42,
        lit_by_headlights: 0.0,
        lamps: true,
        sun: Some(Glow { colour: [90.0, 56.0, 16.0], extent: 0.32, elevations: (-3.0, 1.0) }),
    };

    /// Full cloud cover: grey sky, no shadows, less contrast far away.
    const OVERCAST: Self = Self {
        zenith: [142.0, 150.0, 160.0],
        haze: [188.0, 194.0, 200.0],
        cloud: [112.0, 118.0, 128.0],
        cloudiness: 0.35,
        hills: [[152.0, 162.0, 170.0], [116.0, 128.0, 126.0]],
        ambient: [0.74, 0.77, 0.82],
        shadow: 0.22,
        visibility: 330.0,
        headlights: 0.0,
        lit_by_headlights: 0.0,
        lamps: false,
        sun: None,
    };

    /// Without a moon: what is seen is what headlights reach, and what shines by itself.
    const NIGHT: Self = Self {
        zenith: [6.0, 8.0, 15.0],
        haze: [20.0, 20.0, 25.0],
        cloud: [17.0, 17.0, 21.0],
        cloudiness: 0.1,
        hills: [[13.0, 13.0, 17.0], [9.0, 9.0, 11.0]],
        ambient: [0.07, 0.072, 0.085],
        shadow: 0.0,
        visibility: 500.0,
        headlights: 1.0,
        lit_by_headlights: 0.8,
        lamps: true,
        sun: None,
    };

    /// The vehicle's headlights so far ahead: their light where they shine brightest, and half the width of their beam in metres.
    pub fn beam(&self, ahead: f32) -> (f32, f32) {
        // Brightest some metres ahead, then fading.
        let reach = 1.0 / (1.0 + (ahead / 16.0) * (ahead / 16.0));
        let rise = (ahead / 4.0).clamp(0.0, 1.0);
        (self.headlights * reach * rise, 1.6 + 0.28 * ahead)
    }

    /// The headlights' light on what stands upright at a place.
    pub fn on_things(&self, right: f32, ahead: f32) -> f32 {
        let (strength, half_width) = self.beam(ahead);
        let side = right / half_width;
        strength * self.lit_by_headlights * (1.0 - side * side).max(0.0)
    }

    /// Draws where the sun stands, where it shows.
    pub fn place_sun(&self, random: &mut Random) -> Option<Sun> {
        let heading = random.uniform(-PI, PI);
        let share = random.unit();
        self.sun.map(|Glow { elevations: (low, high), .. }| {
            let degrees = low + (high - low) * share;
            Sun { heading, elevation: libm::tan(degrees * PI / 180.0) }
        })
    }
}
