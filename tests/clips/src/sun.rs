//! Glare of a low sun: the disc, bloom around it, rays, and the ghosts that a lens adds.

use std::f32::consts::TAU;

use pdk_seed::Random;

use crate::canvas::{Canvas, Colour, SIZE, smooth};
use crate::drive::HORIZON;
use crate::effect::Effect;

const WARM: Colour = [1.0, 0.95, 0.83];

/// A ray: its direction in turns, its width and strength, and how it flickers.
struct Ray {
    direction: f32,
    width: f32,
    strength: f32,
    flickers: f32,
    phase: f32,
}

/// Glare that trembles with the car and flickers with the air.
pub struct Sun {
    rays: Vec<Ray>,
}

impl Sun {
    pub fn new(random: &mut Random) -> Self {
        let ray = |i: usize, random: &mut Random| Ray {
            direction: (i as f32 + random.uniform(-0.3, 0.3) as f32) / 14.0,
            width: random.uniform(0.010, 0.028) as f32,
            strength: random.uniform(0.35, 1.0) as f32,
            flickers: random.between(1, 4) as f32,
            phase: random.unit() as f32,
        };
        Self { rays: (0..14).map(|i| ray(i, random)).collect() }
    }
}

impl Effect for Sun {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
        let turn = TAU * time;
        let centre = [
            width * (0.60 + 0.012 * libm::sinf(turn) + 0.004 * libm::sinf(3.0 * turn)),
            height * (HORIZON - 0.12 + 0.006 * libm::cosf(2.0 * turn)),
        ];
        let power = 1.0 + 0.05 * libm::sinf(2.0 * turn) + 0.03 * libm::sinf(5.0 * turn + 1.0);
        canvas.shade([0.0, 0.0, width, height], |x, y| {
            let (dx, dy) = (x - centre[0], y - centre[1]);
            let distance = (dx * dx + dy * dy).sqrt();
            let bloom =
                1.1 * libm::expf(-distance / (38.0 * power)) + 0.45 * libm::expf(-distance / (150.0 * power));
            let direction = libm::atan2f(dy, dx) / TAU;
            let mut rays = 0.0;
            for ray in &self.rays {
                let mut off = (direction - ray.direction).rem_euclid(1.0);
                off = off.min(1.0 - off) / ray.width;
                let flicker = 0.75 + 0.25 * libm::sinf(ray.flickers * turn + TAU * ray.phase);
                rays += ray.strength * flicker * libm::expf(-off * off);
            }
            let rays = 0.3 * rays * libm::expf(-distance / 110.0) * smooth(8.0, 40.0, distance);
            let disc = smooth(24.0, 12.0, distance);
            let clear = (1.0 - bloom.min(1.0)) * (1.0 - rays.min(1.0)) * (1.0 - disc);
            let alpha = (1.0 - clear) * 0.97;
            // White in the middle, warmer outside.
            let white = smooth(110.0, 10.0, distance);
            (WARM.map(|value| value + (1.0 - value) * white), alpha)
        });
        // Reflections between the lenses lie on the line through the middle of the picture.
        for (place, radius, colour, alpha) in [
            (-0.45, 30.0, [1.0, 0.78, 0.58], 0.11),
            (-0.85, 13.0, [0.76, 0.70, 1.0], 0.13),
            (-1.25, 44.0, [1.0, 0.72, 0.70], 0.08),
        ] {
            let at = [
                width / 2.0 + (centre[0] - width / 2.0) * place * 1.6,
                height / 2.0 + (centre[1] - height / 2.0) * place * 1.6,
            ];
            canvas.disc(at, radius, 6.0, colour, alpha * power);
            canvas.disc(at, radius * 0.8, radius * 0.7, colour, alpha * 0.5);
        }
    }
}
