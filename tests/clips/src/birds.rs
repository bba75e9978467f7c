//! Birds: dark silhouettes that cross the picture, beating their wings.

use std::f32::consts::TAU;

use pdk_seed::Random;

use crate::canvas::{Canvas, SIZE};
use crate::drive::HORIZON;
use crate::effect::{Effect, fraction};

/// How long the shutter is open, as a share of the clip: a 90th of a second.
const SHUTTER: f32 = 1.0 / 360.0;

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
            let nearness = (i as f32 / 21.0) * (i as f32 / 21.0);
            let wing = 9.0 + 33.0 * nearness;
            // Its wings reach below its body; they too keep above the horizon.
            let lowest = HORIZON - 0.02 - 1.2 * wing / SIZE.1 as f32;
            let rise = random.uniform(-0.05, 0.05) as f32;
            let height = random.uniform(0.0, f64::from(lowest)) as f32;
            // Most are near the horizon, where what is far away is seen.
            let height =
                if i.is_multiple_of(4) { height } else { height.max(lowest - (lowest - height) * 0.55) };
            Bird {
                wing,
                height: height.min(lowest - rise.abs() / 2.0),
                rise,
                phase: random.unit() as f32,
                direction: if i % 5 == 4 { -1.0 } else { 1.0 },
                beats: random.between(8, 13) as f32,
                beat: random.unit() as f32,
                turn: random.uniform(0.55, 0.95) as f32,
            }
        };
        Self { birds: (0..22).map(|i| bird(i, random)).collect() }
    }
}

impl Effect for Birds {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        // The wings move while the shutter is open.
        let moments = [-1.0, -0.5, 0.0].map(|share| {
            let mut sharp = Canvas::new();
            self.draw_sharply(time + share * SHUTTER, &mut sharp);
            sharp
        });
        canvas.mean(&moments);
    }
}

impl Birds {
    fn draw_sharply(&self, time: f32, canvas: &mut Canvas) {
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

/// Draws a bird that flies past and a little towards the camera. `root` and `tip` are how far up the inner and the outer
/// half of its wings are, -1 to 1.
fn draw_bird(canvas: &mut Canvas, [x, y]: [f32; 2], bird: &Bird, root: f32, tip: f32) {
    let (size, facing) = (bird.wing, bird.direction);
    // Air before them makes the far ones paler.
    let pale = 0.16 * (20.0 / (size + 10.0)).min(1.0);
    let colour = [0.08 + pale, 0.075 + pale, 0.07 + 1.1 * pale];
    let place = |right: f32, up: f32| [x + facing * right * size, y - up * size];
    // Beak, head, back, tail, belly.
    let body = curve(&[
        place(0.40, 0.00),
        place(0.31, 0.065),
        place(0.20, 0.07),
        place(-0.08, 0.065),
        place(-0.42, 0.05),
        place(-0.44, -0.02),
        place(-0.14, -0.07),
        place(0.16, -0.06),
        place(0.31, -0.035),
    ]);
    canvas.polygon(&body, colour, 1.0);
    let inner = 0.22 + 0.62 * root;
    let outer = 0.35 * inner - 0.28 + 0.85 * tip;
    for (side, share) in [(1.0, bird.turn), (-1.0, 1.45 - bird.turn)] {
        let step =
            |length: f32, angle: f32| [side * share * length * libm::cosf(angle), length * libm::sinf(angle)];
        let (arm, hand) = (step(0.46, inner), step(0.60, outer));
        let elbow = [arm[0] + 0.05, arm[1]];
        let end = [elbow[0] + hand[0] - 0.10, elbow[1] + hand[1]];
        let along = |share: f32| [0, 1].map(|axis| elbow[axis] + (end[axis] - elbow[axis]) * share);
        // The rear edge lies below the front edge, and a little behind; the hand narrows to a point.
        let below = |at: [f32; 2], [right, up]: [f32; 2], width: f32| {
            let length = (right * right + up * up).sqrt().max(1e-3);
            let across = [side * up / length, -side * right / length];
            place(at[0] + (0.75 * across[0] - 0.3) * width, at[1] + (0.75 * across[1] - 0.12) * width)
        };
        let bend = [arm[0] + hand[0], arm[1] + hand[1]];
        let wing = curve(&[
            place(0.14, 0.03),
            place(elbow[0] + 0.03, elbow[1] + 0.02),
            place(along(0.55)[0] + 0.02, along(0.55)[1] + 0.02),
            place(end[0], end[1]),
            below(along(0.72), hand, 0.13),
            below(along(0.30), hand, 0.21),
            below(elbow, bend, 0.25),
            below([0.05, 0.02], arm, 0.26),
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
