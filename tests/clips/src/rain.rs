//! Rain: drops at all distances, each drawn out by the time that the shutter is open.

use pdk_ops::Random;

use crate::canvas::{Canvas, SIZE};
use crate::effect::{Effect, fraction};

struct Drop {
    /// 0 far away, 1 close to the camera.
    nearness: f32,
    /// Where in its fall it is at the beginning.
    phase: f32,
    /// Where each of its falls in a clip begins, from left to right; wind takes them all alike.
    columns: Vec<f32>,
    strength: f32,
}

/// Falling drops.
pub struct Rain {
    drops: Vec<Drop>,
}

impl Rain {
    pub fn new(random: &mut Random) -> Self {
        let drop = |nearness: f32, random: &mut Random| {
            // Near drops cross the picture faster. Every one falls a whole number of times in a clip.
            let falls = (4.0 + 8.0 * nearness).round() as usize;
            Drop {
                nearness,
                phase: random.unit() as f32,
                columns: (0..falls).map(|_| random.uniform(-0.05, 1.25) as f32).collect(),
                strength: random.uniform(0.6, 1.0) as f32,
            }
        };
        let mut drops = Vec::new();
        for (count, low, high) in [(420, 0.0, 0.25), (170, 0.25, 0.6), (46, 0.6, 1.0)] {
            for _ in 0..count {
                let nearness = random.uniform(low, high) as f32;
                drops.push(drop(nearness, random));
            }
        }
        Self { drops }
    }
}

impl Effect for Rain {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
        for drop in &self.drops {
            let falls = drop.columns.len();
            let place = time * falls as f32 + drop.phase;
            let column = drop.columns[place as usize % falls];
            let length = 26.0 + 92.0 * drop.nearness;
            let y = fraction(place) * (height + length) - length;
            // Wind: to the left by a sixth of the fall.
            let x = column * width - y / 6.0;
            let thickness = 1.7 + 2.3 * drop.nearness;
            let alpha = (0.55 + 0.25 * drop.nearness) * drop.strength;
            canvas.streak([x, y], [x - length / 6.0, y + length], thickness, [0.86, 0.89, 0.93], alpha);
        }
    }
}
