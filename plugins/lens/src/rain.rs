//! Drops that stay where they hit the glass.

use pdk_sdk::prelude::*;

use crate::births::Cell;
use crate::lens::smooth;
use crate::water::Drop;

/// Longest life of a drop in seconds.
pub const LIFETIME: i64 = 11;
/// Mean life in seconds.
pub const MEAN_LIFE: f64 = 8.0;
/// A drop consists of this many caps at most.
const CAPS: usize = 3;

/// A drop that stays.
pub struct Sitting {
    /// When it hit the glass, in seconds.
    pub born: f64,
    pub rank: f32,
    pub x: f32,
    pub y: f32,
    /// Radius relative to the size that the intensity asks for.
    pub radius: f32,
    /// Seconds until it has dried.
    life: f32,
    /// Share by which it grows.
    growth: f32,
    /// Smaller caps beside the first: direction times distance, and radius, all relative to the radius of the drop.
    beside: [[f32; 3]; CAPS - 1],
    wobble: [f32; 4],
}

impl Sitting {
    /// A drop as the random numbers of its cell have it.
    pub fn born(cell: Cell, random: &mut Random) -> Self {
        let born = cell.time(random);
        let x = cell.x(random);
        let mut draw = |low: f64, high: f64| random.uniform(low, high) as f32;
        // Most are small.
        let large = draw(0.0, 1.0);
        let radius = 0.1 + 0.12 * large + 0.62 * large * large * large * large * large;
        let mut beside = [[0.0; 3]; CAPS - 1];
        for cap in &mut beside {
            let angle = draw(0.0, std::f64::consts::TAU);
            let distance = draw(0.45, 1.05);
            // Small drops are round: surface tension wins.
            let size = draw(0.0, 0.75) * smooth((radius - 0.15) / 0.25);
            *cap = [libm::cosf(angle) * distance, libm::sinf(angle) * distance, size];
        }
        Self {
            born,
            rank: draw(0.0, 1.0),
            x,
            y: draw(-0.05, 1.05),
            radius,
            life: draw(MEAN_LIFE * 2.0 - LIFETIME as f64, LIFETIME as f64),
            growth: draw(0.0, 0.35),
            beside,
            wobble: [draw(-0.15, 0.15), draw(-0.08, 0.16), draw(-0.09, 0.09), draw(-0.09, 0.04)],
        }
    }

    /// Its radius at a time relative to its full one; 0 before its birth and after it has dried.
    pub fn scale_at(&self, time: f64) -> f32 {
        let age = (time - self.born) as f32;
        if !(0.0..self.life).contains(&age) {
            return 0.0;
        }
        let dried = smooth((age - (self.life - 2.0)) / 2.0);
        smooth(age / 0.12) * (1.0 - self.growth * (1.0 - age / self.life)) * (1.0 - dried)
    }

    /// Calls `add` with the caps it consists of, for a radius of `radius` heights.
    pub fn caps(&self, radius: f32, mut add: impl FnMut(&Drop)) {
        let drop = Drop { x: self.x, y: self.y, radius, tail: 0.0, wobble: self.wobble };
        add(&drop);
        for [right, down, size] in self.beside {
            if size > 0.2 {
                let (x, y) = (self.x + right * radius, self.y + down * radius);
                add(&Drop { x, y, radius: size * radius, ..drop });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::births::{Births, COLUMN};
    use crate::lens::Lens;

    #[test]
    fn as_many_drops_sit_as_births_and_lives_say() {
        let lens = Lens { width: 800, height: 200, unit: 200.0 };
        let mut births = Births::new(1);
        let mut count = 0;
        for time in [20.0, 50.5, 80.9] {
            births.advance(&Key([2; 32]), &lens, 0.0, (time, LIFETIME), |cell, random, into| {
                into.extend((0..20).map(|_| Sitting::born(cell, random)));
            });
            count += births.iter().filter(|(_, drop)| drop.scale_at(time) > 0.0).count();
            // Nothing that is older than the window would be there still.
            assert!(births.iter().all(|(_, drop)| drop.scale_at(drop.born + LIFETIME as f64) == 0.0));
        }
        // Eight columns; a drop is born every twentieth of a second in each.
        let expected = 3.0 * 8.0 * 20.0 * MEAN_LIFE;
        assert_eq!(COLUMN * 8.0, 4.0);
        assert!((f64::from(count as u32) / expected - 1.0).abs() < 0.05, "{count}, not {expected}");
    }

    #[test]
    fn drops_grow_and_dry_smoothly() {
        let cells = std::cell::RefCell::new(Vec::new());
        let mut births = Births::<()>::new(1);
        let lens = Lens { width: 10, height: 10, unit: 10.0 };
        births.advance(&Key([2; 32]), &lens, 0.0, (0.0, 9), |cell, random, _| {
            cells.borrow_mut().push(Sitting::born(cell, random));
        });
        for drop in cells.into_inner() {
            let scale = |i: u32| drop.scale_at(drop.born + f64::from(i) / 100.0);
            assert_eq!(scale(0), 0.0);
            assert!(scale(100) > 0.5);
            let steps = (12..1200).map(|i| (scale(i + 1) - scale(i)).abs());
            assert!(steps.fold(0.0, f32::max) < 0.01);
        }
    }
}
