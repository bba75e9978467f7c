//! Flakes that land on the lens, stick, creep down in wide curves and melt.

use std::f64::consts::TAU;

use pdk_sdk::prelude::*;

use crate::births::Cell;
use crate::lens::{haste, smooth};
use crate::snow_cover::STAMPS;

/// Longest time that a flake takes to melt, in seconds.
const LONGEST_LIFE: f64 = 18.0;
/// Mean of it.
pub const MEAN_LIFE: f64 = 13.5;
/// How long what reached the lower edge lies there, in seconds.
const LYING: f32 = 16.0;
/// Seconds after its birth for which a flake matters.
pub const LIFETIME: i64 = (LONGEST_LIFE + LYING as f64) as i64 + 1;
/// A flake lies where its middle has come to this height.
const GROUND: f32 = 0.985;
/// Seconds in which a flake that came loose reaches its speed.
const EASE: f32 = 1.6;
/// Furthest that a flake drifts to the side, in heights.
pub const DRIFT: f32 = 0.16;

/// A flake.
pub struct Flake {
    /// When it landed, in seconds.
    pub born: f64,
    pub rank: f32,
    /// Where it landed.
    pub x: f32,
    pub y: f32,
    /// Radius relative to the size that the intensity asks for.
    pub radius: f32,
    /// Seconds until it comes loose, and until it has melted.
    sticks: f32,
    life: f32,
    /// Speed relative to the typical one.
    speed: f32,
    /// Width and wave number of its curves, and where in a curve it starts.
    sway: f32,
    wave: f32,
    phase: f32,
    /// Which stamp, and how it is turned.
    pub stamp: usize,
    pub turn: [f32; 2],
    /// Density in the middle.
    pub density: f32,
}

/// A flake at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    pub x: f32,
    pub y: f32,
    /// Radius relative to its full one.
    pub scale: f32,
    /// How much of it is snow still, from 1 to 0.
    pub frozen: f32,
    /// How much of it lies at the lower edge, from 0 to 1.
    pub lying: f32,
}

impl Flake {
    /// A flake as the random numbers of its cell have it.
    pub fn born(cell: Cell, random: &mut Random) -> Self {
        let born = cell.time(random);
        let x = cell.x(random);
        let stamp = random.below(STAMPS as u32) as usize;
        let mut draw = |low: f64, high: f64| random.uniform(low, high) as f32;
        let large = draw(0.0, 1.0);
        let turn = draw(0.0, TAU);
        let rank = draw(0.0, 1.0);
        Self {
            born,
            rank,
            x,
            y: draw(-0.05, 1.0),
            radius: 0.22 + 0.2 * large + 0.6 * large * large * large,
            sticks: draw(0.4, 5.0),
            life: draw(2.0 * MEAN_LIFE - LONGEST_LIFE, LONGEST_LIFE),
            speed: draw(0.3, 1.7) * haste(rank),
            sway: draw(0.02, f64::from(DRIFT) * 0.5),
            wave: draw(9.0, 22.0),
            phase: draw(0.0, TAU),
            stamp,
            turn: [libm::cosf(turn), libm::sinf(turn)],
            density: draw(0.6, 1.5),
        }
    }

    /// Its state at a time, where `speed` is the typical one; `None` before its birth and after its end.
    pub fn at_time(&self, time: f64, speed: f32) -> Option<Moment> {
        let age = (time - self.born) as f32;
        if !(0.0..LIFETIME as f32).contains(&age) {
            return None;
        }
        let pace = speed * self.speed;
        let loose = (age - self.sticks).max(0.0);
        let down = pace * loose * loose / (loose + EASE);
        let sideways = self.sway * (libm::sinf(self.phase + self.wave * down) - libm::sinf(self.phase));
        let melted = smooth((age / self.life - 0.45) / 0.55);

        // The time at which it comes to lie, from the path above solved for the loose seconds.
        let way = ((GROUND - self.y) / pace).max(0.0);
        let arrives = self.sticks + 0.5 * (way + (way * way + 4.0 * EASE * way).sqrt());
        let lies = age - arrives;
        // One that arrives almost melted leaves little, so that nothing depends on arriving a little sooner.
        let left = smooth((self.life - arrives) / 3.0);
        let lying = left * smooth(lies / 2.0) * (1.0 - smooth(lies / LYING));
        Some(Moment {
            x: self.x + sideways,
            y: self.y + down,
            scale: smooth(age / 0.2) * (1.0 - 0.25 * melted),
            frozen: 1.0 - melted,
            lying,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::births::Births;
    use crate::lens::Lens;

    #[test]
    fn flakes_come_down_slowly_and_lie_when_they_reach_the_ground() {
        let lens = Lens { width: 400, height: 300, unit: 300.0 };
        let mut births = Births::new(1);
        births.advance(&Key([4; 32]), &lens, 0.0, (0.0, 10), |cell, random, into: &mut Vec<Flake>| {
            into.extend((0..40).map(|_| Flake::born(cell, random)));
        });
        let (mut lay, mut count) = (0, 0);
        for (_, flake) in births.iter() {
            let moments: Vec<Moment> =
                (0..1000).filter_map(|i| flake.at_time(flake.born + f64::from(i) * 0.04, 0.04)).collect();
            for pair in moments.windows(2) {
                let down = pair[1].y - pair[0].y;
                assert!((0.0..0.04 * 1.7 * haste(flake.rank) * 0.0401).contains(&down), "{down}");
                assert!((pair[1].x - pair[0].x).abs() < 0.01);
                assert!((pair[1].lying - pair[0].lying).abs() < 0.05);
                assert!(pair[0].lying == 0.0 || pair[0].y > GROUND - 0.001);
            }
            assert!((moments[0].x - flake.x).abs() < 1e-6);
            lay += usize::from(moments.iter().any(|m| m.lying > 0.5));
            count += 1;
            // Before it is forgotten nothing is left of it.
            let last = moments[moments.len() - 1];
            assert!(last.frozen == 0.0 && last.lying < 1e-3, "{last:?}");
        }
        assert!(count > 500 && lay > count / 10 && lay < count * 3 / 4, "{lay} of {count}");
    }
}
