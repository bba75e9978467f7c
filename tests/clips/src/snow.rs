//! Snow: soft flakes at all distances that sway as they fall; the nearest are out of focus.

use std::f32::consts::TAU;

use pdk_ops::Random;

use crate::canvas::{Canvas, SIZE};
use crate::effect::{Effect, fraction};

struct Flake {
    nearness: f32,
    phase: f32,
    columns: Vec<f32>,
    /// How far it sways, in pixels, how often in a clip, and where in its sway it begins.
    sway: f32,
    sways: f32,
    swing: f32,
}

/// Falling flakes.
pub struct Snow {
    flakes: Vec<Flake>,
}

impl Snow {
    pub fn new(random: &mut Random) -> Self {
        let mut flakes = Vec::new();
        for (count, low, high) in [(520, 0.0, 0.3), (240, 0.3, 0.7), (44, 0.7, 1.0)] {
            for _ in 0..count {
                let nearness = random.uniform(low, high) as f32;
                let falls = if nearness < 0.3 {
                    1
                } else if nearness < 0.7 {
                    2
                } else {
                    3
                };
                flakes.push(Flake {
                    nearness,
                    phase: random.unit() as f32,
                    columns: (0..falls).map(|_| random.uniform(-0.05, 1.05) as f32).collect(),
                    sway: random.uniform(4.0, 14.0) as f32 * (0.5 + nearness),
                    sways: random.between(1, 3) as f32,
                    swing: random.unit() as f32,
                });
            }
        }
        Self { flakes }
    }
}

impl Effect for Snow {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
        for flake in &self.flakes {
            let falls = flake.columns.len();
            let place = time * falls as f32 + flake.phase;
            let column = flake.columns[place as usize % falls];
            let radius = 1.1
                + 2.6 * flake.nearness
                + if flake.nearness > 0.7 { 10.0 * (flake.nearness - 0.7) } else { 0.0 };
            let soft = 1.2 + radius * 0.9;
            let reach = radius + soft;
            let y = fraction(place) * (height + 2.0 * reach) - reach;
            let x = column * width + flake.sway * libm::sinf(TAU * (flake.sways * time + flake.swing));
            let alpha = if flake.nearness > 0.7 { 0.75 } else { 0.92 };
            canvas.disc([x, y], radius, soft, [0.96, 0.97, 1.0], alpha);
        }
    }
}
