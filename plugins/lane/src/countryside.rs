//! Pictures of plants as cameras see them: ragged, full of light and dark, and of signs. Drawn once, when a simulator is made.

use pdk_sdk::prelude::Random;

use crate::sprite::Sprite;

/// Random values on a square lattice that repeats, interpolated: cheap enough to be asked for every part of a picture.
struct Lattice {
    values: Vec<f32>,
}

impl Lattice {
    const SIZE: usize = 64;

    fn new(random: &mut Random) -> Self {
        Self { values: (0..Self::SIZE * Self::SIZE).map(|_| random.uniform(-1.0, 1.0) as f32).collect() }
    }

    /// The value at a place in lattice steps.
    fn at(&self, x: f32, y: f32) -> f32 {
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let cell = |v: f32| (v.floor() as i32).rem_euclid(Self::SIZE as i32) as usize;
        let (left, top) = (cell(x), cell(y));
        let (right, bottom) = ((left + 1) % Self::SIZE, (top + 1) % Self::SIZE);
        let value = |x: usize, y: usize| self.values[y * Self::SIZE + x];
        let upper = value(left, top) + (value(right, top) - value(left, top)) * fx;
        let lower = value(left, bottom) + (value(right, bottom) - value(left, bottom)) * fx;
        upper + (lower - upper) * fy
    }

    /// Several sizes at once: clumps, twigs and leaves.
    fn foliage(&self, x: f32, y: f32) -> [f32; 3] {
        [self.at(x * 3.0, y * 3.0), self.at(x * 9.0 + 17.0, y * 9.0), self.at(x * 30.0, y * 30.0 + 31.0)]
    }
}

/// Broad-leaved trees, each another one.
pub fn broadleaves(random: &mut Random) -> Vec<Sprite> {
    const GREENS: [[f32; 3]; 4] =
        [[78.0, 88.0, 46.0], [64.0, 82.0, 44.0], [92.0, 92.0, 50.0], [70.0, 76.0, 48.0]];
    GREENS.map(|green| broadleaf(green, random)).into()
}

fn broadleaf(green: [f32; 3], random: &mut Random) -> Sprite {
    let lattice = Lattice::new(random);
    // The crown is made of a few masses.
    let masses: Vec<[f32; 4]> = (0..7)
        .map(|i| {
            let angle = f64::from(i) * 0.9 + random.uniform(0.0, 0.6);
            let out = if i == 0 { 0.0 } else { random.uniform(0.3, 0.55) };
            let (x, y) = (out * libm::cos(angle), 0.37 + 0.5 * out * libm::sin(angle));
            [x as f32, y as f32, random.uniform(0.34, 0.5) as f32, random.uniform(-0.09, 0.09) as f32]
        })
        .collect();
    Sprite::drawn(|x, y| {
        let [clump, twig, leaf] = lattice.foliage(x, y * 2.0);
        let ragged = 0.16 * clump + 0.14 * twig + 0.1 * leaf;
        let mut best: Option<(f32, f32, f32, f32)> = None;
        for &[cx, cy, radius, tint] in &masses {
            let (dx, dy) = ((x - cx) / radius, (y - cy) * 2.0 / radius);
            let inside = 1.0 - (dx * dx + dy * dy).sqrt() + ragged;
            if inside > 0.0 && best.is_none_or(|best| inside > best.0) {
                best = Some((inside, dx, dy, tint));
            }
        }
        if let Some((inside, dx, dy, tint)) = best {
            // The sky shines through where leaves are few.
            if inside < 0.16 && leaf > 0.25 {
                return None;
            }
            let light = 0.8 - 0.2 * dx - 0.3 * dy - 0.3 * (y - 0.3) + tint + 0.26 * twig + 0.3 * leaf;
            return Some(green.map(|c| c * light.clamp(0.22, 1.6)));
        }
        let lean = 0.03 * (y - 0.5) + 0.02 * twig;
        let half = 0.035 + 0.03 * ((y - 0.86).max(0.0) * 8.0);
        (y > 0.5 && (x - lean).abs() < half)
            .then(|| [74.0, 62.0, 50.0].map(|c| c * (0.8 - 5.0 * (x - lean) + 0.3 * leaf).clamp(0.3, 1.2)))
    })
}

/// Conifers, each another one.
pub fn conifers(random: &mut Random) -> Vec<Sprite> {
    const GREENS: [[f32; 3]; 3] = [[46.0, 62.0, 42.0], [54.0, 66.0, 46.0], [42.0, 56.0, 44.0]];
    GREENS.map(|green| conifer(green, random)).into()
}

fn conifer(green: [f32; 3], random: &mut Random) -> Sprite {
    let lattice = Lattice::new(random);
    let full = random.uniform(0.75, 0.95) as f32;
    Sprite::drawn(|x, y| {
        let [clump, twig, leaf] = lattice.foliage(x, y * 2.2);
        // Branches hang in tiers that never quite match from side to side.
        let tier = y * 13.0 + 0.6 * clump + if x < 0.0 { 0.35 } else { 0.0 };
        let within = tier - tier.floor();
        let half = (y / 0.93) * full * (0.62 + 0.38 * within) + 0.05 * twig + 0.06 * leaf + 0.015;
        if y < 0.94 && x.abs() < half {
            if x.abs() > 0.7 * half && leaf > 0.35 {
                return None;
            }
            let light = 0.78 - 0.3 * x / half.max(0.05) - 0.34 * (1.0 - within) + 0.2 * twig + 0.3 * leaf;
            return Some(green.map(|c| c * light.clamp(0.2, 1.5)));
        }
        (y > 0.9 && x.abs() < 0.045).then(|| [66.0, 54.0, 44.0].map(|c| c * (0.8 - 5.0 * x)))
    })
}

/// Bushes, each another one.
pub fn bushes(random: &mut Random) -> Vec<Sprite> {
    const GREENS: [[f32; 3]; 3] = [[86.0, 90.0, 52.0], [104.0, 98.0, 60.0], [70.0, 80.0, 48.0]];
    GREENS
        .map(|green| {
            let lattice = Lattice::new(random);
            Sprite::drawn(|x, y| {
                let [clump, twig, leaf] = lattice.foliage(x * 0.8, y);
                let up = (1.0 - y) / 0.86;
                let inside = 1.0 - (x * x * 1.1 + up * up).sqrt() + 0.2 * clump + 0.16 * twig + 0.1 * leaf;
                if inside < 0.0 || inside < 0.15 && leaf > 0.2 {
                    return None;
                }
                let light = 0.75 + 0.4 * (up - 0.4) - 0.16 * x + 0.24 * twig + 0.32 * leaf;
                Some(green.map(|c| c * light.clamp(0.25, 1.5)))
            })
        })
        .into()
}

/// The post of a sign, `half` wide where the picture is 1 from its middle to its edge.
fn post(x: f32, half: f32) -> Option<[f32; 3]> {
    (x.abs() < half).then(|| [128.0, 130.0, 132.0].map(|c| c * (0.85 - 0.3 * x / half)))
}

/// A round sign with a red ring, and a number on it.
pub fn limit_sign() -> Sprite {
    Sprite::drawn(|x, y| {
        // 0.75 m wide, 2.6 m high: the disc takes up the uppermost 0.75 m.
        let down = (y * 2.6 / 0.375) - 1.0;
        let from_middle = (x * x + down * down).sqrt();
        if from_middle < 0.99 {
            let red = from_middle > 0.76;
            // Two digits, as strokes: a six and a zero.
            let digit = |cx: f32| {
                let (dx, dy) = ((x - cx) / 0.2, down / 0.36);
                let ring = (dx * dx + dy * dy).sqrt();
                (0.62..1.05).contains(&ring)
            };
            let six = digit(-0.27) && !(x > -0.22 && (-0.3..-0.08).contains(&down));
            return Some(match (red, six || digit(0.27)) {
                (true, _) => [186.0, 30.0, 34.0],
                (false, true) => [32.0, 32.0, 34.0],
                (false, false) => [226.0, 226.0, 222.0],
            });
        }
        (y > 0.2).then(|| post(x, 0.09)).flatten()
    })
}

/// A triangle with a red border and a bend on it.
pub fn warning_sign() -> Sprite {
    Sprite::drawn(|x, y| {
        // 0.95 m wide and 2.7 m high: the triangle takes up the uppermost 0.83 m.
        let down = y * 2.7 / 0.83;
        if (0.0..1.0).contains(&down) && x.abs() < down {
            let edge = ((down - x.abs()) * 0.5).min(1.0 - down);
            let arrow = (0.42..0.84).contains(&down) && (x - 0.25 * (0.62 - down)).abs() < 0.09;
            return Some(match (edge < 0.11, arrow) {
                (true, _) => [186.0, 30.0, 34.0],
                (false, true) => [30.0, 30.0, 32.0],
                (false, false) => [228.0, 227.0, 220.0],
            });
        }
        (y > 0.28).then(|| post(x, 0.07)).flatten()
    })
}

/// A yellow board on two posts.
pub fn guide_sign() -> Sprite {
    Sprite::drawn(|x, y| {
        if y < 0.34 {
            let border = x.abs() > 0.95 || !(0.02..0.32).contains(&y);
            let line =
                |top: f32, from: f32, to: f32| (top..top + 0.055).contains(&y) && (from..to).contains(&x);
            let written = line(0.07, -0.8, 0.35) || line(0.19, -0.8, 0.1);
            let arrow = (x - 0.66).abs() < 0.04 && (0.07..0.28).contains(&y)
                || (y - 0.07 - (x - 0.66).abs() * 0.25).abs() < 0.025 && (x - 0.66).abs() < 0.18;
            // Letters are too small to be told apart: every other bit is bright.
            let letter = written && ((x * 19.0).floor() as i32).rem_euclid(4) != 3;
            return Some(if border || letter || arrow { [34.0, 33.0, 30.0] } else { [222.0, 182.0, 58.0] });
        }
        post((x.abs() - 0.7) * 2.0, 0.08)
    })
}
