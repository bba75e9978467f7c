//! Birds: dark silhouettes that cross the picture, beating their wings.

use std::f32::consts::TAU;

use pdk_ops::Random;

use crate::canvas::{Canvas, SIZE};
use crate::effect::{Effect, fraction};

struct Bird {
    /// Length of one wing in pixels.
    wing: f32,
    /// Height of its course, 0 at the top to 1 at the bottom, and how far it rises along it.
    height: f32,
    rise: f32,
    /// Where on its course it is at the beginning, and its direction: 1 to the right, -1 to the left.
    phase: f32,
    direction: f32,
    beats: f32,
    beat: f32,
    /// How far it is turned towards the camera, 0 to 1: the wings' share in the picture's plane.
    turn: f32,
}

/// A loose flock.
pub struct Birds {
    birds: Vec<Bird>,
}

impl Birds {
    pub fn new(random: &mut Random) -> Self {
        let bird = |i: usize, random: &mut Random| {
            let nearness = (i as f32 / 15.0) * (i as f32 / 15.0);
            Bird {
                wing: 13.0 + 40.0 * nearness,
                height: random.uniform(0.06, 0.72) as f32,
                rise: random.uniform(-0.16, 0.16) as f32,
                phase: random.unit() as f32,
                direction: if i % 5 == 4 { -1.0 } else { 1.0 },
                beats: random.between(8, 13) as f32,
                beat: random.unit() as f32,
                turn: random.uniform(0.55, 0.95) as f32,
            }
        };
        Self { birds: (0..16).map(|i| bird(i, random)).collect() }
    }
}

impl Effect for Birds {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        for bird in &self.birds {
            let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
            let course = fraction(time + bird.phase);
            let reach = 2.2 * bird.wing;
            let along = course * (width + 2.0 * reach) - reach;
            let x = if bird.direction > 0.0 { along } else { width - along };
            let beat = TAU * (bird.beats * time + bird.beat);
            // The body sinks while the wings rise.
            let bob = 0.10 * bird.wing * libm::cosf(beat);
            let y = (bird.height - bird.rise * (course - 0.5)) * height + bob;
            draw_bird(canvas, [x, y], bird, libm::sinf(beat), libm::sinf(beat - 0.9));
        }
    }
}

/// `root` and `tip` are how far up the inner and the outer half of the wings are, -1 to 1.
fn draw_bird(canvas: &mut Canvas, [x, y]: [f32; 2], bird: &Bird, root: f32, tip: f32) {
    let (size, facing) = (bird.wing, bird.direction);
    let colour = [0.07, 0.065, 0.07];
    let place = |right: f32, up: f32| [x + facing * right * size, y - up * size];
    // Beak, back, tail, belly.
    let body = curve(&[
        place(0.50, 0.06),
        place(0.36, 0.14),
        place(0.10, 0.12),
        place(-0.28, 0.05),
        place(-0.62, 0.08),
        place(-0.60, -0.04),
        place(-0.26, -0.05),
        place(0.08, -0.10),
        place(0.34, 0.00),
    ]);
    canvas.polygon(&body, colour, 1.0);
    // The near wing reaches towards the camera, which is downwards in the picture; the far one is foreshortened.
    for (side, share) in [(-1.0, bird.turn), (1.0, bird.turn * 0.8)] {
        let lift = |rise: f32, out: f32| (0.10 + 0.95 * rise) * out + side * 0.16 * out;
        let elbow = 0.45;
        let bend = [elbow * share, lift(root * 0.8 + 0.2, elbow)];
        let end = [share * (1.0 - 0.25 * (tip - root).abs()), bend[1] + lift(tip, 0.62)];
        // Wings are swept back a little, and wide where they meet the body.
        let back = |out: f32| -side * out * 0.35 - 0.16 * out;
        let wing = curve(&[
            place(0.22, 0.08),
            place(0.20 + back(bend[0]) * 0.7, 0.08 + bend[1]),
            place(-0.02 + back(end[0]), 0.06 + end[1]),
            place(-0.16 + back(end[0]) * 0.8, 0.02 + end[1] * 0.86),
            place(-0.16 + back(bend[0]) * 0.7, -0.02 + bend[1] * 0.82),
            place(-0.20, 0.00),
        ]);
        canvas.polygon(&wing, colour, 1.0);
    }
}

/// A smooth closed line through the points (Catmull and Rom's spline).
fn curve(points: &[[f32; 2]]) -> Vec<[f32; 2]> {
    const PARTS: usize = 6;
    let count = points.len();
    let mut line = Vec::with_capacity(count * PARTS);
    for i in 0..count {
        let [before, from, to, after] = [count - 1, 0, 1, 2].map(|k| points[(i + k) % count]);
        for part in 0..PARTS {
            let t = part as f32 / PARTS as f32;
            line.push([0, 1].map(|axis| {
                let (a, b, c, d) = (before[axis], from[axis], to[axis], after[axis]);
                let rise = c - a;
                let bend = 2.0 * a - 5.0 * b + 4.0 * c - d;
                let twist = 3.0 * (b - c) + d - a;
                b + 0.5 * t * (rise + t * (bend + t * twist))
            }));
        }
    }
    line
}
