//! Snow before a vehicle that drives: flakes of many sizes come from the vanishing point, drawn out by the time that the shutter
//! is open; the nearest are out of focus.

use std::f32::consts::TAU;

use pdk_seed::Random;

use crate::canvas::Canvas;
use crate::drive::Passing;
use crate::effect::Effect;

/// Length of the clip in seconds.
pub const SECONDS: f32 = 4.0;
/// How long the shutter is open, in seconds.
const SHUTTER: f32 = 1.0 / 100.0;
/// Flakes further away are the haze of snow.
const FAR: f32 = 17.0;

struct Flake {
    way: Passing,
    /// Diameter in pixels one metre away.
    size: f32,
    /// How far it sways in metres, how often in a clip, and where in its sway it begins.
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
        for (count, distances) in [(380, [0.5, 2.0]), (1500, [2.0, 6.0]), (1000, [6.0, 15.0])] {
            for _ in 0..count {
                let velocity = [-0.6, random.uniform(0.9, 1.7) as f32];
                let way = Passing::new(distances, 1.0, velocity, random);
                // Most are small.
                let large = random.unit() as f32;
                flakes.push(Flake {
                    way,
                    size: 7.0 + 11.0 * large * large * large,
                    sway: random.uniform(0.01, 0.05) as f32,
                    sways: random.between(3, 9) as f32,
                    swing: random.unit() as f32,
                });
            }
        }
        Self { flakes }
    }
}

impl Effect for Snow {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        for flake in &self.flakes {
            let Some(seen) = flake.way.seen(time, SECONDS, SHUTTER, FAR) else { continue };
            let sway =
                flake.sway * libm::sinf(TAU * (flake.sways * time + flake.swing)) * crate::drive::FOCAL;
            let [from, to] = seen.ends.map(|[x, y]| [x + sway / seen.distance, y]);
            let width = flake.size / seen.distance + 2.0 * seen.blur;
            let shown = width.max(3.0);
            // What moves over more than its width is spread thin, and so is what is out of focus.
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let length = (dx * dx + dy * dy).sqrt();
            let sharp = flake.size / seen.distance / width;
            let spread = (shown / (shown + length)).sqrt();
            let fade = (1.0 - (seen.distance - 12.0).max(0.0) / (FAR - 12.0)).clamp(0.0, 1.0);
            let alpha = fade * spread * sharp.sqrt() * (width / shown).min(1.0).sqrt();
            canvas.trail(from, to, shown, [0.95, 0.96, 0.98], (1.3 * alpha).min(0.97));
        }
    }
}
