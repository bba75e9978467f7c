//! Snow as a camera in a moving vehicle sees it: flakes come from the vanishing point and sway as they fall; the nearest are out of
//! focus.

use std::f32::consts::TAU;

use pdk_ops::Random;

use crate::canvas::{Canvas, SIZE};
use crate::effect::Effect;
use crate::travel::{Space, Travel, project};

/// Seconds of the clip.
const SECONDS: f32 = 4.0;
/// What comes towards the camera: 8 m/s of the vehicle, 1.4 m/s of fall.
const TRAVEL: Travel = Travel { velocity: [0.0, 1.4, -8.0], seconds: SECONDS };
/// Seconds for which the shutter is open.
const SHUTTER: f32 = 1.0 / 120.0;
/// The radius of a flake in metres.
const RADIUS: f32 = 0.011;

struct Flake {
    at: [f32; 3],
    size: f32,
    /// How far it sways in metres, how often in a clip, and where in its sway it begins.
    sway: f32,
    sways: f32,
    swing: f32,
}

/// Falling flakes.
pub struct Snow {
    space: Space,
    flakes: Vec<Flake>,
}

impl Snow {
    pub fn new(random: &mut Random) -> Self {
        let space = Space::around(&TRAVEL, [18.0, 22.0, 32.0]);
        let flake = |random: &mut Random| Flake {
            at: space.place(random),
            size: random.uniform(0.6, 1.3) as f32,
            sway: random.uniform(0.02, 0.12) as f32,
            sways: random.between(2, 6) as f32,
            swing: random.unit() as f32,
        };
        Self { flakes: (0..3000).map(|_| flake(random)).collect(), space }
    }
}

impl Effect for Snow {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let places = self
            .flakes
            .iter()
            .flat_map(|flake| self.space.at(flake.at, &TRAVEL, time).map(move |now| (flake, now)));
        for (flake, mut now) in places {
            now[0] += flake.sway * libm::sinf(TAU * (flake.sways * time + flake.swing));
            let before = [0, 1, 2].map(|axis| now[axis] - TRAVEL.velocity[axis] * SHUTTER);
            let (Some((head, scale)), Some((tail, _))) = (project(now), project(before)) else { continue };
            let sharp = RADIUS * flake.size * scale;
            // Nearer than two metres it is out of focus.
            let blur = (6.0 * (1.0 / now[2].max(0.3) - 0.5)).clamp(0.0, 9.0);
            let radius = (sharp * sharp + blur * blur).sqrt().max(0.8);
            let spread = (sharp / radius).min(1.0);
            let alpha = 0.92 * spread.sqrt() * self.space.fade(now);
            let outside = head[0] < -40.0 || head[0] > SIZE.0 as f32 + 40.0;
            if alpha <= 0.02 || outside {
                continue;
            }
            let moved = ((head[0] - tail[0]).powi(2) + (head[1] - tail[1]).powi(2)).sqrt();
            match moved > 1.5 * radius {
                true => canvas.streak(tail, head, 1.6 * radius, [0.96, 0.97, 1.0], alpha),
                false => canvas.disc(head, radius, 0.8 + 0.9 * radius, [0.96, 0.97, 1.0], alpha),
            }
        }
    }
}
