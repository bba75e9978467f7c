//! Drops that slide: they grow where they hit the glass until they are too heavy, then run down it by fits and starts,
//! swallow what is in their way and leave a wet track with small drops.

use pdk_sdk::prelude::*;

use crate::births::Cell;
use crate::lens::{haste, smooth};

/// Steps of the path that a slider's table holds, each [`STEP`] heights down.
const STEPS: usize = 145;
const STEP: f32 = 0.01;
/// The speed of a slider is a mean over this many heights before and behind it.
const AROUND: f32 = 0.03;
/// Drops left behind by one slider at most.
pub const BEADS: usize = 48;
/// A slider has left the frame or dried up this many seconds after it began to slide.
const SLIDING: f32 = 11.0;
/// Longest time for which it grows before that, in seconds.
const GROWING: f64 = 7.0;
/// How long a second drop takes to run into it before it begins to slide, in seconds.
const JOINING: f32 = 0.5;
/// How far to the side a slider may get, in heights.
pub const DRIFT: f32 = 0.5;
/// A track or swallowed drop shows no longer than this after a slider has passed, in seconds.
pub const AFTERMATH: f64 = 12.0;
/// Seconds after its birth for which a slider matters.
pub const LIFETIME: i64 = (GROWING + SLIDING as f64 + AFTERMATH) as i64 + 1;

/// A small drop left behind.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bead {
    pub x: f32,
    pub y: f32,
    /// Radius relative to the slider's.
    pub radius: f32,
    /// Seconds until it has dried.
    pub life: f32,
    /// The slider passes here after this much progress.
    pub progress: f32,
    pub wobble: f32,
}

/// A drop that will slide, with its path.
pub struct Slider {
    /// When it hit the glass, in seconds.
    pub born: f64,
    pub rank: f32,
    /// Radius relative to the size that the intensity asks for.
    pub radius: f32,
    pub wobble: [f32; 4],
    /// Seconds until it slides.
    grows: f32,
    /// Speed relative to the typical one.
    speed: f32,
    /// From which side the last drop joins.
    side: f32,
    /// Where it hit the glass.
    pub x: f32,
    pub y: f32,
    /// The leftmost and rightmost place of its path.
    pub reach: [f32; 2],
    /// Its place to the side, and how much progress it has made, at each step down.
    sideways: [f32; STEPS],
    progress: [f32; STEPS],
    pub beads: [Bead; BEADS],
}

impl Slider {
    /// A slider as the random numbers of its cell have it.
    pub fn born(cell: Cell, random: &mut Random) -> Self {
        let born = cell.time(random);
        let x = cell.x(random);
        let mut draw = |low: f64, high: f64| random.uniform(low, high) as f32;
        let y = draw(-0.1, 0.75);
        let rank = draw(0.0, 1.0);
        // One in four is small and fast: a streak.
        let streak = draw(0.0, 1.0) < 0.25;
        let (radius, speed) = match streak {
            true => (draw(0.35, 0.55), draw(2.2, 3.6)),
            false => (draw(0.65, 1.1), draw(0.6, 1.5)),
        };
        let grows = if streak { draw(0.3, 1.5) } else { draw(2.5, GROWING) };
        let side = if draw(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let wobble = [draw(-0.1, 0.1), draw(-0.08, 0.08), draw(-0.05, 0.05), draw(-0.06, 0.02)];

        let (mut sideways, mut progress) = ([0.0; STEPS], [0.0; STEPS]);
        let mut slant = draw(-0.25, 0.25);
        // Progress that one step takes; it sticks for a while wherever the glass is dirty.
        let (mut slowness, mut target) = (4.0, 1.0);
        for i in 1..STEPS {
            slant = slant * 0.93 + draw(-0.12, 0.12);
            if draw(0.0, 1.0) < if streak { 0.02 } else { 0.06 } {
                target = draw(3.0, 14.0);
            } else if draw(0.0, 1.0) < 0.35 {
                target = draw(0.5, 1.3);
            }
            slowness += (target - slowness) * 0.45;
            let last: f32 = sideways[i - 1];
            sideways[i] = (last + STEP * slant).clamp(-DRIFT, DRIFT);
            progress[i] = progress[i - 1] + STEP * slowness;
        }
        let mut slider = Self {
            born,
            rank,
            radius,
            wobble,
            grows,
            speed: speed * haste(rank),
            side,
            x,
            y,
            reach: [
                x + sideways.iter().fold(0.0, |a: f32, &b| a.min(b)),
                x + sideways.iter().fold(0.0, |a: f32, &b| a.max(b)),
            ],
            sideways,
            progress,
            beads: [Bead::default(); BEADS],
        };
        let mut down = 0.02;
        for bead in &mut slider.beads {
            down += draw(0.008, 0.045);
            let y = y + down;
            let (across, progress) = interpolate(&slider.sideways, &slider.progress, down);
            *bead = Bead {
                x: x + across + draw(-0.35, 0.35) * radius * 0.03,
                y,
                radius: draw(0.08, 0.2) + 0.2 * draw(0.0, 1.0) * draw(0.0, 1.0),
                life: draw(2.5, AFTERMATH * 0.9),
                progress,
                wobble: draw(-0.18, 0.18),
            };
        }
        slider
    }

    /// For how many seconds it slides, where `speed` is the typical one.
    pub fn slides(&self, speed: f32) -> f32 {
        SLIDING.min(self.progress[STEPS - 1] / (speed * self.speed))
    }

    /// The place of its path at the height `y`, and the progress it has made there; `None` above its start and below its end.
    pub fn at_height(&self, y: f32) -> Option<(f32, f32)> {
        let down = y - self.y;
        if !(0.0..(STEPS - 1) as f32 * STEP).contains(&down) {
            return None;
        }
        let (across, progress) = interpolate(&self.sideways, &self.progress, down);
        Some((self.x + across, progress))
    }

    /// Its state at a time, where `speed` is the typical one; `None` before its birth.
    pub fn at_time(&self, time: f64, speed: f32) -> Option<Sliding> {
        let age = (time - self.born) as f32;
        if age < 0.0 {
            return None;
        }
        let pace = speed * self.speed;
        let slid = age - self.grows;
        let progress = slid.max(0.0) * pace;
        let after = self.progress.partition_point(|&p| p <= progress).min(STEPS - 1);
        let (before, ahead) = (self.progress[after - 1], self.progress[after]);
        let fraction = ((progress - before) / (ahead - before)).min(1.0);
        let down = ((after - 1) as f32 + fraction) * STEP;
        let passed = |down: f32| interpolate(&self.sideways, &self.progress, down).1;
        // Beyond the ends of the table it goes on as it does there.
        let middle = down.clamp(AROUND, (STEPS - 1) as f32 * STEP - AROUND);
        let around = passed(middle + AROUND) - passed(middle - AROUND);
        let across = self.sideways[after - 1] + (self.sideways[after] - self.sideways[after - 1]) * fraction;
        // It hits the glass, grows, and dries up in the end.
        let growth = smooth(age / 0.12) * (0.62 + 0.38 * smooth(age / self.grows));
        Some(Sliding {
            x: self.x + across,
            y: self.y + down,
            scale: growth * remaining(slid),
            speed: if slid > 0.0 { pace * 2.0 * AROUND / around } else { 0.0 },
            progress,
            pace,
            slid,
            joining: (-slid / JOINING).clamp(0.0, 1.0),
            side: self.side,
        })
    }
}

/// What is left of the radius of a slider this many seconds after it began to slide.
fn remaining(slid: f32) -> f32 {
    smooth((SLIDING - slid) / 2.5)
}

/// The tables at a depth of `down` heights below the start, interpolated.
fn interpolate(sideways: &[f32; STEPS], progress: &[f32; STEPS], down: f32) -> (f32, f32) {
    let step = (down * (1.0 / STEP)).clamp(0.0, (STEPS - 1) as f32);
    let first = (step as usize).min(STEPS - 2);
    let fraction = step - first as f32;
    let between = |table: &[f32; STEPS]| table[first] + (table[first + 1] - table[first]) * fraction;
    (between(sideways), between(progress))
}

/// A slider at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Sliding {
    pub x: f32,
    pub y: f32,
    /// Radius relative to its full one.
    pub scale: f32,
    /// Heights per second.
    pub speed: f32,
    pub progress: f32,
    /// Progress per second.
    pub pace: f32,
    /// Seconds since it began to slide; negative before.
    pub slid: f32,
    /// 1 while the last drop is still apart from it, 0 when they are one.
    pub joining: f32,
    pub side: f32,
}

impl Sliding {
    /// Seconds since it was at a point of its path, given by progress, and its radius then relative to its full one;
    /// `None` if it has not been there.
    pub fn since(&self, progress: f32) -> Option<(f32, f32)> {
        let since = (self.progress - progress) / self.pace;
        // It comes no further once it has dried up.
        (since > 0.0 && self.slid - since < SLIDING).then(|| (since, remaining(self.slid - since)))
    }
}
