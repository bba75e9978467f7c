//! Lightning: strikes at uneven intervals, each a branching bolt of its own that lights the sky for some frames.

use pdk_seed::Random;

use crate::canvas::{Canvas, SIZE};
use crate::drive::HORIZON;
use crate::effect::{Effect, LIGHTNING_FRAMES};

/// How bright a strike is in the frames after it begins; it strikes a second time through the same channel.
const GLOW: [f32; 9] = [1.0, 0.72, 0.38, 0.86, 0.60, 0.34, 0.18, 0.09, 0.04];
/// Strikes in the clip; each has a part of the clip for itself.
const STRIKES: usize = 15;
const PART: usize = LIGHTNING_FRAMES / STRIKES;

/// A line of a bolt, and how strong it is.
struct Branch {
    points: Vec<[f32; 2]>,
    strength: f32,
}

/// The frame in which a strike begins, and its bolt.
struct Strike {
    begin: usize,
    bolt: Vec<Branch>,
}

/// All strikes.
pub struct Lightning {
    strikes: Vec<Strike>,
}

impl Lightning {
    pub fn new(random: &mut Random) -> Self {
        let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
        let strike = |number: usize| {
            // Not in the first frame, so that the clip begins as it ends: dark.
            let begin = number * PART + 1 + random.below((PART - GLOW.len() - 1) as u32) as usize;
            // Everywhere, and one after the other in different places.
            let place = (number * 5 % STRIKES) as f32;
            let across = 0.12 + 0.76 * (place + random.unit() as f32) / STRIKES as f32;
            let mut random_at = |low: f64, high: f64| random.uniform(low, high) as f32;
            let from = [width * across, -10.0];
            let to = [width * across + random_at(-90.0, 90.0), height * (HORIZON - random_at(0.0, 0.07))];
            let mut bolt = Vec::new();
            grow(&mut bolt, from, to, 1.0, random);
            Strike { begin, bolt }
        };
        Self { strikes: (0..STRIKES).map(strike).collect() }
    }
}

/// Adds a branch from one point to another, and its own branches.
fn grow(bolt: &mut Vec<Branch>, from: [f32; 2], to: [f32; 2], strength: f32, random: &mut Random) {
    let mut points = vec![from, to];
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let length = (dx * dx + dy * dy).sqrt();
    // Halving again and again, with the middle moved aside each time, makes a jagged line.
    let mut aside = length * 0.16;
    while aside > 1.5 {
        let mut finer = Vec::with_capacity(points.len() * 2);
        for ends in points.windows(2) {
            let shift = random.uniform(-1.0, 1.0) as f32 * aside;
            let middle = [0, 1].map(|axis| (ends[0][axis] + ends[1][axis]) / 2.0);
            finer.push(ends[0]);
            finer.push([middle[0] + shift * dy / length, middle[1] - shift * dx / length]);
        }
        finer.push(to);
        points = finer;
        aside *= 0.52;
    }
    if strength > 0.25 {
        let branches = if strength == 1.0 { 6 } else { 2 };
        for _ in 0..branches {
            let start =
                points[random.between((points.len() / 8) as i32, (points.len() * 3 / 4) as i32) as usize];
            let reach = length * random.uniform(0.14, 0.34) as f32;
            let side = random.uniform(0.35, 0.95) as f32 * if random.below(2) == 0 { 1.0 } else { -1.0 };
            let (sine, cosine) = (libm::sinf(side), libm::cosf(side));
            let direction = [(dx * cosine - dy * sine) / length, (dx * sine + dy * cosine) / length];
            let end = [start[0] + direction[0] * reach, start[1] + direction[1] * reach];
            grow(bolt, start, end, strength * 0.45, random);
        }
    }
    bolt.push(Branch { points, strength });
}

impl Effect for Lightning {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let frame = (time * LIGHTNING_FRAMES as f32).round() as usize;
        for Strike { begin, bolt } in &self.strikes {
            let Some(&glow) = frame.checked_sub(*begin).and_then(|age| GLOW.get(age)) else { continue };
            let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
            let top = bolt.last().map_or(0.0, |trunk| trunk.points[0][0]);
            canvas.shade([0.0, 0.0, width, height], |x, y| {
                let (dx, dy) = ((x - top) / width, y / height);
                let near = libm::expf(-(dx * dx * 2.0 + dy * dy) * 1.6);
                ([0.86, 0.89, 1.0], glow * (0.10 + 0.38 * near))
            });
            for branch in bolt {
                let strength = branch.strength;
                canvas.path(
                    &branch.points,
                    2.0,
                    26.0 * strength + 4.0,
                    [0.82, 0.85, 1.0],
                    0.55 * glow * strength.sqrt(),
                );
            }
            for branch in bolt {
                let strength = branch.strength;
                canvas.path(
                    &branch.points,
                    0.5 + 1.3 * strength,
                    1.6,
                    [1.0, 1.0, 1.0],
                    (1.3 * glow * strength.sqrt()).min(1.0),
                );
            }
        }
    }
}
