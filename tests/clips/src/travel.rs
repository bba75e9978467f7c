//! Things in the air that a moving camera passes: where they are at a time, and where they are seen. After one clip everything is where
//! something was at its beginning, so the clip repeats.

use pdk_ops::Random;

use crate::canvas::SIZE;

/// How what hangs in the air moves as the camera sees it, in metres a second: to the right, down, away. And the seconds of a clip.
pub struct Travel {
    pub velocity: [f32; 3],
    pub seconds: f32,
}

/// Pixels that a metre has at a distance of one: the width covers 80 degrees.
const FOCAL: f32 = 0.596 * SIZE.0 as f32;
/// Where what comes straight on is seen: the vanishing point of a road, a little above the middle.
const VANISHING: [f32; 2] = [0.5 * SIZE.0 as f32, 0.45 * SIZE.1 as f32];
/// Nothing nearer than this is drawn, in metres.
const NEAREST: f32 = 0.35;

/// The part of the air that is filled: what leaves it on one side comes in on the other.
pub struct Space {
    size: [f32; 3],
    /// So many times it lies above itself, and as often below.
    copies: i32,
}

impl Space {
    /// Space about so wide, high and deep, in metres; along each axis things cross it a whole number of times in a clip, so it has
    /// to lie above itself several times where they hardly fall.
    pub fn around(travel: &Travel, wanted: [f32; 3]) -> Self {
        let size = [0, 1, 2].map(|axis| match (travel.velocity[axis] * travel.seconds).abs() {
            moved if moved > 0.0 => moved / (moved / wanted[axis]).floor().max(1.0),
            _ => wanted[axis],
        });
        let copies = (0.5 * (wanted[1] / size[1] - 1.0)).ceil().max(0.0) as i32;
        Self { size, copies }
    }

    /// Any place in it.
    pub fn place(&self, random: &mut Random) -> [f32; 3] {
        self.size.map(|size| random.uniform(0.0, f64::from(size)) as f32)
    }

    /// The places of something that began at a place, at a time of the clip, 0 to 1, from the camera: to the right, down, away.
    pub fn at(&self, start: [f32; 3], travel: &Travel, time: f32) -> impl Iterator<Item = [f32; 3]> {
        let moved = |axis: usize| start[axis] + travel.velocity[axis] * travel.seconds * time;
        let [right, down, away] = [0, 1, 2].map(|axis| moved(axis).rem_euclid(self.size[axis]));
        let (size, copies) = (self.size, self.copies);
        (-copies..=copies)
            .map(move |copy| [right - 0.5 * size[0], down + size[1] * (copy as f32 - 0.5), away])
    }

    /// How visible something is at a place: it fades where space ends, so that nothing appears at once.
    pub fn fade(&self, at: [f32; 3]) -> f32 {
        let rest = |value: f32, end: f32, over: f32| ((end - value.abs()) / over).clamp(0.0, 1.0);
        let high = self.size[1] * (self.copies as f32 + 0.5);
        let aside = rest(at[0], 0.5 * self.size[0], 0.5) * rest(at[1], high, 0.5);
        let near = ((at[2] - NEAREST) / 0.3).clamp(0.0, 1.0);
        aside * near * rest(at[2], self.size[2], 2.0)
    }
}

/// Where a place is seen in the picture, and how many pixels a metre has there; none where it is too near or behind.
pub fn project([right, down, away]: [f32; 3]) -> Option<([f32; 2], f32)> {
    (away > NEAREST).then(|| {
        let scale = FOCAL / away;
        ([VANISHING[0] + right * scale, VANISHING[1] + down * scale], scale)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_ops::Key;

    #[test]
    fn after_a_clip_everything_is_where_something_was() {
        let rain = Travel { velocity: [0.0, 8.0, -10.0], seconds: 3.0 };
        let snow = Travel { velocity: [0.0, 1.4, -8.0], seconds: 4.0 };
        for (travel, copies) in [(rain, 0), (snow, 2)] {
            let space = Space::around(&travel, [18.0, 24.0, 30.0]);
            assert_eq!(space.copies, copies);
            let mut random = Key([1; 32]).sequence();
            for _ in 0..100 {
                let start = space.place(&mut random);
                let ends = [0.0, 1.0].map(|time| space.at(start, &travel, time).next().unwrap());
                for axis in 0..3 {
                    let off = (ends[1][axis] - ends[0][axis]).abs();
                    // The same place may be on the other side.
                    assert!(off < 1e-3 || (off - space.size[axis]).abs() < 1e-3, "{ends:?}");
                }
            }
        }
    }

    #[test]
    fn what_comes_on_moves_away_from_the_vanishing_point() {
        let (near, _) = project([1.0, 0.5, 4.0]).unwrap();
        let (far, _) = project([1.0, 0.5, 8.0]).unwrap();
        assert!(near[0] > far[0] && far[0] > VANISHING[0] && near[1] > far[1] && far[1] > VANISHING[1]);
        assert!(project([0.0, 0.0, 0.1]).is_none());
    }
}
