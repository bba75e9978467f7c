//! The sliders that exist in a frame, and what they swallow.

use crate::births::{Births, Place};
use crate::lens::{Density, Lens, smooth};
use crate::sliders::{DRIFT, Slider, Sliding};

/// A swallowed drop is gone after this many seconds.
const SWALLOWING: f32 = 0.12;
/// Width of a lane in heights of the frame: a drop meets only sliders that come into its lane.
const LANE: f32 = 0.1;

/// A slider that exists now.
#[derive(Clone, Copy)]
pub struct Sweeper {
    /// Which slider it is.
    pub place: Place,
    /// Full radius in heights of the frame.
    pub radius: f32,
    /// The leftmost and rightmost place that it sweeps.
    pub reach: [f32; 2],
    /// Seconds since it came to an end; negative before.
    pub over: f32,
    /// What it has swallowed, in cubed radii.
    pub swallowed: f32,
    pub state: Sliding,
    /// The highest place that it has swept.
    top: f32,
}

/// All sliders that exist now.
#[derive(Default)]
pub struct Sweepers {
    pub all: Vec<Sweeper>,
    /// For each lane those that come into it.
    lanes: Vec<Vec<u32>>,
    /// The left edge of the first lane.
    left: f32,
}

impl Sweepers {
    /// Finds the sliders that exist now and what has become of them. `size` is the radius of the largest drops.
    pub fn find(
        &mut self,
        sliders: &Births<Slider>,
        lens: &Lens,
        (time, dry_before): (f64, f64),
        (size, speed): (f32, f32),
        density: &Density<'_>,
    ) {
        self.left = -lens.half_width() - DRIFT;
        let lanes = (-2.0 * self.left / LANE).ceil() as usize;
        self.lanes.iter_mut().for_each(Vec::clear);
        self.lanes.resize_with(lanes, Vec::new);
        self.all.clear();
        // Room for as many as there can ever be, so that no later frame needs more.
        self.all.reserve(sliders.len());
        self.lanes.iter_mut().for_each(|lane| lane.reserve(sliders.len()));
        for (place, slider) in sliders.iter().filter(|(_, slider)| slider.born >= dry_before) {
            let presence = density.presence(slider.rank, slider.x, slider.y, slider.born);
            if presence <= 0.0 {
                continue;
            }
            let Some(state) = slider.at_time(time, speed) else { continue };
            let radius = slider.radius * size * presence;
            let reach = [slider.reach[0] - radius, slider.reach[1] + radius];
            if state.slid > 0.0 {
                let number = self.all.len() as u32;
                let lanes = self.lane(reach[0] - size)..=self.lane(reach[1] + size);
                self.lanes[lanes].iter_mut().for_each(|lane| lane.push(number));
            }
            let over = state.slid - slider.slides(speed);
            self.all.push(Sweeper { place, radius, reach, over, swallowed: 0.0, state, top: slider.y });
        }
    }

    fn lane(&self, x: f32) -> usize {
        (((x - self.left) * (1.0 / LANE)).max(0.0) as usize).min(self.lanes.len() - 1)
    }

    /// What sliders leave of the radius of a drop that has been at a place for `age` seconds, from 0 to 1. They grow by
    /// what they take.
    pub fn swallow(&mut self, sliders: &Births<Slider>, (x, y): (f32, f32), radius: f32, age: f32) -> f32 {
        let mut left = 1.0;
        for &number in &self.lanes[self.lane(x)] {
            let sweeper = &mut self.all[number as usize];
            // Most have come to an end before the drop was there, or have not come as far.
            if sweeper.over > age || y < sweeper.top || y > sweeper.state.y {
                continue;
            }
            let Some((path, progress)) = sliders.at(sweeper.place).at_height(y) else { continue };
            let met = sweeper.state.since(progress).filter(|&(since, _)| since < age);
            let Some((since, scale)) = met else { continue };
            // Drops at the edge of its way and those that have just come are swallowed in part, so that nothing depends
            // on whether a slider comes a little sooner or grows a little larger.
            let depth = 0.95 * scale * sweeper.radius + 0.4 * radius - (path - x).abs();
            let inside = smooth(depth / (0.35 * sweeper.radius));
            let share = smooth(since / SWALLOWING) * inside * smooth((age - since) / 0.3);
            sweeper.swallowed += 0.4 * share * left * radius * radius * radius;
            left *= 1.0 - share;
        }
        left
    }
}
