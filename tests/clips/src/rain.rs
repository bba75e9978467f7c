//! Rain as a camera in a moving vehicle sees it: drops fall while the vehicle drives into them, so their streaks lead away from the
//! vanishing point, and the nearer they are, the faster.

use pdk_ops::Random;

use crate::canvas::{Canvas, SIZE};
use crate::effect::Effect;
use crate::travel::{Space, Travel, project};

/// Seconds of the clip.
const SECONDS: f32 = 3.0;
/// What comes towards the camera: 10 m/s of the vehicle, 8 m/s of fall.
const TRAVEL: Travel = Travel { velocity: [0.0, 8.0, -10.0], seconds: SECONDS };
/// Seconds for which the shutter is open.
const SHUTTER: f32 = 1.0 / 50.0;
/// The width of a drop in metres.
const WIDTH: f32 = 0.005;

struct Drop {
    at: [f32; 3],
    strength: f32,
}

/// Falling drops.
pub struct Rain {
    space: Space,
    drops: Vec<Drop>,
}

impl Rain {
    pub fn new(random: &mut Random) -> Self {
        let space = Space::around(&TRAVEL, [20.0, 24.0, 30.0]);
        let drop = |random: &mut Random| Drop {
            at: space.place(random),
            strength: random.uniform(0.55, 1.0) as f32,
        };
        Self { drops: (0..9000).map(|_| drop(random)).collect(), space }
    }
}

impl Effect for Rain {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let places = self
            .drops
            .iter()
            .flat_map(|drop| self.space.at(drop.at, &TRAVEL, time).map(move |now| (drop, now)));
        for (drop, now) in places {
            let before = [0, 1, 2].map(|axis| now[axis] - TRAVEL.velocity[axis] * SHUTTER);
            let (Some((head, scale)), Some((tail, _))) = (project(now), project(before)) else { continue };
            let width = (WIDTH * scale).max(0.9);
            // What is thinner than the line that is drawn is fainter instead; what appears and what is far fades.
            let alpha = (WIDTH * scale / width).min(1.0).sqrt() * drop.strength * self.space.fade(now);
            if alpha > 0.02 && head[0].max(tail[0]) > -40.0 && head[0].min(tail[0]) < SIZE.0 as f32 + 40.0 {
                canvas.streak(tail, head, width, [0.86, 0.89, 0.93], 0.75 * alpha);
            }
        }
    }
}
