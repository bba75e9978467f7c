//! Rain before a vehicle that drives: each drop is drawn out by the time that the shutter is open, the near ones long, wide and
//! out of focus, the far ones a fine texture.

use pdk_seed::Random;

use crate::canvas::Canvas;
use crate::drive::Passing;
use crate::effect::Effect;

/// Length of the clip in seconds.
pub const SECONDS: f32 = 3.0;
/// How long the shutter is open, in seconds.
const SHUTTER: f32 = 1.0 / 45.0;
/// Drops further away are the haze of rain.
const FAR: f32 = 11.0;
/// Diameter of a drop in pixels one metre away.
const DIAMETER: f32 = 2.4;

struct Drop {
    way: Passing,
    strength: f32,
}

/// Falling drops.
pub struct Rain {
    drops: Vec<Drop>,
}

impl Rain {
    pub fn new(random: &mut Random) -> Self {
        let mut drops = Vec::new();
        for (count, distances) in [(300, [0.45, 1.2]), (1500, [1.2, 4.0]), (900, [4.0, 9.0])] {
            for _ in 0..count {
                let strength = random.uniform(0.55, 1.0) as f32;
                // Large drops fall faster; the wind takes them all alike.
                let velocity = [-0.9, random.uniform(6.0, 8.5) as f32];
                drops.push(Drop { way: Passing::new(distances, 1.0, velocity, random), strength });
            }
        }
        Self { drops }
    }
}

impl Effect for Rain {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        for drop in &self.drops {
            let Some(seen) = drop.way.seen(time, SECONDS, SHUTTER, FAR) else { continue };
            let width = DIAMETER / seen.distance + 2.0 * seen.blur;
            // No line is thinner than what a video can show; it is paler instead.
            let shown = width.max(2.4);
            let alpha =
                drop.strength * if seen.distance < 1.2 { 0.75 } else { 0.95 * (width / shown).sqrt() };
            canvas.streak(seen.ends[0], seen.ends[1], shown, [0.86, 0.89, 0.92], alpha);
        }
    }
}
