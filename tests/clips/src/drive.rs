//! What falls before a vehicle that drives: the camera, and drops or flakes on their way past it.
//!
//! Everything is in metres, seen from the camera: to the right, down, ahead. The air comes towards the camera as fast as the
//! vehicle drives, so that all paths lead away from the vanishing point.

use pdk_seed::Random;

use crate::canvas::SIZE;

/// Height of the horizon in all clips, from the top.
pub const HORIZON: f32 = 0.45;
/// The speed of the vehicle for which the clips are drawn, in metres a second.
pub const SPEED: f32 = 10.0;
/// Pixels that an angle with tangent 1 takes: the width is an angle of 75 degrees.
pub const FOCAL: f32 = 0.652 * SIZE.0 as f32;
/// Radius in pixels of the disc that a point one metre away becomes, since the camera looks into the distance.
const DEFOCUS: f32 = 0.7;
/// Nothing is nearer than this.
const NEAREST: f32 = 0.25;

/// Something on its way past the camera, by where it is in the picture at some moment.
pub struct Passing {
    /// When, as a share of the clip.
    moment: f32,
    /// Where it is then.
    place: [f32; 3],
    /// Metres a second to the right and down.
    velocity: [f32; 2],
}

/// It at one time: from where to where it is seen while the shutter is open, in pixels, how far away it is, and how far out of focus.
pub struct Seen {
    pub ends: [[f32; 2]; 2],
    pub distance: f32,
    pub blur: f32,
}

impl Passing {
    /// It is somewhere in the picture at some moment, between these distances; `near` above 1 makes small ones more frequent.
    pub fn new([low, high]: [f32; 2], near: f32, velocity: [f32; 2], random: &mut Random) -> Self {
        let mut draw = |low: f32, high: f32| random.uniform(f64::from(low), f64::from(high)) as f32;
        let moment = draw(0.0, 1.0);
        let distance = low + (high - low) * libm::powf(draw(0.0, 1.0), near);
        let (right, down) =
            (draw(-0.55, 0.55) * SIZE.0 as f32, (draw(-0.05, 1.05) - HORIZON) * SIZE.1 as f32);
        Self { moment, place: [right * distance / FOCAL, down * distance / FOCAL, distance], velocity }
    }

    /// It at a time of a clip that lasts this many seconds, if it is before the camera and no further away than `far`.
    pub fn seen(&self, time: f32, seconds: f32, shutter: f32, far: f32) -> Option<Seen> {
        // The clip comes round, so the nearest of all its moments counts.
        let passed = (time - self.moment + 0.5).rem_euclid(1.0) - 0.5;
        let [from, to] = [passed * seconds - shutter, passed * seconds].map(|after| {
            let [right, down, ahead] = self.place;
            [right + self.velocity[0] * after, down + self.velocity[1] * after, ahead - SPEED * after]
        });
        if to[2] < NEAREST || from[2] > far {
            return None;
        }
        let pixel = |[right, down, ahead]: [f32; 3]| {
            [0.5 * SIZE.0 as f32 + FOCAL * right / ahead, HORIZON * SIZE.1 as f32 + FOCAL * down / ahead]
        };
        Some(Seen { ends: [pixel(from), pixel(to)], distance: to[2], blur: DEFOCUS / to[2] })
    }
}
